"""Starts: what a case depends on, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pipeline.flight.cases.starts import EVALUATION, draw, evaluation_scenarios, training_scenarios
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import MonteCarlo, Sun
from pipeline.settings.training import Starts

FIXED = Sun(mode="fixed", angle_deg=30.0)
RANDOM = Sun(mode="random", angle_deg=30.0)
MIXED = Sun(mode="mixed", angle_deg=30.0)

PAPER = MonteCarlo(
    num_cases=400, min_distance_m=50.0, max_distance_m=100.0, confidence_percent=95.0, workers=1
)
DRAWN = Starts(
    kind="random",
    num_cases=16,
    min_distance_m=50.0,
    max_distance_m=100.0,
    redraw=True,
    num_hard=0,
    hard_from=0,
)
OCTANTS = replace(DRAWN, kind="octants", num_cases=8, min_distance_m=75.0, max_distance_m=75.0, redraw=False)


def positions(scenarios: list[Scenario]) -> np.ndarray:
    return np.array([scenario.position_m for scenario in scenarios])


def suns(scenarios: list[Scenario]) -> np.ndarray:
    return np.array([scenario.sun_angle_rad for scenario in scenarios])


@pytest.fixture(scope="module")
def cases() -> list[Scenario]:
    return evaluation_scenarios(PAPER, RANDOM, 1)


def test_a_case_does_not_depend_on_how_many_others_there_are(cases: list[Scenario]) -> None:
    few = evaluation_scenarios(replace(PAPER, num_cases=3), RANDOM, 1)
    np.testing.assert_array_equal(positions(few), positions(cases)[:3])
    np.testing.assert_array_equal(suns(few), suns(cases)[:3])


def test_a_case_is_drawn_as_the_seed_sequence_says(cases: list[Scenario]) -> None:
    """Direction, then distance, then Sun from ``SeedSequence(seed, spawn_key=(stage, case))``."""
    generator = np.random.default_rng(np.random.SeedSequence(1, spawn_key=(0, 7)))
    direction = generator.standard_normal(3)
    distance = generator.uniform(50.0, 100.0)
    expected = distance * direction / np.linalg.norm(direction)
    np.testing.assert_allclose(cases[7].position_m, expected, rtol=1e-15)
    assert cases[7].sun_angle_rad == generator.uniform(0.0, 2.0 * np.pi)


def test_both_suns_have_the_same_positions(cases: list[Scenario]) -> None:
    fixed, mixed = (evaluation_scenarios(PAPER, sun, 1) for sun in (FIXED, MIXED))
    np.testing.assert_array_equal(positions(fixed), positions(cases))
    np.testing.assert_array_equal(positions(mixed), positions(cases))
    np.testing.assert_array_equal(suns(fixed), np.radians(30.0))


def test_a_mixed_sun_is_fixed_and_random_by_turns(cases: list[Scenario]) -> None:
    mixed = suns(evaluation_scenarios(PAPER, MIXED, 1))
    np.testing.assert_array_equal(mixed[::2], np.radians(30.0))
    np.testing.assert_array_equal(mixed[1::2], suns(cases)[1::2])


def test_starts_are_at_rest_in_the_shell(cases: list[Scenario]) -> None:
    distance = np.linalg.norm(positions(cases), axis=1)
    assert 50.0 <= distance.min() < 52.0
    assert 98.0 < distance.max() <= 100.0
    assert not any(np.any(case.velocity_m_s) for case in cases)


def test_directions_are_isotropic_distances_and_suns_uniform(cases: list[Scenario]) -> None:
    """On a sphere every coordinate is uniform (Archimedes); Kolmogorov and Smirnov compare."""
    distance = np.linalg.norm(positions(cases), axis=1)
    directions = positions(cases) / distance[:, np.newaxis]
    samples = [*(0.5 + 0.5 * directions.T), distance / 50.0 - 1.0, suns(cases) / (2.0 * np.pi)]
    for sample in samples:
        assert stats.kstest(sample, "uniform").pvalue > 0.01
    assert np.linalg.norm(directions.mean(axis=0)) < 0.12
    assert abs(np.corrcoef(distance, suns(cases))[0, 1]) < 0.12


def test_another_seed_draws_others(cases: list[Scenario]) -> None:
    other = evaluation_scenarios(PAPER, RANDOM, 2)
    assert np.all(positions(other) != positions(cases))
    assert np.all(suns(other) != suns(cases))


def test_training_and_evaluation_differ(cases: list[Scenario]) -> None:
    training = training_scenarios(DRAWN, RANDOM, 1)
    assert not np.isin(positions(training), positions(cases)).any()
    assert not np.isin(suns(training), suns(cases)).any()


def test_each_round_draws_its_own() -> None:
    first, again, second = (training_scenarios(DRAWN, MIXED, 1, index) for index in (0, 0, 1))
    np.testing.assert_array_equal(positions(again), positions(first))
    assert not np.isin(positions(second), positions(first)).any()
    np.testing.assert_array_equal(suns(second)[::2], np.radians(30.0))


def test_unless_all_rounds_have_the_firsts() -> None:
    kept = replace(DRAWN, redraw=False)
    first, second = (training_scenarios(kept, RANDOM, 1, index) for index in (0, 1))
    np.testing.assert_array_equal(positions(second), positions(first))
    np.testing.assert_array_equal(suns(second), suns(first))
    np.testing.assert_array_equal(positions(first), positions(training_scenarios(DRAWN, RANDOM, 1, 0)))


def test_the_papers_starts_are_the_diagonals_of_the_octants() -> None:
    starts = training_scenarios(OCTANTS, FIXED, 1)
    side = 75.0 / np.sqrt(3.0)
    np.testing.assert_allclose(np.abs(positions(starts)), side, rtol=1e-15)
    signs = {tuple(np.sign(position).astype(int).tolist()) for position in positions(starts)}
    assert len(signs) == 8
    np.testing.assert_array_equal(suns(starts), np.radians(30.0))
    assert not any(np.any(start.velocity_m_s) for start in starts)
    other_seed = training_scenarios(OCTANTS, RANDOM, 2)
    np.testing.assert_array_equal(positions(other_seed), positions(starts))
    assert len(set(suns(other_seed).tolist())) == 8


def test_a_sun_that_is_drawn_has_an_elevation_from_its_range() -> None:
    """Positions and angles stay those of a Sun in the plane; a fixed Sun has the one elevation given."""
    plain = Sun(mode="random", angle_deg=0.0)
    tilted = replace(plain, elevation_range_deg=(-20.0, 60.0))
    flat, drawn = (
        [draw(3, EVALUATION, case, (50.0, 100.0), sun) for case in range(400)] for sun in (plain, tilted)
    )
    for one, other in zip(flat, drawn, strict=True):
        np.testing.assert_array_equal(one.position_m, other.position_m)
        assert one.sun_angle_rad == other.sun_angle_rad
        assert one.sun_elevation_rad == 0.0
    degrees = np.degrees([one.sun_elevation_rad for one in drawn])
    assert stats.kstest(degrees, "uniform", (-20.0, 80.0)).pvalue > 0.01
    mixed = replace(tilted, mode="mixed", elevation_deg=5.0)
    assert np.degrees(draw(3, EVALUATION, 2, (50.0, 100.0), mixed).sun_elevation_rad) == 5.0
    assert draw(3, EVALUATION, 3, (50.0, 100.0), mixed).sun_elevation_rad == drawn[3].sun_elevation_rad


def test_starts_that_move_stand_where_those_at_rest_do() -> None:
    """Speeds are uniform and directions isotropic, drawn beside everything else."""
    moving = evaluation_scenarios(replace(PAPER, num_cases=400, max_speed_m_s=0.3), RANDOM, 1)
    resting = evaluation_scenarios(replace(PAPER, num_cases=400), RANDOM, 1)
    np.testing.assert_array_equal(positions(moving), positions(resting))
    assert suns(moving).tolist() == suns(resting).tolist()
    velocities = np.array([start.velocity_m_s for start in moving])
    speeds = np.linalg.norm(velocities, axis=1)
    assert stats.kstest(speeds, "uniform", (0.0, 0.3)).pvalue > 0.01
    for axis in range(3):  # Archimedes: a component of an isotropic direction is uniform
        assert stats.kstest(velocities[:, axis] / speeds, "uniform", (-1.0, 2.0)).pvalue > 0.01
