"""Relations between settings: missions drawn at random are accepted where all hold, else told what not."""

import dataclasses
import itertools
from collections import Counter
from contextlib import suppress

import numpy as np
import pytest

from pipeline.controllers import source
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.replanning import foresees
from pipeline.optimum.problem import check_light
from pipeline.settings.checks import SettingError
from pipeline.settings.mission import Mission
from pipeline.settings.places import conf_folder
from pipeline.settings.relations import RELATIONS, STANDARD_GRAVITY_M_S2
from pipeline.settings.schema import schema

#: parts that a mission may have, by which relations apply
KINDS = (
    {},
    {"safety": {"kind": "filter"}},
    {"safety": {"kind": "filter", "probability": 0.9}, "navigation": {"mode": "fixes"}},
    {"dynamics": {"model": "two_body", "drag_m_s2": 0.03, "radiation_m_s2": 0.01}},
    {"actuators": {"kind": "real", "specific_impulse_s": 60.0, "propellant_kg": 0.5}},
    {"actuators": {"kind": "real", "delay_s": 10.0}, "navigation": {"mode": "fixes", "delay_s": 10.0}},
)
KEYS = sorted({key for row in RELATIONS for key in row.keys})


def drawn(random: np.random.Generator) -> dict:
    """Settings of a mission, of which a few keys of one relation are off by a factor."""
    settings = {group: dict(values) for group, values in KINDS[random.integers(len(KINDS))].items()}
    row = RELATIONS[random.integers(len(RELATIONS))]
    for key in random.permutation(row.keys)[: random.integers(1, 4)]:
        group, _, name = str(key).rpartition(".")
        node = settings.setdefault(group, {}) if group else settings
        value = node.get(name, schema()[str(key)].default)
        if isinstance(value, int | float) and value:
            factor = float(random.choice([0.5, 2.0, 10.0 ** random.uniform(-4, 4)]))
            node[name] = max(1, round(value * factor)) if isinstance(value, int) else value * factor
    return settings


def mission_of(settings: dict) -> Mission:
    return Mission(**settings)


def breaks(settings: dict) -> str:
    """What is wrong with a mission, by rules written anew; nothing if it should fly."""
    plain = {name: dataclasses.asdict(getattr(Mission(), name)) | settings.get(name, {}) for name in GROUPS}
    top = {name: settings.get(name, getattr(Mission(), name)) for name in CLOCKS}
    deputy, chief, motion = plain["deputy"], plain["chief"], plain["orbit"]["mean_motion_rad_s"]
    force, mass, period = deputy["max_force_n"], deputy["mass_kg"], top["control_period_s"]
    push = force / mass
    if chief["inspection_radius_m"] > deputy["min_distance_m"]:
        return "body"
    if push < 3 * motion**2 * deputy["min_distance_m"]:
        return "holding"
    dynamics = plain["dynamics"]
    if (
        dynamics["model"] == "two_body"
        and abs(dynamics["drag_m_s2"]) + abs(dynamics["radiation_m_s2"]) >= push
    ):
        return "disturbances"
    actuators = plain["actuators"]
    if actuators.get("specific_impulse_s") is not None:
        spent = 3 * force * period / (STANDARD_GRAVITY_M_S2 * actuators["specific_impulse_s"])
        if actuators["propellant_kg"] + spent >= mass:
            return "propellant"
    return ""


GROUPS = ("deputy", "chief", "orbit", "dynamics", "actuators")
CLOCKS = ("control_period_s", "attitude_period_s", "duration_s")


def test_missions_drawn_at_random_are_accepted_or_told_what_does_not_fit():
    random, outcomes = np.random.default_rng(7), Counter()
    for _ in range(5000):
        settings = drawn(random)
        fault = breaks(settings)
        try:
            mission_of(settings)
        except SettingError as error:
            words = str(error)
            assert ";" in words, words
            assert any(name in words for key in KEYS for name in (key, key.rpartition(".")[2])), words
            outcomes[fault or "others"] += 1
        else:
            assert not fault, (fault, settings)
            outcomes["accepted"] += 1
    # each new kind of fault was met, and many missions fly
    assert outcomes["accepted"] > 300
    assert min(outcomes[name] for name in ("body", "holding", "disturbances", "propellant")) > 5


