"""Fleets beside each other, and beside a deputy alone: a case is shared, and opens with all deputies."""

from itertools import chain

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.command_line import results
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation import comparison, paired_runs
from pipeline.evaluation.evaluated import read_flights
from pipeline.flight.control.controller import ControllerError, OpenLoopController, RuleController
from pipeline.preflight import check_before
from pipeline.report import comparisons, sweep
from pipeline.report.played import shown_of
from pipeline.report.played_fleets import WHY
from pipeline.run import artifacts, tables
from tests.browser import LOOKS, serious_violations
from tests.pipeline.report.runs import run_of

WORDS = ("+experiment=evaluate_fleet", "inspection_threshold_percent=40")
#: of each run its words, and how its deputies are called on a page
RUNS = {
    "alone": (("controller=champion_27", "fleet.deputies=1"), ["A"]),
    "two": (("controller=champion_27",), ["B1", "B2"]),
    "three": (("controller=champion_27_parking", "fleet.deputies=3"), ["C1", "C2", "C3"]),
}
READY = "() => globalThis.player?.sides?.some(side => side.flight)"
COMPARED = ("+experiment=baselines", "compare.controllers=[champion_27,champion_27_parking]", "sun=random")
#: by known methods, some of which plan
BASELINES = compose_experiment(["+experiment=baselines"]).experiment.compare.controllers
#: of a case that is opened, what each side shows
SHOWN = """async row => {
    await player.open(row);
    return Object.fromEntries(player.shownSides.map(({ letter, flight, view }) => [letter, {
        spent: flight.spent(flight.numSamples - 1),
        first: flight.seenBy?.filter(by => by === letter).length,
        fellows: view.fellows.map(fellow => fellow.letter),
    }]));
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("fleets")
    for name, (words, _) in RUNS.items():
        run_of(made / name, ("evaluate",), *WORDS, *words)
    return made


@pytest.fixture(scope="module")
def text(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    results.compare([",".join(str(folder / name) for name in RUNS), f"page={path}"])
    return path.read_text(encoding="utf-8")


def test_fleets_share_the_cases_in_which_all_deputies_start_alike(folder, tmp_path):
    run_of(tmp_path / "other", ("evaluate",), *WORDS, "controller=champion_27", "seed=5")
    run_of(tmp_path / "parked", ("evaluate",), *WORDS, "controller=champion_27", "monte_carlo.parked=true")
    two, three, other, parked = map(
        read_flights, (folder / "two", folder / "three", tmp_path / "other", tmp_path / "parked")
    )
    assert (two["sun_angle_rad"] == other["sun_angle_rad"]).all()
    for unlike in (other, parked):
        assert not len(paired_runs.common_cases(two, unlike)[0])
    # the second deputy of some starts elsewhere
    moved = {name: column.copy() for name, column in two.items()}
    moved[paired_runs.of_deputy("position_x_m", 2)][:4] += 1.0
    rows, others = paired_runs.common_cases(two, moved)
    assert rows.tolist() == others.tolist() == list(range(4, 30))
    # one deputy flies the first one's cases, three those of two
    for fleet in (read_flights(folder / "alone"), three):
        assert len(paired_runs.common_cases(two, fleet)[0]) == len(two["case"])


def test_a_table_of_other_deputies_is_refused(folder, tmp_path):
    for source, name in (("two", artifacts.EPISODES), ("alone", artifacts.EPISODES)):
        path = tmp_path / source / name
        path.parent.mkdir(parents=True)
        path.write_bytes((folder / source / name).read_bytes())
    deputies = pq.read_table(folder / "two" / artifacts.DEPUTIES)
    pq.write_table(deputies.slice(2), tmp_path / "two" / artifacts.DEPUTIES)
    with pytest.raises(artifacts.ArtifactError, match=r"is not of the cases of .*; repeat the stage"):
        read_flights(tmp_path / "two")
    names = pq.read_schema(folder / "alone" / artifacts.EPISODES).names
    assert list(read_flights(tmp_path / "alone")) == names


@pytest.mark.slow
def test_a_case_opens_with_all_deputies_of_each_fleet(opened, folder, text):
    page = opened(text, 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    letters = {name: called for name, (_, called) in RUNS.items()}
    assert page.evaluate("() => player.shownSides.map(({ letter }) => letter)") == ["A", "B1"]
    for box in page.locator(".chosen input").all():
        box.check()
    rows = page.evaluate("() => [...player.cases.numbers.keys()].filter(row => player.sides[1].canOpen(row))")
    assert len(rows) > 2
    flown = {name: pq.read_table(folder / name / artifacts.EPISODES).to_pydict() for name in RUNS}
    fleets = [name for name, called in letters.items() if len(called) > 1]
    deputies = {name: pq.read_table(folder / name / artifacts.DEPUTIES).to_pylist() for name in fleets}
    assert int(np.argmin(flown["two"]["nearest_pair_m"])) in rows
    for row in rows:
        shown = page.evaluate(SHOWN, row)
        assert shown["A"]["spent"] == flown["alone"]["delta_v_m_s"][row]
        for name, of_fleet in deputies.items():
            mine = [each for each in of_fleet if each["case"] == row]
            for letter, each in zip(letters[name], mine, strict=True):
                assert shown[letter]["spent"] == pytest.approx(each["delta_v_m_s"], rel=1e-6)
                assert shown[letter]["first"] == each["inspected_count"]
                assert shown[letter]["fellows"] == [other for other in letters[name] if other != letter]
    # what a module flies opens all the same
    refused = min(set(range(30)) - set(rows))
    assert page.evaluate(SHOWN, refused)["A"]["spent"] == flown["alone"]["delta_v_m_s"][refused]
    said = page.locator("#player .said").inner_text()
    assert said.count(WHY) == 2
    assert all(f"{letter}: case {refused} is not part of this page" in said for letter in "BC")
    assert f"fly {folder / 'two'} case={refused}" in said


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_of_compared_fleets_fits_and_axe_finds_nothing(opened, axe, text, width, scheme):
    page = opened(text, width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


@pytest.mark.slow
def test_the_page_of_a_sweep_opens_fleets(opened, folder):
    results.summary([str(folder)])
    page = opened((folder / results.PAGE).read_text(encoding="utf-8"), 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    offered = [run.folder for run in sweep.gather_results(folder).offered]
    assert len(offered) > 1
    counts = [len(RUNS[name][1]) for name in offered]
    assert page.evaluate("() => player.page.fleets") == counts
    assert page.evaluate("() => player.sides.map(({ run }) => run.name)") == [
        *chain(
            *(
                [f"{name}, deputy {number + 1}" for number in range(count)] if count > 1 else [name]
                for name, count in zip(offered, counts, strict=True)
            )
        )
    ]


@pytest.mark.slow
def test_a_comparison_opens_fleets_by_each_controller_and_layer(opened, tmp_path):
    apart = ("fleet.deputies=2", "safety=filter", "fleet.keep_apart_m=40", "inspection_threshold_percent=40")
    experiment = run_of(tmp_path, ("compare", "report"), *COMPARED, *apart)
    flights = tables.read_parquet(tmp_path, artifacts.COMPARISON_EPISODES)
    is_kept, is_near = flights["safety"] == "filter", flights["nearest_pair_m"] < 40.0
    assert (is_near & is_kept).sum() < (is_near & ~is_kept).sum()  # some start nearer
    rows = comparisons.read_comparison(tmp_path)
    assert {row.source for row in rows} == {comparison.FLOWN}
    page = opened((tmp_path / artifacts.REPORT).read_text(encoding="utf-8"), 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    words = page.locator("#comparison").inner_text()
    assert comparison.OF_FLEETS.format(2) in words
    assert comparison.PAPER_NAME not in words
    contenders = shown_of(experiment)
    assert page.evaluate("() => player.page.fleets") == [2] * len(contenders) == [2, 2, 2, 2]
    for box in page.locator(".chosen input").all():
        box.check()
    can_open = "() => [...player.cases.numbers.keys()].filter(row => player.sides[0].canOpen(row))"
    for row in page.evaluate(can_open):
        shown = page.evaluate(SHOWN, row)
        for letter, (controller, layer) in zip("ABCD", contenders, strict=True):
            (flight,) = np.flatnonzero(
                (flights["controller"] == controller)
                & (flights["safety"] == layer)
                & (flights["sun"] == "random")
                & (flights["case"] == row)
            )
            spent = sum(shown[f"{letter}{deputy}"]["spent"] for deputy in (1, 2))
            assert spent == pytest.approx(flights["delta_v_m_s"][flight], rel=1e-6)


@pytest.mark.parametrize("name", BASELINES)
def test_a_controller_that_plans_for_one_deputy_is_refused_by_name(name):
    words = ("+experiment=baselines", "fleet.deputies=2", f"compare.controllers=[{name}]", "controller=coast")
    experiment = compose_experiment(words).experiment
    if not isinstance(named(name, experiment.mission), RuleController | OpenLoopController):
        with pytest.raises(ControllerError, match=f"'{name}' plans for one deputy"):
            check_before(experiment)
    else:
        check_before(experiment)
