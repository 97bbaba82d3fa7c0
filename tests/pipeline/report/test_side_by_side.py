"""A controller's flight beside the plan of least fuel: read back from the axes, and on the page."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.optimum.solved import beside_optimum, solved_for
from pipeline.report.comparisons import fly_pairs, read_beside
from pipeline.report.figures.optimum import LARGEST, side_by_side
from pipeline.report.figures.style import style
from pipeline.run import artifacts, tables
from tests.pipeline.flight.missions import PAPER
from tests.pipeline.report.runs import Page, page_of

MISSION = replace(PAPER, duration_s=1800.0)
START = Scenario(np.array([10.0, -60.0, 35.0]), np.zeros(3), 0.4)


def burning(*burns: tuple[int, float]) -> np.ndarray:
    """Forces along j in some control periods, N."""
    forces = np.zeros((180, 3))
    for k, force in burns:
        forces[k, 1] = force
    return forces


@pytest.fixture(scope="module")
def drawn():
    first = fly_logged(MISSION, open_loop("one", burning((0, 0.06), (5, -0.03), (100, 0.03))), START)
    second = fly_logged(MISSION, open_loop("two", burning((2, 0.012))), START)
    with style():
        return first, second, side_by_side(first, second, MISSION, 95).axes


def test_paths_are_those_flown_in_both_planes(drawn):
    first, second, axes = drawn
    for row, plane in ((0, [1, 0]), (1, [1, 2])):
        for column, log in ((0, first), (1, second)):
            ax = axes[3 * row + column]
            paths = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) == 181]
            assert any(np.array_equal(path, log.position_m[:, plane]) for path in paths)
    assert [axes[i].get_title(loc="left") for i in (0, 1)] == [
        "controller, 0.100 m/s",
        "plan of least fuel, 0.010 m/s",
    ]


def test_circles_are_as_large_as_the_burns_of_two_minutes(drawn):
    first, _, axes = drawn
    (circles,) = [c for c in axes[0].collections if hasattr(c, "get_sizes")]
    np.testing.assert_allclose(circles.get_sizes(), [LARGEST, LARGEST / 3.0])
    np.testing.assert_array_equal(circles.get_offsets(), first.position_m[[0, 100]][:, [1, 0]])
    (other,) = [c for c in axes[1].collections if hasattr(c, "get_sizes")]
    np.testing.assert_allclose(other.get_sizes(), LARGEST * 0.012 / 0.09)


def test_the_path_is_broad_where_points_come_into_sight_with_pauses_of_two_minutes(drawn):
    first, _, axes = drawn
    (bands,) = [c for c in axes[0].collections if hasattr(c, "get_segments")]
    path = first.position_m[:, [1, 0]].tolist()
    is_broad = np.zeros(180, dtype=bool)
    for piece in bands.get_segments():
        k = path.index(piece[0].tolist())
        np.testing.assert_array_equal(piece, path[k : k + len(piece)])
        is_broad[k : k + len(piece) - 1] = True
    counts = first.is_inspected.sum(axis=1)
    sees = np.flatnonzero(counts[1:] > counts[:-1])
    assert is_broad[sees].all()
    for k in np.flatnonzero(is_broad):
        assert sees[sees <= k].max() + 12 >= sees[sees >= k].min()
    for before, after in pairwise(sees):
        assert is_broad[before + 1 : after].all() if after - before <= 12 else not is_broad[before + 1]
    assert 0 < is_broad.sum() < 180


def test_the_suns_way_is_where_the_sun_is(drawn):
    first, _, axes = drawn
    (arc,) = [line.get_xydata() for line in axes[0].lines if line.get_linewidth() == 2.0]
    # along j across, along i up
    np.testing.assert_allclose(np.arctan2(arc[:, 0], arc[:, 1]), first.sun_angle_rad, atol=1e-12)


def test_delta_v_and_points_are_those_of_the_logs(drawn):
    first, second, axes = drawn
    for column, log in ((0, first), (1, second)):
        np.testing.assert_array_equal(axes[2].lines[column].get_ydata(), log.delta_v_m_s)
        np.testing.assert_array_equal(axes[5].lines[1 + column].get_ydata(), log.is_inspected.sum(axis=1))
    assert axes[5].lines[0].get_ydata()[0] == 95


def test_flights_without_any_burn_can_be_drawn():
    log = fly_logged(MISSION, coast(), START)
    with style():
        assert side_by_side(log, log, MISSION, 95).axes


@pytest.mark.slow
def test_the_page_shows_the_middle_and_the_greatest_ratio(tmp_path):
    run = compose_experiment(
        [
            *("+experiment=evaluate", "controller=coast", "report.dots_per_inch=40"),
            # a layer that would burn against many a plan, which is flown without it
            *("telemetry.record_start=true", "safety=filter", "safety.speed_limit_m_s=0.01"),
        ]
    )
    experiment = run.experiment
    solved = solved_for(experiment)
    episodes, _ = fly_cases(experiment.mission, coast(), solved.scenarios, 1)
    columns = beside_optimum(episodes, solved.cases)
    columns["times_optimum"] = np.random.default_rng(3).permutation(50).astype(float)
    tables.write_parquet(tmp_path / artifacts.BESIDE_OPTIMUM, columns)
    middle, greatest = (int(np.flatnonzero(columns["times_optimum"] == ratio)[0]) for ratio in (25, 49))

    pairs = fly_pairs(experiment, coast(), read_beside(tmp_path))
    assert [(pair.case, pair.which) for pair in pairs] == [(middle, "the middle"), (greatest, "the greatest")]
    for pair in pairs:
        assert pair.plan.delta_v_m_s[-1] == pytest.approx(solved.cases["delta_v_m_s"][pair.case], rel=1e-9)
        assert pair.controller.delta_v_m_s[-1] > 0.0
        np.testing.assert_array_equal(pair.plan.position_m[0], pair.controller.position_m[0])

    names = {f"optimum-case-{case}" for case in (middle, greatest)}
    assert {f"figure-{name}" for name in names} < set(Page(page_of(experiment, tmp_path)).ids())
    assert names < {path.stem for path in (tmp_path / artifacts.FIGURES).iterdir()}

    gone = replace(experiment, optimum=replace(experiment.optimum, reference=str(tmp_path / "gone")))
    page = Page(page_of(gone, tmp_path))
    assert "The plans themselves are no longer at hand" in page.text["optimum"]
    assert not names & {path.stem for path in (tmp_path / artifacts.FIGURES).iterdir()}
