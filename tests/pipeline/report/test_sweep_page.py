"""The page of a sweep: settings are compared, not runs; seeds that only draw cases are pooled."""

import json

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation import paired_runs
from pipeline.evaluation.monte_carlo import summarise
from pipeline.report import sweep, sweep_page
from pipeline.run import artifacts, configuration, manifests, tables, writing
from pipeline.run.sweep import SweptRun
from pipeline.run.sweep import write as write_sweep
from tests.browser import WIDTHS, assert_tables_fit
from tests.pipeline.evaluation.test_paired_runs import evaluation

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


def write_runs(folder, stages, cases_of=lambda seed: seed, ahead=None):
    """Write a sweep of three controllers with three seeds each; return the episodes by both."""
    runs, flown = [], {}
    for controller, shift in SHIFTS.items():
        for seed in SEEDS:
            name = f"controller={controller}+seed={seed}"
            flown[controller, seed] = evaluation(cases_of(seed), shift=shift)
            if ahead is not None:
                spent = flown[controller, seed]["delta_v_m_s"]
                flown[controller, seed]["ahead_delta_v_m_s"] = ahead[controller, seed] * spent
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
    page = sweep_page.write(results)
    assert "Sweep over controller<" in page
    third = (
        "controller=third against first: better in delta-v by 0.2000 m/s; no difference shown in inspection"
    )
    assert third in page
    assert "controller=second against first: worse in delta-v by 0.0500 m/s" in page
    # by delta-v and rate the third alone stands: it inspects as much for less
    assert [setting.name for setting in results.front] == ["controller=third"]
    assert page.count("python -m pipeline fly ") == 1
    assert f"python -m pipeline fly {tmp_path}/controller=third+seed=" in page
    # no run chose pushes ahead
    assert sweep_page.FUEL_SHARES not in page
    columns = sweep.columns_of(results)
    assert "ahead_percent" not in columns
    # what is told in percent says so in its name
    for metric in paired_runs.METRICS:
        (name,) = {metric.name, f"{metric.name}_percent"} & columns.keys()
        assert name.endswith("_percent") == (metric.unit == "%")
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
    page = sweep_page.write(results)
    assert "figure-front" not in page
    assert "Sweep over seed<" in page


def test_the_shares_of_fuel_stand_where_a_run_chose_pushes_ahead(tmp_path):
    """Of a setting they are of all its fuel, not means of its runs' shares."""
    shares = {(name, seed): 0.2 * seed * (name == "second") for name in SHIFTS for seed in SEEDS}
    flown = write_runs(tmp_path, ["scenario", "evaluate"], ahead=shares)
    results = sweep.gather_results(tmp_path)
    _, of_runs = sweep_page.runs_table(results)
    assert of_runs.heads[-1] == sweep_page.FUEL_SHARES
    cells = {row[0]: row[-1] for row in of_runs.rows}
    for (name, seed), share in shares.items():
        words = f"{100.0 - 100.0 * share:.1f} / {100.0 * share:.1f}" if share else ""
        assert cells[f"controller={name}+seed={seed}"] == words
    spent = [flown["second", seed]["delta_v_m_s"].sum() for seed in SEEDS]
    of_all = 100.0 * sum(0.2 * seed * fuel for seed, fuel in zip(SEEDS, spent, strict=True)) / sum(spent)
    _, of_settings = sweep_page.settings_table(results)
    assert [row[-1] for row in of_settings.rows] == ["", f"{100.0 - of_all:.1f} / {of_all:.1f}", ""]
    columns = sweep.columns_of(results)["ahead_percent"]
    np.testing.assert_allclose(columns, [100.0 * share for share in shares.values()], rtol=1e-12)
    assert sweep_page.FUEL_SHARES in sweep_page.write(results)
    compared = paired_runs.compare(flown["first", 3], flown["second", 3], 95.0)
    _, of_two, _ = sweep_page.compared_table(("A", "B"), compared, [0.0, 60.0], 95.0)
    assert of_two.rows[-1] == (sweep_page.FUEL_SHARES, "", "40.0 / 60.0", "", "", "")


@pytest.mark.slow
def test_no_column_is_hidden_at_any_width(tmp_path, opened):
    write_runs(tmp_path, ["scenario", "evaluate"])
    page = opened(sweep_page.write(sweep.gather_results(tmp_path)))
    assert page.locator("table").count() == 3
    assert_tables_fit(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= WIDTHS[-1]
