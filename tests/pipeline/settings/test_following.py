"""Where flights start unless told: the paper's shell, or what fits the mission."""

import math

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.settings.equipment import Sensor
from pipeline.settings.following import PAPER_M, sight_shell, start_shell
from pipeline.settings.mission import DeputySettings


def test_starts_fit_any_mission():
    random = np.random.default_rng(0)
    num_kept = 0
    for _ in range(2000):
        near = 10.0 ** random.uniform(-1, 3)
        far = near * 10.0 ** random.uniform(0.01, 2)
        deputy = DeputySettings(min_distance_m=near, max_distance_m=far)
        camera = {"half_angle_deg": random.uniform(3, 120), "max_range_m": random.choice([None, near * 3])}
        radius = near * random.uniform(0.01, 1.0)
        shell = start_shell(deputy, Sensor(**camera), radius)
        low, high = shell
        assert near * 0.995 <= low <= high <= far * 1.005
        assert low >= radius * 0.995
        num_kept += shell == PAPER_M
        if shell != PAPER_M:
            inner, outer = sight_shell(deputy, Sensor(**camera), radius)
            assert inner * 0.99 <= low <= high <= max(outer * 1.01, low)
    assert 0 < num_kept < 1000


def test_the_whole_chief_is_in_view_from_the_sight_shell():
    near, far = sight_shell(DeputySettings(), Sensor(max_range_m=150.0), 10.0)
    assert far == 150.0
    # the rim of a sphere seen from there is as far from the axis as the field of view reaches
    assert math.degrees(math.asin(10.0 / near)) == pytest.approx(15.0)


def composed(*overrides: str):
    return compose_experiment(["+experiment=train_paper", *overrides]).experiment


def test_the_paper_s_starts_stay_where_they_fit():
    experiment = composed("sensor.half_angle_deg=40", "deputy.max_distance_m=120")
    assert (experiment.monte_carlo.min_distance_m, experiment.monte_carlo.max_distance_m) == (50.0, 100.0)
    assert (experiment.starts.min_distance_m, experiment.starts.max_distance_m) == (75.0, 75.0)
    assert experiment.mission.deputy.initial_position_m == (43.30127018922194,) * 3


@pytest.mark.parametrize("kind", ["octants", "random"])
def test_a_small_mission_needs_no_distance_to_be_set(kind):
    experiment = composed(
        *("deputy.max_distance_m=60", "chief.inspection_radius_m=2", "deputy.min_distance_m=5"),
        f"starts={kind}",
    )
    low, high = experiment.monte_carlo.min_distance_m, experiment.monte_carlo.max_distance_m
    assert (low, high) == (10.0, 30.0)
    expected = (low, high) if kind == "random" else (20.0, 20.0)
    assert (experiment.starts.min_distance_m, experiment.starts.max_distance_m) == expected
    assert math.hypot(*experiment.mission.deputy.initial_position_m) == pytest.approx(20.0)


def test_a_distance_that_is_set_is_kept():
    experiment = composed("monte_carlo.min_distance_m=20", "deputy.initial_position_m=[0,30,0]")
    assert (experiment.monte_carlo.min_distance_m, experiment.monte_carlo.max_distance_m) == (20.0, 100.0)
    assert experiment.mission.deputy.initial_position_m == (0.0, 30.0, 0.0)