@pytest.mark.parametrize("row", RELATIONS, ids=lambda row: row.refusals.__name__.strip("_"))
def test_a_relation_names_its_settings(row):
    assert row.refusals.__doc__.startswith("Check that ")
    assert len(row.keys) >= 2
    assert set(row.keys) <= schema().keys()


def test_edges_belong_to_what_is_accepted():
    deputy = {"mass_kg": 10.0, "min_distance_m": 20.0, "max_distance_m": 100.0}
    motion = 0.001
    least = 3 * 10.0 * motion**2 * 20.0
    orbit = {"mean_motion_rad_s": motion}
    mission_of({"deputy": deputy | {"max_force_n": least * (1 + 1e-12)}, "orbit": orbit})
    with pytest.raises(SettingError, match="to stand still above the chief"):
        mission_of({"deputy": deputy | {"max_force_n": least * (1 - 1e-9)}, "orbit": orbit})
    mission_of({"chief": {"inspection_radius_m": 15.0}})
    with pytest.raises(SettingError, match="a flight through the chief keeps its limits"):
        mission_of({"chief": {"inspection_radius_m": 15.01}})
    mission_of({"sensor": {"max_range_m": 5.01}})
    mission_of({"sensor": {"max_range_m": 5.0}, "chief": {"inspection_radius_m": 10.01}})
    with pytest.raises(SettingError, match="must be more than 5, or no point is ever within range"):
        mission_of({"sensor": {"max_range_m": 5.0}})


def test_a_radius_is_no_setting_of_a_mesh():
    assert str(schema()["chief.inspection_radius_m"].only[0]) == "chief.shape=sphere"


BOOM = ((30.0, 0.0, 0.0, 6.0),)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"chief": {"keep_out_m": ((3.0, 4.0, 0.0, 9.9),)}}, r"reaches 14.9 m .* forbids nothing"),
        ({"chief": {"keep_out_m": ((0.0, 0.0, 199.0, 2.0),)}}, "reaches 201 m"),
        ({"chief": {"keep_out_m": ((1.0, 2.0, 3.0),)}}, "must be four numbers"),
        ({"chief": {"keep_out_m": BOOM}, "safety": {"kind": "filter"}}, "safety.kind=filter does not keep"),
        ({"chief": {"keep_out_m": BOOM}, "problem": {"kind": "reach"}}, "only inspections know"),
        ({"sensor": {"rectangle_deg": (9.0, 6.0), "up": (1.0, 0.0, 0.0)}}, "along one line"),
        ({"sensor": {"rectangle_deg": (90.0, 6.0)}}, "less than 90"),
        ({"deputy": {"max_momentum_n_m_s": 0.0011}}, r"to turn with the orbit takes 0.00111 N m s"),
    ],
)
def test_rectangles_spheres_and_wheels_that_do_not_fit(settings, words):
    with pytest.raises(SettingError, match=words):
        mission_of(settings)


def plans_by_world(controller):
    """Whether a controller foresees flights, or has a planner that holds the mission's world."""
    return foresees(controller) or hasattr(getattr(controller, "planner", None), "world")


def test_whatever_plans_refuses_what_plans_do_not_know():
    """Each shipped controller that plans by the mission's world, of whatever kind, and the optimum."""
    home, planners = Mission(), {}
    boom, rectangle, focus = (
        {"chief": {"keep_out_m": BOOM}},
        {"rectangle_deg": (9.0, 6.0)},
        {"min_range_m": 5.0},
    )
    missions = [mission_of(each) for each in (boom, {"sensor": rectangle}, {"sensor": focus})]
    for path in sorted((conf_folder() / "controller").glob("*.yaml")):
        if path.stem not in source.WITH_PATHS:
            with suppress(SettingError):  # one that docks
                controller = source.named(path.stem, home)
                planners[path.stem] = plans_by_world(controller)
    for name, mission in itertools.product(planners, missions):
        if planners[name]:
            with pytest.raises((SettingError, ControllerError), match="do not know of; set it to"):
                law_of(source.named(name, mission), mission)
        else:
            law_of(source.named(name, mission), mission)
    assert min(planners[name] for name in ("natural_motion", "receding_horizon", "champion_leo_rehearsed"))
    for mission in missions:
        with pytest.raises(SettingError, match="plans of least fuel do not know of"):
            check_light(mission)
