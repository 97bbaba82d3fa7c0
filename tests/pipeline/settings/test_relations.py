"""Relations between settings: missions drawn at random are accepted where all hold, else told what not."""

import dataclasses
from collections import Counter

import numpy as np
import pytest

from pipeline.settings.checks import SettingError
from pipeline.settings.mission import Mission
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
    for _ in range(2500):
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


def test_a_radius_is_no_setting_of_a_mesh():
    assert str(schema()["chief.inspection_radius_m"].only[0]) == "chief.shape=sphere"
