"""Starts: what a case depends on, and what it does not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm, uniform

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.cases.dispersions import drawn, mission_of_case
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import (
    EVALUATION,
    columns_of,
    draw,
    evaluation_scenarios,
    starts_in,
    training_scenarios,
)
from pipeline.settings.experiment import Experiment, SettingError, Sun
from pipeline.settings.monte_carlo import MonteCarlo
from pipeline.settings.training import Starts

FIXED = Sun(mode="fixed", angle_deg=30.0)
RANDOM = Sun(mode="random", angle_deg=30.0)
MIXED = Sun(mode="mixed", angle_deg=30.0)

SHELL = {"min_distance_m": 50.0, "max_distance_m": 100.0}
CASES = MonteCarlo(num_cases=400, confidence_percent=95.0, workers=1, **SHELL)
DRAWN = Starts(kind="random", num_cases=16, redraw=True, num_hard=0, hard_from=0, **SHELL)
OCTANTS = Starts(kind="octants", num_cases=8, min_distance_m=75.0, max_distance_m=75.0)


def under(sun: Sun, **changes: object) -> Experiment:
    """An experiment under a Sun, with these starts unless others are given."""
    return replace(composed("seed=1"), **({"sun": sun, "monte_carlo": CASES, "starts": DRAWN} | changes))


def positions(scenarios: list[Scenario]) -> np.ndarray:
    return np.array([scenario.position_m for scenario in scenarios])


def suns(scenarios: list[Scenario]) -> np.ndarray:
    return np.array([scenario.sun_angle_rad for scenario in scenarios])


@pytest.fixture(scope="module")
def cases() -> list[Scenario]:
    return evaluation_scenarios(under(RANDOM))


def test_a_case_depends_on_its_seed_and_number_alone(cases: list[Scenario]) -> None:
    """Direction, then distance, then Sun from ``SeedSequence(seed, spawn_key=(stage, case))``."""
    few = evaluation_scenarios(under(RANDOM, monte_carlo=replace(CASES, num_cases=3)))
    np.testing.assert_array_equal(positions(few), positions(cases)[:3])
    np.testing.assert_array_equal(suns(few), suns(cases)[:3])
    generator = np.random.default_rng(np.random.SeedSequence(1, spawn_key=(0, 7)))
    direction = generator.standard_normal(3)
    expected = generator.uniform(50.0, 100.0) * direction / np.linalg.norm(direction)
    np.testing.assert_allclose(cases[7].position_m, expected, rtol=1e-15)
    assert cases[7].sun_angle_rad == generator.uniform(0.0, 2.0 * np.pi)
    for others in (evaluation_scenarios(under(RANDOM, seed=2)), training_scenarios(under(RANDOM))):
        assert not np.isin(positions(others), positions(cases)).any()
        assert not np.isin(suns(others), suns(cases)).any()


def test_all_suns_have_the_same_positions_and_a_mixed_one_is_fixed_and_random_by_turns(
    cases: list[Scenario],
) -> None:
    fixed, mixed = (evaluation_scenarios(under(sun)) for sun in (FIXED, MIXED))
    np.testing.assert_array_equal(positions(fixed), positions(cases))
    np.testing.assert_array_equal(positions(mixed), positions(cases))
    np.testing.assert_array_equal(suns(fixed), np.radians(30.0))
    np.testing.assert_array_equal(suns(mixed)[::2], np.radians(30.0))
    np.testing.assert_array_equal(suns(mixed)[1::2], suns(cases)[1::2])


def assert_uniform(values: object, low: float, width: float) -> None:
    """Kolmogorov and Smirnov compare."""
    assert kstest(values, "uniform", (low, width)).pvalue > 0.01


def test_starts_rest_in_the_shell_directions_are_isotropic_distances_and_suns_uniform(
    cases: list[Scenario],
) -> None:
    """On a sphere every coordinate is uniform (Archimedes)."""
    distance = np.linalg.norm(positions(cases), axis=1)
    directions = positions(cases) / distance[:, np.newaxis]
    assert not any(np.any(case.velocity_m_s) for case in cases)
    for component in directions.T:
        assert_uniform(component, -1.0, 2.0)
    assert_uniform(distance, 50.0, 50.0)
    assert_uniform(suns(cases), 0.0, 2.0 * np.pi)
    assert np.linalg.norm(directions.mean(axis=0)) < 0.12
    assert abs(np.corrcoef(distance, suns(cases))[0, 1]) < 0.12


@pytest.mark.parametrize("redraws", [True, False])
def test_rounds_draw_their_own_or_have_the_firsts(redraws: bool) -> None:
    experiment = under(MIXED, starts=replace(DRAWN, redraw=redraws))
    first, again, second = (training_scenarios(experiment, index) for index in (0, 0, 1))
    np.testing.assert_array_equal(positions(again), positions(first))
    np.testing.assert_array_equal(positions(first), positions(training_scenarios(under(MIXED))))
    assert np.isin(positions(second), positions(first)).all() == (not redraws)
    assert np.isin(positions(second), positions(first)).any() == (not redraws)
    assert (suns(second) == suns(first))[1::2].any() == (not redraws)
    np.testing.assert_array_equal(suns(second)[::2], np.radians(30.0))


def test_the_papers_starts_are_the_diagonals_of_the_octants() -> None:
    starts = training_scenarios(under(FIXED, starts=OCTANTS))
    np.testing.assert_allclose(np.abs(positions(starts)), 75.0 / np.sqrt(3.0), rtol=1e-15)
    assert len({tuple(signs) for signs in np.sign(positions(starts)).tolist()}) == 8
    np.testing.assert_array_equal(suns(starts), np.radians(30.0))
    assert not any(np.any(start.velocity_m_s) for start in starts)
    other_seed = training_scenarios(under(RANDOM, starts=OCTANTS, seed=2))
    np.testing.assert_array_equal(positions(other_seed), positions(starts))
    assert len(set(suns(other_seed).tolist())) == 8


def test_a_sun_that_is_drawn_has_an_elevation_from_its_range() -> None:
    """Positions and angles stay those of a Sun in the plane; a fixed Sun has the one elevation given."""
    tilted = replace(RANDOM, elevation_range_deg=(-20.0, 60.0))
    flat, drawn = ([draw(3, EVALUATION, case, CASES, sun) for case in range(400)] for sun in (RANDOM, tilted))
    np.testing.assert_array_equal(positions(flat), positions(drawn))
    np.testing.assert_array_equal(suns(flat), suns(drawn))
    assert not any(scenario.sun_elevation_rad for scenario in flat)
    assert_uniform(np.degrees([scenario.sun_elevation_rad for scenario in drawn]), -20.0, 80.0)
    mixed = replace(tilted, mode="mixed", elevation_deg=5.0)
    assert np.degrees(draw(3, EVALUATION, 2, CASES, mixed).sun_elevation_rad) == 5.0
    assert draw(3, EVALUATION, 3, CASES, mixed).sun_elevation_rad == drawn[3].sun_elevation_rad


def test_starts_that_move_stand_where_those_at_rest_do(cases: list[Scenario]) -> None:
    """Speeds are uniform and directions isotropic, drawn beside everything else; a table holds them."""
    moving = evaluation_scenarios(under(RANDOM, monte_carlo=replace(CASES, max_speed_m_s=0.3)))
    np.testing.assert_array_equal(positions(moving), positions(cases))
    np.testing.assert_array_equal(suns(moving), suns(cases))
    velocities = np.array([start.velocity_m_s for start in moving])
    speeds = np.linalg.norm(velocities, axis=1)
    assert_uniform(speeds, 0.0, 0.3)
    for axis in range(3):
        assert_uniform(velocities[:, axis] / speeds, -1.0, 2.0)
    for starts in (cases[:3], moving[:3]):
        columns = columns_of(starts) | {"sun_angle_rad": suns(starts)}
        for read, start in zip(starts_in(columns), starts, strict=True):
            assert (read.position_m == start.position_m).all()
            assert (read.velocity_m_s == start.velocity_m_s).all()


def test_directions_by_even_angles_are_denser_at_the_poles() -> None:
    """The share of starts and of speeds above 60 degrees is a third; it is a seventh of an even sphere."""
    by_angles = replace(CASES, num_cases=900, max_speed_m_s=0.3, directions="angles")
    starts = evaluation_scenarios(under(RANDOM, monte_carlo=by_angles))
    for vectors in (positions(starts), np.array([start.velocity_m_s for start in starts])):
        x, y, z = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).T
        assert_uniform(np.degrees(np.arcsin(z)), -90.0, 180.0)
        assert_uniform(np.degrees(np.arctan2(y, x)), -180.0, 360.0)


MASS = "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}"
ANGLE = "+dispersions.sensor.half_angle_deg={kind:uniform,low:13,high:17}"
VARIED_TORQUE = "+dispersions.deputy.max_torque_n_m={kind:normal,mean:0.01,std:0.002,low:0.009}"


@cache
def composed(*words: str) -> Experiment:
    return compose_experiment(["+experiment=evaluate", "controller=lqr", "seed=3", *words]).experiment


def test_cases_draw_by_their_distributions() -> None:
    experiment = composed(VARIED_TORQUE, MASS, ANGLE, "monte_carlo.num_cases=400")
    scenarios = evaluation_scenarios(experiment)
    settings = [drawn(experiment.mission, scenario) for scenario in scenarios]
    keys = ["deputy.mass_kg", "deputy.max_torque_n_m", "sensor.half_angle_deg"]
    assert all([key for key, _ in values_by_key] == keys for values_by_key in settings)
    values = np.array([[value for _, value in values_by_key] for values_by_key in settings])
    laws = norm(12.0, 0.5), truncnorm(-0.5, np.inf, 0.01, 0.002), uniform(13.0, 4.0)
    for column, law in zip(values.T, laws, strict=True):
        assert kstest(column, law.cdf).pvalue > 0.001
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 0.2
    # a case is the same among however many others
    assert drawn(experiment.mission, scenarios[7]) == settings[7]
    np.testing.assert_array_equal(positions(evaluation_scenarios(composed())[:400]), positions(scenarios))


def test_a_case_flies_its_own_mission_alone_and_among_others() -> None:
    experiment = composed(MASS, "monte_carlo.num_cases=4", "duration_s=600.0")
    mission = experiment.mission
    scenarios = evaluation_scenarios(experiment)
    controller = named("lqr", mission)
    episodes, tracks = fly_cases(mission, controller, scenarios, 2)
    for case, scenario in enumerate(scenarios):
        case_mission = mission_of_case(mission, scenario)
        assert not case_mission.dispersions
        assert case_mission.deputy.mass_kg == episodes["deputy.mass_kg"][case] != mission.deputy.mass_kg
        alone = fly_all(case_mission, controller, [scenario], 1)
        assert alone.delta_v_m_s[0] == episodes["delta_v_m_s"][case]
        log = fly_logged(mission, controller, scenario)
        np.testing.assert_array_equal(tracks[case], log.position_m.astype(np.float32))
        assert log.delta_v_m_s[-1] == episodes["delta_v_m_s"][case]


@pytest.mark.parametrize(
    ("dispersions", "message"),
    [
        ("deputy.mas_kg={kind:uniform,low:1,high:2}", "deputy.mas_kg is no number that a flight can have"),
        ("chief.num_points={kind:uniform,low:1,high:2}", "chief.num_points is no number that a flight can"),
        ("duration_s={kind:uniform,low:1,high:2}", "duration_s is no number that a flight can have its own"),
        ("deputy.mass_kg=3", "deputy.mass_kg is 3; give a distribution"),
        (
            "deputy.mass_kg={kind:normal,mean:12}",
            "has mean; one of kind normal has mean, std, and may have correlation_s, high, low",
        ),
        ("deputy.mass_kg={kind:norm,mean:12,std:1}", "kind is 'norm'; it must be one of normal, uniform"),
        ("deputy.mass_kg={kind:uniform,low:2,high:1}", "low is 2 and .*high 1; the first must be less"),
        ("deputy.mass_kg={kind:normal,mean:12,std:1,low:25}", "more than eight standard deviations beside"),
        ("deputy.mass_kg={kind:normal,mean:12,std:1,correlation_s:60}", "does not vary within a flight"),
        ("actuators.scale_error={kind:normal,mean:0,std:0.1,correlation_s:60}", "only with actuators.kind"),
        ("dynamics.drag_m_s2={kind:uniform,low:0,high:1,correlation_s:0}", "correlation_s is 0; it must be"),
        ("navigation.noise_m={kind:normal,mean:1,std:1,correlation_s:60}", "low must be at least 0"),
    ],
)
def test_dispersions_that_cannot_be(dispersions: str, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        composed("dynamics=two_body", "navigation=fixes", f"+dispersions.{dispersions}")


def test_a_draw_that_cannot_be_names_its_cure_and_training_flies_none() -> None:
    experiment = composed("+dispersions.deputy.mass_kg={kind:normal,mean:0.1,std:1.0}")
    scenarios = evaluation_scenarios(experiment)
    impossible = next(scenario for scenario in scenarios if drawn(experiment.mission, scenario)[0][1] < 0.0)
    with pytest.raises(SettingError, match=r"a case draws an impossible value: deputy.mass_kg is -.*low and"):
        mission_of_case(experiment.mission, impossible)
    with pytest.raises(SettingError, match="stages has train, and dispersions are given"):
        compose_experiment(["+experiment=train", MASS])
