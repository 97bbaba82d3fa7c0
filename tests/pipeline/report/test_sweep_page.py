"""The page of a sweep: settings are compared, not runs; seeds that only draw cases are pooled."""

import json

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation.monte_carlo import summarise
from pipeline.report import sweep
from pipeline.run import artifacts, configuration, manifests, tables, writing
from pipeline.run.sweep import SweptRun
from pipeline.run.sweep import write as write_sweep
from tests.browser import WIDTHS, assert_tables_fit
from tests.pipeline.evaluation.test_statistics import evaluation

SEEDS = (1, 2, 3)
#: of each controller, how much more it burns than the first, m/s
SHIFTS = {"first": 0.0, "second": 0.05, "third": -0.2}


def write_run(folder, episodes, stages):
    """Write a run that has ended."""
    configuration.write(folder, {"stages": stages, "name": "x"})
    tables.write_parquet(folder / artifacts.EPISODES, episodes)
    count = len(episodes["case"])
    summary = summarise({**episodes, "mean_distance_m": np.ones(count)}, 95.0)
    content = {"confidence_percent": 95.0, "num_cases": count, **summary}
    writing.write_json(folder / artifacts.SUMMARY, content)
    manifest = {"manifest_version": manifests.MANIFEST_VERSION, "config_hash": "", "finished_stages": stages}
    (folder / artifacts.MANIFEST).write_text(json.dumps(manifest))


def write_runs(folder, stages, cases_of=lambda seed: seed):
    """Write a sweep of three controllers with three seeds each; return the episodes by both."""
    runs, flown = [], {}
    for controller, shift in SHIFTS.items():
        for seed in SEEDS:
            name = f"controller={controller}+seed={seed}"
            flown[controller, seed] = evaluation(cases_of(seed), shift=shift)
            write_run(folder / name, flown[controller, seed], stages)
            differs = {"controller": controller, "seed": str(seed)}
            runs.append(SweptRun(name, differs, ("+experiment=evaluate", f"controller={controller}")))
    write_sweep(folder, runs)
    return flown


def test_cases_of_seeds_are_pooled_where_seeds_draw_only_cases(tmp_path):
    flown = write_runs(tmp_path, ["scenario", "evaluate"])
    results = sweep.gather_results(tmp_path)
    assert [setting.setting for setting in results.settings] == [{"controller": name} for name in SHIFTS]
    for setting in results.settings:
        columns = [flown[setting.setting["controller"], seed] for seed in SEEDS]
        spent = np.concatenate([episodes["delta_v_m_s"] for episodes in columns])
        interval = stats.t.interval(0.95, len(spent) - 1, spent.mean(), stats.sem(spent))
        assert setting.num_cases == len(spent) == 120
        np.testing.assert_allclose(setting.estimates["delta_v_m_s"], (spent.mean(), *interval), rtol=1e-12)
        succeeds = np.concatenate([episodes["success"] & ~episodes["violated"] for episodes in columns])
        test = stats.binomtest(int(succeeds.sum()), len(succeeds))
        share = test.proportion_ci(0.95, method="wilson")
        expected = (100 * succeeds.mean(), 100 * share.low, 100 * share.high)
        np.testing.assert_allclose(setting.estimates["success"], expected, rtol=1e-9)
    # the same cases were flown with every controller: all pairs of them count
    spent = [effect for effect in results.effects if effect.metric.name == "delta_v_m_s"]
    assert [(effect.level, effect.unit, effect.difference.count) for effect in spent] == [
        ("second", "cases", 120),
        ("third", "cases", 120),
    ]
    assert [effect.difference.mean for effect in spent] == pytest.approx([0.05, -0.2])


def test_where_seeds_make_controllers_each_counts_once(tmp_path):
    flown = write_runs(tmp_path, ["scenario", "train", "evaluate"])
    results = sweep.gather_results(tmp_path)
    for setting in results.settings:
        means = [flown[setting.setting["controller"], seed]["delta_v_m_s"].mean() for seed in SEEDS]
        interval = stats.t.interval(0.95, len(means) - 1, np.mean(means), stats.sem(means))
        expected = (np.mean(means), max(interval[0], 0.0), interval[1])
        np.testing.assert_allclose(setting.estimates["delta_v_m_s"], expected, rtol=1e-12)
    assert {(effect.unit, effect.difference.count) for effect in results.effects} == {("runs", 3)}


def test_the_same_starts_under_several_seeds_are_not_counted_twice(tmp_path):
    """Such as those of a file."""
    flown = write_runs(tmp_path, ["evaluate"], cases_of=lambda _seed: 5)
    for setting in sweep.gather_results(tmp_path).settings:
        mean = flown[setting.setting["controller"], 1]["delta_v_m_s"].mean()
        np.testing.assert_allclose(setting.estimates["delta_v_m_s"], 3 * [mean], rtol=1e-12)


def test_the_page_says_which_setting_is_better_by_how_much_and_how_sure(tmp_path):
    write_runs(tmp_path, ["scenario", "evaluate"])
    results = sweep.gather_results(tmp_path)
    page = sweep.write(results)
    assert "Sweep over controller<" in page
    third = (
        "controller=third against first: better in delta-v by 0.2000 m/s; no difference shown in inspection"
    )
    assert third in page
    assert "controller=second against first: worse in delta-v by 0.0500 m/s" in page
    # by delta-v and rate the third alone stands: it inspects as much for less
    assert [setting.name for setting in results.front] == ["controller=third"]
    assert page.count("python -m pipeline +experiment=fly controller=third") == 1
    assert "seed=" not in page.partition("Runs</h2>")[0].partition("Best, ready to fly")[0]


def test_a_sweep_over_seeds_alone_has_one_setting(tmp_path):
    runs = []
    for seed in SEEDS:
        write_run(tmp_path / f"seed={seed}", evaluation(seed), ["scenario", "evaluate"])
        runs.append(SweptRun(f"seed={seed}", {"seed": str(seed)}, ("+experiment=evaluate",)))
    write_sweep(tmp_path, runs)
    results = sweep.gather_results(tmp_path)
    assert [(setting.name, setting.num_cases) for setting in results.settings] == [("all runs", 120)]
    assert results.effects == ()
    page = sweep.write(results)
    assert "figure-front" not in page
    assert "Sweep over seed<" in page


@pytest.mark.slow
def test_no_column_is_hidden_at_any_width(tmp_path, opened):
    write_runs(tmp_path, ["scenario", "evaluate"])
    page = opened(sweep.write(sweep.gather_results(tmp_path)))
    assert page.locator("table").count() == 3
    assert_tables_fit(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= WIDTHS[-1]
