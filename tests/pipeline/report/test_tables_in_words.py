"""Tables and sentences of reports from made-up results: each cell is computed by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation import paired_runs
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.goals.reach import ended
from pipeline.player.runs import PlayedRun
from pipeline.report import comparisons, fit, page, pictures, played, sweep, sweep_page, worst_flight
from pipeline.report.contents import FlightSet, gather, read_numbers, read_summary
from pipeline.report.facts import facts_of, sun_at_start
from pipeline.report.fleets import deputy_rows, together_rows
from pipeline.run import artifacts
from pipeline.run.artifacts import ArtifactError
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from plain_files.document import Items, Table
from tests.pipeline.evaluation.test_paired_runs import evaluation
from tests.pipeline.recording import cases
from tests.pipeline.report.runs import run_of
from tests.pipeline.report.test_sweep_page import SEEDS, write_runs

TEN_MINUTES = "duration_s=600.0"
MISSION = cases.composed(TEN_MINUTES).experiment.mission


def entry(percent, value, low, high):
    return {"percent": percent, "value": value, "low": low, "high": high}


def test_percentiles_tell_which_share_has_at_most_or_at_least_that(tmp_path):
    of_fuel = [entry(50.0, 0.5, 0.4, 0.6), entry(99.0, 0.9, 0.8, None), entry(1.0, 0.1, None, 0.2)]
    summary = {"percentiles": {"delta_v_m_s": of_fuel, "min_distance_m": [entry(5.0, 20.0, None, None)]}}
    rows = comparisons.spread_of(tmp_path, summary).percentiles
    assert [row[1:] for row in rows] == [
        ["50 % have at most", "0.500", "0.400 to 0.600"],
        ["99 % have at most", "0.900", "0.800 and more"],
        ["99 % have at least", "0.100", "up to 0.200"],
        ["95 % have at least", "20.0", "not told by so few"],
    ]
    assert comparisons.spread_of(tmp_path, summary).ranking == ()


def share(fraction, low=0.1, high=0.9):
    return {"fraction": fraction, "low": low, "high": high, "count": 0}


def mean(value, deviation=0.25, **others):
    return {"mean": value, "standard_deviation": deviation, "low": value - 1.0, "high": value + 1.0} | others


def test_dispersions_are_ranked_beside_flights_without_them(tmp_path):
    outcome = {"delta_v_m_s": mean(0.5), "inspectable_rate_percent": mean(97.5)}
    outcome |= {"success_and_within_limits": share(0.875), "violated": share(0.0625)}
    correlation = {"value": -0.5, "low": -0.75, "high": 0.125}
    ranked = {
        "key": "mass",
        "delta_v_m_s": correlation,
        "inspectable_rate_percent": correlation | {"value": 0.5},
    }
    whole = outcome | {"nominal": outcome | {"violated": share(0.5)}, "sensitivity": [ranked]}
    spread = comparisons.spread_of(tmp_path, whole)
    assert [row[3:] for row in spread.nominal] == [["87.5 %", "6.2 %"], ["87.5 %", "50.0 %"]]
    assert spread.nominal[0][:3] == ["as dispersed", "0.500 ± 0.250", "97.50 ± 0.25"]
    assert spread.ranking == [["mass", "−0.50 (−0.75 to +0.12)", "+0.50 (−0.75 to +0.12)"]]


def test_facts_of_a_flight_are_those_of_its_log():
    count = 61
    position = np.linspace((30.0, 0.0, 40.0), (60.0, 0.0, 80.0), count)
    seen = np.arange(99) < 2 * np.arange(count)[:, np.newaxis]
    log = cases.flown(TEN_MINUTES)._replace(position_m=position, is_inspected=seen)
    log = log._replace(is_inspectable=np.arange(99) < 90, delta_v_m_s=np.linspace(0.0, 0.4567, count))
    sun = {"sun_angle_rad": np.pi / 3.0, "sun_elevation_rad": -np.pi / 6.0}
    start = SimpleNamespace(position_m=position[0], **sun, settings=None)
    flight = SimpleNamespace(name="start", title="T", scenario=start, log=log, fleet=())
    ((name, title, facts),) = facts_of(flight, MISSION)
    assert (name, title) == ("control-start", "T")
    # 95 % of 90 points are 86, which two points a period reach after 43
    assert dict(facts) == {
        "start, Hill axes": "(30.00, 0.00, 40.00) m",
        "Sun at the start": "60.0°, −30.0° over the orbit plane",
        "Δv": "0.457 m/s",
        "inspected": "99 of the 90 points that can be inspected (99 in all), 110.00 %",
        "95 % reached": "after 430 s",
        "distance": "50.0 to 100.0 m, 75.0 m on average",
    }
    never = log._replace(is_inspected=np.zeros_like(seen))
    facts = dict(facts_of(SimpleNamespace(**{**vars(flight), "log": never}), MISSION)[0][2])
    assert facts["95 % reached"] == "not in this flight"
    assert sun_at_start(np.pi / 2.0, 0.0, 2) == "90.00°"


def test_facts_of_a_fleet_are_of_all_and_of_each():
    logs, starts = [], []
    paths = [np.linspace((30.0, y, 0.0), (30.0, y, 0.0), 61) for y in (0.0, 40.0, 100.0)]
    by = np.zeros((61, 99), np.uint8)
    by[10:, :50], by[20:, 50:95], by[30:, 95:97] = 1, 2, 3
    for number, path in enumerate(paths, 1):
        log = cases.flown(TEN_MINUTES)._replace(
            position_m=path, delta_v_m_s=np.linspace(0.0, 0.1 * number, 61)
        )
        log = log._replace(is_inspectable=np.ones(99, dtype=bool))
        logs.append(SimpleNamespace(deputy=number, flight=log, seen_by=by))
        starts.append(SimpleNamespace(position_m=path[0], sun_angle_rad=0.5, sun_elevation_rad=0.0))
    scenario = SimpleNamespace(fleet=starts, sun_angle_rad=0.0, sun_elevation_rad=0.0)
    parts = [
        SimpleNamespace(name=f"p{k}", title="", scenario=starts[k], log=logs[k].flight) for k in range(3)
    ]
    flight = SimpleNamespace(
        name="f", title="F", scenario=scenario, log=logs[0].flight, fleet=logs, parts=parts
    )
    (name, _, whole), *each = facts_of(flight, MISSION)
    assert name == "trajectories-f"
    assert dict(whole) == {
        "Sun at the start": "0.0°",
        "Δv of all": "0.600 m/s",
        "inspected by any": "97 of 99 points, 97.98 %",
        "95 % reached": "after 200 s",
        "nearest two": "40.0 m",
    }
    assert [dict(facts)["seen first"] for _, _, facts in each] == ["50 points", "45 points", "2 points"]
    assert [dict(facts)["Δv"] for _, _, facts in each] == ["0.100 m/s", "0.200 m/s", "0.300 m/s"]


def test_rows_of_deputies_are_over_all_flights_of_each():
    draw = np.random.default_rng(2)
    deputies = {
        "deputy": np.tile([1, 2], 20),
        "delta_v_m_s": draw.random(40),
        "mean_distance_m": 50 + draw.random(40),
    }
    deputies |= {"inspected_count": draw.integers(10, 90, 40), "violated": np.arange(40) % 8 < 3}
    deputies |= {"min_distance_m": 20 + draw.random(40), "max_distance_m": 90 + draw.random(40)}
    rows = deputy_rows(FlightSet(None, None, {"confidence_percent": 90.0}, deputies))
    for number, row in enumerate(rows, 1):
        is_of = deputies["deputy"] == number
        assert row[0] == f"deputy\u00a0{number}"
        for cell, name, decimals in (
            (1, "delta_v_m_s", 3),
            (2, "inspected_count", 1),
            (3, "mean_distance_m", 1),
        ):
            values = deputies[name][is_of].astype(float)
            low, high = stats.t.interval(0.9, 19, values.mean(), stats.sem(values))
            numbers = [f"{number:.{decimals}f}" for number in (values.mean(), values.std(ddof=1), low, high)]
            words = "{} ± {} ({} to {})".format(*numbers)
            assert row[cell] == words
        nearest, farthest = deputies["min_distance_m"][is_of].min(), deputies["max_distance_m"][is_of].max()
        assert row[4:] == [f"{nearest:.1f} to {farthest:.1f}", f"{deputies['violated'][is_of].sum()} of 20"]
    assert deputy_rows(FlightSet(None, None, {}, None)) == []
    summary = {"enough_s": mean(1200.4, 10.0, minimum=900.0, maximum=1500.0)}
    assert [row[1:] for row in together_rows(summary)] == [["1200 ± 10", "1199 to 1201", "900", "1500"]]


def tally(fraction, num_cases=40, ahead=0.0, **others):
    shares = {name: share(fraction) | {"count": 4} for name in ("success", "exits", "misses")}
    return {"num_cases": num_cases, **shares, "delta_v": 0.5, "ahead_percent": ahead, "words": "w", **others}


@pytest.mark.parametrize(("goal", "verb"), [(10.0, "reaches"), (10.1, "misses")])
def test_the_page_of_a_fit_compares_the_lower_bound_with_the_goal(goal, verb):
    result = {
        "last": tally(0.875),
        "safety": "none",
        "tuned": False,
        "words": "as shipped",
        "goal_percent": goal,
    }
    result |= {"limits": [], "layer_refused": "", "rivals": [tally(0.5, ahead=25.0)], "shipped": tally(0.5)}
    result |= dict.fromkeys(("fitted", "layered", "planned", "tuned"))
    text = fit.render_fit("law", result).replace("\u00a0", " ")
    assert "87.5 % (10.0 to 90.0) of 40 flights succeed" in text
    assert "4 left the limits, 4 missed points inside them. It is as shipped." in text
    assert f"The lower bound, 10.0 %, {verb} the goal of {goal:g} %." in text
    # of rivals some chose pushes ahead: the rest was fired by rules
    assert text.count(fit.BY_RULES) >= 1
    assert ">75.0</td>" in text
    layered = fit.render_fit("law", result | {"safety": "filter", "tuned": tally(0.5)})
    assert "It is as shipped, tuned, under the safety layer." in layered


def training_of(count):
    columns = {
        "case": np.arange(count) + 10,
        "sun_angle_rad": np.full(count, np.pi / 2.0),
        "delta_v_m_s": np.full(count, 0.5),
    }
    columns |= {
        "position_x_m": np.full(count, -1.5),
        "position_y_m": np.zeros(count),
        "position_z_m": np.full(count, 2.25),
    }
    columns |= {"inspection_rate_percent": np.full(count, 99.0), "mean_distance_m": np.full(count, 60.0)}
    columns |= {"min_distance_m": np.full(count, 20.0), "max_distance_m": np.full(count, 99.96)}
    columns |= {"success": np.arange(count) != 1, "violated": np.arange(count) == 2}
    return FlightSet(columns, None, {"num_cases": count})


def test_rows_of_training_flights_are_theirs_while_there_are_few():
    heads, *rows = page.case_rows(training_of(3))
    assert len(heads) == len(rows[0])
    assert rows[0] == ["10", "−1.5, 0.0, 2.2", "90.0", "0.500", "99.00", "60.00", "20.0 to 100.0", "success"]
    assert [row[-1] for row in rows] == ["success", "too few points", "outside the limits"]
    assert len(page.case_rows(training_of(64))) == 65
    assert page.case_rows(training_of(65)) == []
    assert page.case_rows(None) == []


def test_rows_of_a_front_say_which_stand():
    front = {
        "controller": [0.0, 1.0, 2.0],
        "delta_v_m_s": [0.5, 0.6, 0.7],
        "inspection_rate_percent": [99.0] * 3,
    }
    front |= {"success_percent": [80.0] * 3, "outside_percent": [0.5] * 3, "fitness_m_s": [1.25] * 3}
    front |= {"handed_back": [0.0, 1.0, 0.0], "stands": [1.0, 1.0, 0.0]}
    heads, *rows = page.front_rows({name: np.array(values) for name, values in front.items()})
    assert rows[0] == ["00", "0.500", "99.00", "80.0", "0.50", "1.250", ""]
    assert [row[-1] for row in rows] == ["", "handed back", "beaten by another"]
    assert len(heads) == 7
    assert page.front_rows(None) == []


def test_results_towards_a_goal_are_in_percent():
    docking = compose_experiment(["+experiment=fly", "problem=docking"]).experiment.mission
    summary = {name: mean(1.5, 0.25, minimum=1.0, maximum=2.0) for name in page.MEASURES}
    summary |= {name: share(0.875, 0.75, 0.9375) for name in page.OUTCOMES}
    summary |= {"num_cases": 1234, "confidence_percent": 90.0}
    words = page.lead("It", summary, docking)
    assert "It, flown from 1,234 starts" in words
    assert "in 87.5 % of the flights" in words
    assert "spend 1.500 ± 0.250 m/s. 87.5 % are never above" in words.replace("\n", " ")
    means, shares = (block for block in page._results(summary) if isinstance(block, Table))
    decimals = [decimals for _, decimals in page.MEASURES.values()]
    for row, digits in zip(means.rows, decimals, strict=True):
        assert row[1:] == [f"{1.5:.{digits}f} ± {0.25:.{digits}f}", f"{1.0:.{digits}f}", f"{2.0:.{digits}f}"]
    assert [row[1:] for row in shares.rows] == [["87.50 %", "75.00 to 93.75 %"]] * 3


def test_columns_of_a_training_s_table_are_read_as_numbers(tmp_path):
    (tmp_path / "t.csv").write_text("a,b,c\n1,2.5,x\n3,4.5,y\n")
    columns = read_numbers(tmp_path, "t.csv", ["b", "a"])
    assert {name: column.tolist() for name, column in columns.items()} == {"b": [2.5, 4.5], "a": [1.0, 3.0]}
    (tmp_path / "t.csv").write_text("a,b\n")
    assert read_numbers(tmp_path, "t.csv", ["a"]) is None
    assert read_numbers(tmp_path, "none.csv", ["a"]) is None
    with pytest.raises(ArtifactError):
        read_summary(tmp_path)


@pytest.mark.parametrize("count", [2, 3])
def test_columns_of_cases_are_of_each_run_and_of_their_differences(count):
    draw = np.random.default_rng(5)
    names = ("delta_v_m_s", "inspection_rate_percent")
    values = [{name: draw.random(6) for name in names} for _ in range(count)]
    runs = [SimpleNamespace(experiment=SimpleNamespace(mission=MISSION))] * count
    columns, plots = played._paired(runs, values)
    letters = "ABC"[:count]
    by_name = {column.name: column for column in columns}
    for letter, of_run in zip(letters, values, strict=True):
        for name in names:
            column = by_name[f"{name}_{letter}"]
            np.testing.assert_array_equal(column.values, of_run[name])
            assert column.label.startswith(f"{letter}: ")
            assert column.is_told == (count == 2 or name == "delta_v_m_s")
    for letter, of_run in list(zip(letters, values, strict=True))[1:]:
        more = by_name[f"more_{letter}"]
        np.testing.assert_array_equal(more.values, of_run["delta_v_m_s"] - values[0]["delta_v_m_s"])
        assert more.is_told == (count == 2)
    assert len(columns) == 2 * count + count - 1
    pairs = [plot.columns for plot in plots if plot.is_paired]
    assert pairs == [(f"{name}_A", f"{name}_{letter}") for letter in letters[1:] for name in names]
    bars = [plot.columns for plot in plots if not plot.is_paired]
    assert bars == [(f"more_{letter}",) for letter in letters[1:]]


def test_worlds_and_suns_of_a_page_are_the_first_and_the_run_s():
    words = ["+experiment=baselines", "compare.controllers=[lqr]", "compare.suns=[random,fixed]"]
    here = compose_experiment([*words, "sun=random"]).experiment
    assert played.compared_in(here) == ("", "random")
    fixed_only = replace(here, compare=replace(here.compare, suns=("fixed",), worlds={"leo": {}, "geo": {}}))
    assert played.compared_in(fixed_only) == ("leo", "fixed")


def test_a_sweep_s_sentences_have_the_sign_and_size_of_their_effects(tmp_path):
    write_runs(tmp_path, ["scenario", "evaluate"])
    results = sweep.gather_results(tmp_path)
    items, _, table = sweep_page.effects_table(results)
    assert isinstance(items, Items)
    second, third = items.items
    assert second.startswith("controller=second against first: worse in delta-v by 0.0500 m/s; ")
    assert third.startswith("controller=third against first: better in delta-v by 0.2000 m/s; ")
    assert [row[:2] for row in table.rows] == [
        ("controller: second against first", "120 cases"),
        ("controller: third against first", "120 cases"),
    ]
    by_row = {row[0].split()[1]: row[2] for row in table.rows}
    for effect in (each for each in results.effects if each.metric.name == "delta_v_m_s"):
        assert f"{effect.difference.mean:+.4f}"[1:] in by_row[effect.level].replace("−", "-")
        assert by_row[effect.level].endswith("*") == effect.is_shown
    _, runs = sweep_page.runs_table(results)
    assert len(runs.rows) == len(SEEDS) * 3
    _, settings = sweep_page.settings_table(results)
    assert [row[1] for row in settings.rows] == ["3, 120"] * 3
    assert [row[0].endswith(" (front)") for row in settings.rows] == [False, False, True]


def test_two_runs_side_by_side_count_who_is_better():
    first, second = evaluation(1), evaluation(1, shift=0.05)
    compared = paired_runs.compare(first, second, 90.0)
    title, table, _ = sweep_page.compared_table(("x", "y"), compared, [0.0, 0.0], 90.0)
    assert title.words.startswith("40 common cases; B against A, 90 % intervals")
    fuel = table.rows[0]
    spent = [np.mean(of["delta_v_m_s"]) for of in (first, second)]
    assert list(fuel[1:3]) == [f"{value:.4f}" for value in spent]
    assert fuel[4] == "0 / 40 / 0"
    assert len(table.rows) == len(paired_runs.METRICS)
    back = paired_runs.compare(second, first, 90.0)
    assert sweep_page.compared_table(("y", "x"), back, [0.0, 0.0], 90.0)[1].rows[0][4] == "40 / 0 / 0"


def test_shared_rows_are_those_of_cases_that_all_have():
    whole = evaluation(3)
    half = {name: column[5:25] for name, column in whole.items()}
    turned = {name: column[::-1] for name, column in whole.items()}
    rows = sweep_page.shared_rows([whole, half, turned])
    assert rows == [[*range(5, 25)], [*range(20)], [39 - k for k in range(5, 25)]]
    assert sweep_page.shared_rows([half]) == [[*range(20)]]


def test_samples_of_distributions_are_the_flights_and_of_fleets_their_deputies():
    episodes = training_of(30).episodes | {"nearest_pair_m": np.ones(30)}
    deputies = {
        "delta_v_m_s": np.arange(60.0),
        "inspected_count": np.arange(60),
        "mean_distance_m": np.ones(60),
    }
    summary = {name: mean(7.0) for name in pictures.METRICS}
    fleets = FlightSet(episodes, None, summary, deputies)
    flights = FlightSet(training_of(30).episodes, None, summary)
    reported = SimpleNamespace(means={"delta_v_m_s": 5.0})
    contents = SimpleNamespace(sets=[("One", flights, reported), ("Fleet", fleets, None)])
    alone, fleet, each = pictures._samples(contents, 99)
    assert [sample.label for sample in (alone, fleet, each)] == [
        "One, 30 flights",
        "Fleet, 30 flights",
        "Fleet, their 60 deputies",
    ]
    np.testing.assert_array_equal(alone.values["delta_v_m_s"], np.full(30, 0.5))
    assert (alone.paper_means, fleet.paper_means) == ({"delta_v_m_s": 5.0}, {})
    assert alone.means["delta_v_m_s"] == 7.0
    np.testing.assert_allclose(each.values["inspection_rate_percent"], 100.0 * np.arange(60) / 99.0)


def test_the_worst_known_flight_is_the_least_margin_of_all():
    starts = ["a", "b", "c"]
    outcome = SimpleNamespace(margins=np.array([2.0, 0.5, 1.0]), worst=(0.5, "m"))
    searches = [
        SimpleNamespace(worst=1, scenarios=["x", "y"], outcome=SimpleNamespace(worst=(0.75, "m"))),
        SimpleNamespace(worst=0, scenarios=["u", "v"], outcome=SimpleNamespace(worst=(0.25, "m"))),
    ]
    evidence = SimpleNamespace(searches=searches)
    assert worst_flight.worst_of(evidence, starts, outcome) == (0.25, "m", "u", "second search, flight 0")
    evidence.searches = searches[:1]
    assert worst_flight.worst_of(evidence, starts, outcome) == (0.5, "m", "b", "case 1")


def test_flights_of_a_training_that_is_only_recorded_are_among_the_contents(tmp_path):
    recorded = run_of(tmp_path, ("scenario",), "+experiment=evaluate", "telemetry.record_training=true")
    assert len(gather(recorded, tmp_path).training.episodes["case"]) == len(training_scenarios(recorded))
    (tmp_path / artifacts.SCENARIOS).unlink()
    run_of(tmp_path, ("scenario",), "+experiment=evaluate")
    assert gather(recorded, tmp_path).training is None


def test_flights_to_a_goal_end_where_they_are_known_or_flown_to_end():
    words = ["+experiment=evaluate", "problem=docking", "controller=champion_docking", "duration_s=600"]
    experiment = compose_experiment(words).experiment
    controller = source.load(experiment.controller, experiment.mission)
    starts = evaluation_scenarios(experiment, [0, 1])
    run = PlayedRun("law", "law", experiment.mission, controller, starts)
    logs = [fly_logged(experiment.mission, controller, start) for start in starts]
    assert played._ends(run, ()) == [ended(experiment.mission, log)[0] for log in logs]
    period_s = experiment.mission.control_period_s
    assert played._ends(run, [7 * period_s, 9 * period_s]) == [7, 9]
