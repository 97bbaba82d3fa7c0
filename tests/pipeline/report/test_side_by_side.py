"""A controller's flight beside the plan of least fuel: read back from the axes, and on the page."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.control.controller import coast
from pipeline.optimum.solved import beside_optimum, solved_for
from pipeline.report.comparisons import fly_pairs, read_beside
from pipeline.run import artifacts, tables
from tests.pipeline.report.runs import Page, page_of


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
