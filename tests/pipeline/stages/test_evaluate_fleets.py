"""An evaluation of fleets in miniature: its starts, its tables and its summary."""

import csv

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.evaluation.statistics import statistic
from pipeline.flight.control.controller import ControllerError
from pipeline.preflight import check_before
from pipeline.run import artifacts
from tests.pipeline.stages.cases import carried_out, composed, prepared

FLEET = ("controller=champion_27", "sun=random", "fleet.deputies=3")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleets")
    return carried_out(prepared(folder, *FLEET, experiment="evaluate_fleet"), folder), folder


def test_a_row_each_fleet_and_a_row_each_deputy(evaluated):
    _, folder = evaluated
    episodes = pq.read_table(folder / artifacts.EPISODES).to_pydict()
    deputies = pq.read_table(folder / artifacts.DEPUTIES).to_pydict()
    assert episodes["case"] == list(range(5))
    assert deputies["case"] == [case for case in range(5) for _ in range(3)]
    assert deputies["deputy"] == [1, 2, 3] * 5
    by_fleet = {name: np.reshape(values, (5, 3)) for name, values in deputies.items()}
    for name, join in {
        **dict.fromkeys(("delta_v_m_s", "inspected_count", "safety_periods"), np.sum),
        **dict.fromkeys(("max_distance_m",), np.max),
        **dict.fromkeys(("min_distance_m", "stays_orbit", "passively_safe"), np.min),
    }.items():
        np.testing.assert_allclose(episodes[name], join(by_fleet[name], axis=1), err_msg=name)
    np.testing.assert_array_equal(episodes["greatest_delta_v_m_s"], by_fleet["delta_v_m_s"].max(axis=1))
    np.testing.assert_array_equal(episodes["violated"], by_fleet["violated"].any(axis=1))
    assert not (folder / artifacts.TRAJECTORIES).exists()


def test_starts_are_listed_by_deputy(evaluated):
    _, folder = evaluated
    with (folder / artifacts.SCENARIOS).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["set"], row["case"], row["deputy"]) for row in rows] == [
        ("evaluation", str(case), str(deputy)) for case in range(5) for deputy in (1, 2, 3)
    ]
    deputies = pq.read_table(folder / artifacts.DEPUTIES)["position_x_m"].to_pylist()
    assert [float(row["position_x_m"]) for row in rows] == deputies
    assert len({row["sun_angle_rad"] for row in rows}) == 5


def test_the_summary_tells_of_the_fleet(evaluated):
    run, folder = evaluated
    summary = artifacts.read_json(folder, artifacts.SUMMARY)
    episodes = pq.read_table(folder / artifacts.EPISODES).to_pydict()
    assert summary["fleet"] == {"deputies": 3, "sharing": "nearer"}
    assert summary["optimum"] == {"not_compared": "the plans are of one deputy"}
    for name in ("delta_v_m_s", "greatest_delta_v_m_s", "nearest_pair_m"):
        assert summary[name]["mean"] == statistic(np.array(episodes[name]), 95.0).mean
    assert run.experiment.mission.fleet.deputies == 3


def test_a_controller_that_plans_is_refused_before_a_folder_is_made():
    run = composed(*FLEET[1:], "controller=champion_27_rehearsed", experiment="evaluate_fleet")
    with pytest.raises(ControllerError, match="such as champion_27"):
        check_before(run.experiment)
