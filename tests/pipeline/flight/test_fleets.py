"""Fleets: compared with the reference period by period, with one deputy, and by what leaving may do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load, named
from pipeline.flight.control.controller import ControllerError, coast
from pipeline.flight.fly.fleets import OF_DEPUTIES, lost_messages, room_for_messages
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.reference import fleet as reference
from pipeline.flight.state.arrays import NUM_TRACKED, TRACK_FORCE, TRACK_LEFT
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import SettingError
from pipeline.settings.fleet import SHARING
from pipeline.settings.stages import OF_FLEETS, STAGES
from tests import night

EVALUATION = ("+experiment=evaluate_fleet", "controller=champion_27", "sun=random", "monte_carlo.num_cases=7")


def experiment_of(*words: str):
    return compose_experiment([*EVALUATION, *words]).experiment


def flown(*words: str, deputies: int = 2, num_tracked: int = NUM_TRACKED):
    experiment = experiment_of(f"fleet.deputies={deputies}", *words)
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    shape = len(scenarios), deputies, mission.num_controls + 1, num_tracked
    tracks = np.full(shape, np.nan, np.float32)
    controller = load(experiment.controller, mission)
    return fly_all(mission, controller, scenarios, 1, tracks), tracks, mission, controller, scenarios


#: of a mission each, what a fleet is compared with the reference in
FLEETS = {
    "who heed nothing": ("fleet.sharing=nothing",),
    "who heed a mask": ("fleet.sharing=mask", "guidance=clusters"),
    "who leave what coasting shows": ("fleet.sharing=leave", "monte_carlo.parked=true"),
    "who leave what is nearer to others": ("fleet.sharing=nearer", "fleet.deputies=3"),
    "in a low orbit, with fixes and real thrusters": ("world=leo",),
    "with fixes and real thrusters in the paper's light": ("navigation=fixes", "actuators=real"),
    "who lose messages": ("fleet.lost_percent=60", "fleet.deputies=3", "monte_carlo.parked=true"),
    "who hear late": ("fleet.delay_periods=3", "monte_carlo.parked=true"),
    "who hear a mask late or never": ("fleet.sharing=mask", "fleet.delay_periods=1", "fleet.lost_percent=30"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", night.by_day([*FLEETS], 2))  # the others are compiled for this alone
def test_fleets_are_those_of_the_reference_period_by_period(name):
    words = ("duration_s=600", "attitude=ideal", "monte_carlo.num_cases=2", *FLEETS[name])
    deputies = 3 if "fleet.deputies=3" in words else 2
    outcomes, tracks, mission, controller, scenarios = flown(*words, deputies=deputies)
    case = 1
    flights = [reference_of(mission.of_each, controller, start) for start in scenarios[case].fleet]
    fleet, num_left, lost = reference.start(flights), 0, lost_messages(mission, [scenarios[case]])
    for k in range(mission.num_controls + 1):
        truths = [state.truth.copy() for state in fleet.deputies]
        looks, acts = reference.fleet_period(
            flights, k, fleet, mission.fleet, lost[0, k] > 0 if len(lost) else None
        )
        np.testing.assert_allclose(tracks[case, :, k, :6], truths, rtol=1e-5, atol=1e-4, err_msg=f"{k}")
        if mission.fleet.sharing != "nothing":
            is_open = fleet.seen_by == reference.NOBODY
            known = np.array([state.is_inspected for state in fleet.deputies])
            if acts:
                assert (tracks[case, :, k, TRACK_LEFT] == (~known).sum(axis=1)).all(), k
            num_left += sum((look.is_inspected & is_open).sum() for look in looks)
        if acts:
            fired = [act.thrust.fired for act in acts]
            np.testing.assert_allclose(tracks[case, :, k, TRACK_FORCE : TRACK_FORCE + 3], fired, atol=1e-5)
    assert (num_left > 0) == (mission.fleet.sharing in ("leave", "nearer"))
    assert outcomes.inspected_count[case] == np.sum(fleet.seen_by != reference.NOBODY)
    seen_first = outcomes.of_deputies[case, :, OF_DEPUTIES.index("inspected_count")]
    assert seen_first.tolist() == [np.sum(fleet.seen_by == deputy) for deputy in range(deputies)]


@pytest.mark.parametrize("sharing", SHARING)
def test_a_fleet_of_one_flies_the_bits_of_one_deputy(sharing):
    experiment = compose_experiment(["+experiment=evaluate", *EVALUATION[1:]]).experiment
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    alone = fly_all(mission, named("champion_27", mission), scenarios, 1)
    fleet = replace(mission.fleet, sharing=sharing)
    fleets = fly_all_fleets(replace(mission, fleet=fleet), named("champion_27", mission), scenarios, 1)
    for name, values in vars(alone).items():
        np.testing.assert_array_equal(getattr(fleets, name), values, err_msg=name)


def test_deputies_who_heed_nothing_fly_as_if_alone():
    outcomes, tracks, mission, controller, scenarios = flown("fleet.sharing=nothing", deputies=3)
    for deputy in range(3):
        starts = [scenario.fleet[deputy] for scenario in scenarios]
        expected = np.zeros_like(tracks[:, deputy])
        alone = fly_all(mission.of_each, controller, starts, 1, expected)
        np.testing.assert_array_equal(tracks[:, deputy], expected)
        spent = outcomes.of_deputies[:, deputy, OF_DEPUTIES.index("delta_v_m_s")]
        np.testing.assert_array_equal(spent, alone.delta_v_m_s)


def test_totals_are_sums_and_extremes_of_deputies():
    outcomes, tracks, mission, *_ = flown(deputies=3)
    of_each = dict(zip(OF_DEPUTIES, np.moveaxis(outcomes.of_deputies, 2, 0), strict=True))
    np.testing.assert_allclose(outcomes.delta_v_m_s, of_each["delta_v_m_s"].sum(axis=1))
    np.testing.assert_array_equal(outcomes.inspected_count, of_each["inspected_count"].sum(axis=1))
    np.testing.assert_array_equal(outcomes.outside_m, of_each["outside_m"].max(axis=1))
    positions = tracks[..., :3].astype(np.float64)
    apart = [
        np.linalg.norm(positions[:, deputy] - positions[:, other], axis=2).min(axis=1)
        for deputy in range(3)
        for other in range(deputy)
    ]
    np.testing.assert_allclose(outcomes.nearest_pair_m, np.min(apart, axis=0), atol=1e-4)
    num_left = tracks[:, 0, :, TRACK_LEFT]
    needed = np.ceil(0.95 * outcomes.inspectable_count)
    is_enough = 99 - num_left >= needed[:, np.newaxis]
    first = np.where(is_enough.any(axis=1), mission.control_period_s * is_enough.argmax(axis=1), np.nan)
    np.testing.assert_array_equal(outcomes.enough_s, first)


@pytest.mark.parametrize("sharing", ["mask", "leave", "nearer"])
def test_results_depend_on_neither_lanes_nor_workers_nor_neighbours(sharing):
    outcomes, _, mission, controller, scenarios = flown(f"fleet.sharing={sharing}", deputies=3)
    for flown_again in (
        fly_all(mission, controller, scenarios, 2),
        fly_all(mission, controller, scenarios[3:4], 1).each(lambda values: np.repeat(values, 7, axis=0)),
    ):
        rows = slice(None) if len(np.unique(flown_again.delta_v_m_s)) > 1 else slice(3, 4)
        for name, values in vars(outcomes).items():
            np.testing.assert_array_equal(getattr(flown_again, name)[rows], values[rows], err_msg=name)


@pytest.mark.parametrize("sharing", ["leave", "nearer"])
def test_who_leaves_points_would_coast_inside_its_limits(sharing):
    """By SciPy's matrix exponential of Clohessy and Wiltshire's equations, from starts that drift far."""
    words = ("monte_carlo.max_speed_m_s=0.15", "monte_carlo.num_cases=40", "monte_carlo.max_distance_m=180")
    experiment = experiment_of("fleet.deputies=3", f"fleet.sharing={sharing}", *words)
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    messages = room_for_messages(mission, len(scenarios))
    tracks = np.zeros((len(scenarios), 3, mission.num_controls + 1, NUM_TRACKED), np.float32)
    fly_all_fleets(mission, load(experiment.controller, mission), scenarios, 1, tracks, messages=messages)
    distance = np.linalg.norm(tracks[..., :3], axis=3)
    assert (distance > mission.deputy.max_distance_m).any()  # the starts are hard enough for what is asked
    step = expm(_drift(mission.orbit.mean_motion_rad_s) * mission.control_period_s)
    leaves = np.argwhere(messages.left_to.any(axis=3))
    assert len(leaves) > 1000
    states = tracks[..., :6].astype(np.float64)[tuple(leaves.T)]
    for sample in range(mission.num_controls + 1):
        still = leaves[:, 2] + sample <= mission.num_controls
        distances = np.linalg.norm(states[still, :3], axis=1)
        assert np.all(distances >= mission.deputy.min_distance_m)
        assert np.all(distances <= mission.deputy.max_distance_m)
        states = states @ step.T


def _drift(n: float) -> np.ndarray:
    system = np.zeros((6, 6))
    system[:3, 3:] = np.eye(3)
    system[3, [0, 4]], system[4, 3], system[5, 2] = (3.0 * n * n, 2.0 * n), -2.0 * n, -n * n
    return system


def test_what_is_told_is_what_is_flown():
    experiment = experiment_of("fleet.deputies=3")
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    messages = room_for_messages(mission, len(scenarios))
    outcomes = fly_all_fleets(mission, load(experiment.controller, mission), scenarios, 1, messages=messages)
    counts = [(messages.seen_by[:, -1] == deputy).sum(axis=1) for deputy in (1, 2, 3)]
    seen_first = outcomes.of_deputies[..., OF_DEPUTIES.index("inspected_count")]
    np.testing.assert_array_equal(np.transpose(counts), seen_first)
    # once seen, always by the same; nothing that is seen is left, nor anything to oneself
    before, after = messages.seen_by[:, :-1], messages.seen_by[:, 1:]
    assert np.all((before == 0) | (before == after))
    assert not np.any((messages.left_to > 0) & (before[:, np.newaxis] > 0))
    assert not any(np.any(messages.left_to[:, deputy] == deputy + 1) for deputy in range(3))


def test_deputies_start_apart_under_one_sun():
    fleets = evaluation_scenarios(experiment_of("fleet.deputies=4"))
    alone = evaluation_scenarios(compose_experiment(["+experiment=evaluate", *EVALUATION[1:]]).experiment)
    for fleet, first in zip(fleets, alone, strict=True):
        np.testing.assert_array_equal(fleet.position_m, first.position_m)
        assert len({tuple(start.position_m) for start in fleet.fleet}) == 4
        assert len({(start.sun_angle_rad, start.sun_elevation_rad) for start in fleet.fleet}) == 1
        assert [start.noise[0] for start in fleet.fleet] == [1, 1001, 2001, 3001]
    seed = evaluation_scenarios(
        compose_experiment(["+experiment=evaluate", *EVALUATION[1:], "seed=2001"]).experiment
    )
    np.testing.assert_array_equal([f.fleet[2].position_m for f in fleets], [s.position_m for s in seed])


def test_parked_deputies_return_after_an_orbit():
    """The ellipse is closed: an orbit of coasting ends where it began."""
    words = ("monte_carlo.parked=true", "control_period_s=10", "attitude=ideal")
    experiment = experiment_of(*words)
    n = experiment.mission.orbit.mean_motion_rad_s
    mission = replace(experiment.mission, duration_s=10.0 * round(2.0 * np.pi / n / 10.0))
    scenarios = evaluation_scenarios(experiment)
    tracks = np.zeros((len(scenarios), 2, mission.num_controls + 1, 3), np.float32)
    outcomes = fly_all(mission, coast(), scenarios, 1, tracks)
    assert not outcomes.delta_v_m_s.any()
    assert np.linalg.norm(tracks[:, :, -1] - tracks[:, :, 0], axis=2).max() < 5.0 * 0.15


def test_all_that_knows_one_deputy_refuses_fleets():
    experiment = experiment_of()
    mission, scenario = experiment.mission, evaluation_scenarios(experiment)[0]
    for stage in STAGES:
        if stage not in OF_FLEETS:
            with pytest.raises(SettingError, match=rf"fleet.deputies is 2, and the stages.* {stage} know"):
                experiment_of(f"stages=[{stage}]")
    with pytest.raises(SettingError, match=r"this flight knows of one deputy; leave fleet.deputies out"):
        fly_logged(mission, named("champion_27", mission), scenario)
    for words in (
        *("monte_carlo.splitting_flights=1000", "after_s=600", "flight=reference"),
        *("problem=docking", "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.1}"),
        ("guidance=clusters", "guidance.engine=sklearn"),
    ):
        with pytest.raises(SettingError, match=r"fleet.deputies is 2, .*(one deputy|alone)"):
            experiment_of(*([words] if isinstance(words, str) else words))


def test_controllers_that_plan_refuse_fleets_and_others_fly():
    experiment = experiment_of("duration_s=20", "monte_carlo.num_cases=1")
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)
    others = "champion_27 champion_81"
    with pytest.raises(ControllerError, match=r"plans for one deputy, and fleet.deputies is above 1"):
        fly_all(mission, named("champion_27_one_push", mission), scenarios, 1)
    for name in others.split():
        assert fly_all(mission, named(name, mission), scenarios, 1).delta_v_m_s.shape == (1,)
