"""The mission beside the editor: what a page shows is what a copy flies to, and the tutorial says so."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from fis_tools.edit.panels import findings
from fis_tools.edit.touches import turned, with_system
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.edit.cases import FIRST, EditorCases, most_changed
from pipeline.edit.one_flight import OneFlight
from pipeline.evaluation.assurance.requirements import parse_requirements, requirements_text
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.evaluation.paired_runs import METRICS
from pipeline.evaluation.statistics import succeeds
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.settings.experiment import Mission
from tests import night
from tests.browser import serious_violations
from tests.editors import served
from tests.places import PROJECT

pytestmark = pytest.mark.slow

PATH = PROJECT / "conf" / "controller" / "champion_27.yaml"
CHAMPION = read_controller(PATH)
NUM_CASES = 150
WORDS = (f"monte_carlo.num_cases={NUM_CASES}", "sun=random")
CORNERS = [(axis, rule) for axis in range(3) for rule in (0, 2, 6, 8)]


def cases_of(*words: str) -> EditorCases:
    """The flights of an evaluation of the champion under a random Sun."""
    named = ["+experiment=evaluate", "controller=champion_27", "sun=random", *words]
    text = requirements_text("inspection", Mission())
    return EditorCases(
        compose_experiment(named).experiment, parse_requirements(text, "inspection").requirements
    )


def pressed(axis: int, *rules: int, step: int = 1) -> FuzzyController:
    """The champion with the conclusions of some rules of a system turned to another term."""
    system = CHAMPION.systems[axis]
    for rule in rules:
        system = turned(system, rule - 1, "then", 0, step)
    return with_system(CHAMPION, system)


@pytest.fixture(scope="module")
def cases() -> EditorCases:
    return cases_of(WORDS[0])


def test_many_flights_of_a_controller_with_foresight_are_those_of_its_rules(cases: EditorCases) -> None:
    planning = read_controller(PATH.with_name("champion_27_rehearsed.yaml"))
    flown, alone = (list(cases.fly(each))[-1].episodes for each in (planning, CHAMPION))
    np.testing.assert_array_equal(flown["delta_v_m_s"], alone["delta_v_m_s"])
    assert not flown["ahead_delta_v_m_s"].any()


def test_a_flight_is_shown_within_the_limits_that_its_case_has_drawn() -> None:
    drawn = "+dispersions.deputy.max_distance_m={kind:uniform,low:150.0,high:190.0}"
    flown = cases_of("monte_carlo.num_cases=2", "duration_s=600", drawn)
    shown = next(OneFlight(flown, CHAMPION).answers(CHAMPION))
    assert isinstance(shown, partial)
    table, _ = shown.args[2]
    limits = mission_of_case(flown.mission, flown.scenarios[0]).deputy
    assert table["limits"] == [limits.min_distance_m, limits.max_distance_m]
    assert limits.max_distance_m < flown.mission.deputy.max_distance_m


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mission")


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    shutil.copy(PATH, folder)
    with served("pipeline", "edit", "controller=champion_27.yaml", *WORDS, folder=folder) as address:
        yield address


def column(page: Page, index: int) -> list[str]:
    """What the table of flights says, top to bottom, once all cases are in it."""
    expect(page.get_by_text(f"{NUM_CASES} flights")).to_be_visible()
    table = page.get_by_role("region", name="Flights").locator("table").first
    return table.locator(f"tbody tr td:nth-of-type({index})").all_inner_texts()


def in_words(means) -> list[str]:
    """Means of the metrics, as the page puts them."""
    return [f"{mean:.{metric.decimals}f} {metric.unit}" for metric, mean in zip(METRICS, means, strict=True)]


def flown(cases, controller) -> list[str]:
    return in_words(metric.of(list(cases.fly(controller))[-1].episodes).mean() for metric in METRICS)


def test_first_some_then_all_cases_of_the_evaluation_are_flown(cases) -> None:
    first, every = cases.fly(CHAMPION)
    controller = replace(load({"path": str(PATH)}, cases.mission), fuzzy=CHAMPION)
    episodes, _ = fly_cases(cases.mission, controller, cases.scenarios)
    # the page does not ask what follows a flight
    assert set(episodes) - set(every.episodes) == {"stays_orbit", "stays_three_orbits", "passively_safe"}
    for name in every.episodes:
        values = episodes[name]
        np.testing.assert_array_equal(every.episodes[name], values)
        np.testing.assert_array_equal(first.episodes[name], values[:FIRST])
    # requirement R3 asks for the points that make a flight a success
    np.testing.assert_array_equal(every.outcomes["R3"].is_met, episodes["inspection_rate_percent"] >= 95.0)


def test_the_flights_that_changed_most_come_first(cases) -> None:
    before, after = list(cases.fly(CHAMPION))[-1], list(cases.fly(pressed(0, 2)))[-1]
    cases_in_order = most_changed(before, after, 5)
    lost = np.abs(after.episodes["inspected_count"] - before.episodes["inspected_count"])
    ends = before.episodes["success"] & ~before.episodes["violated"]
    ended = after.episodes["success"] & ~after.episodes["violated"]
    assert (ends[cases_in_order] != ended[cases_in_order]).all()
    assert lost[cases_in_order[0]] == lost[ends != ended].max()


def test_the_worst_of_the_flights_that_fail_come_first(cases) -> None:
    flown = list(cases.fly(pressed(0, 2)))[-1]
    (inspect,) = (requirement for requirement in cases.requirements if requirement.id == "R3")
    rates, num_failed = (
        flown.episodes["inspection_rate_percent"],
        int((flown.episodes["inspection_rate_percent"] < 95.0).sum()),
    )
    assert 3 < num_failed < NUM_CASES
    np.testing.assert_array_equal(rates[flown.failing(inspect, 3)], np.sort(rates)[:3])
    assert len(flown.failing(inspect, NUM_CASES)) == num_failed


def test_a_saved_copy_flies_to_the_numbers_shown(open_page, address, folder, cases) -> None:
    page = open_page(address)
    assert column(page, 2) == column(page, 1) == flown(cases, CHAMPION)
    page.get_by_label("rule 2:").click()
    expect(page.get_by_text("Changed most:")).to_be_visible()
    shown = column(page, 2)
    units = ["m/s", *["percentage points"] * 3]
    assert [words.split(") ")[1] for words in column(page, 3)] == units
    page.get_by_role("button", name="Save a copy").click()
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("wrote champion_27-edited.yaml")).to_be_visible()
    run = folder / "run"
    words = [f"controller={folder / 'champion_27-edited.yaml'}", "stages=[scenario,evaluate]", *WORDS]
    assert main(["+experiment=evaluate", *words, f"hydra.run.dir={run}"]) == 0
    summary = json.loads((run / "evaluate" / "summary.json").read_text(encoding="utf-8"))
    means = [summary[name]["mean"] for name in ("delta_v_m_s", "inspection_rate_percent")]
    shares = [100 * summary[name]["fraction"] for name in ("success_and_within_limits", "violated")]
    assert shown == in_words([*means, *shares])


def test_only_the_newest_of_many_touches_is_answered_in_the_end(open_page, address, cases) -> None:
    page = open_page(address)
    column(page, 2)
    for rule in (2, 3, 4):  # faster than flights are
        page.get_by_label(f"rule {rule}:").click()
    wanted = flown(cases, pressed(0, 2, 3, 4))
    now = page.get_by_role("region", name="Flights").locator("tbody tr td:nth-of-type(2)").first
    expect(now).to_have_text(wanted[0])
    assert column(page, 2) == wanted


def test_one_flight_says_which_rule_made_a_force(open_page, address) -> None:
    page = open_page(address)
    flight = page.get_by_role("region", name="One flight")
    expect(flight.get_by_text("0 s: ")).to_be_visible()
    expect(flight.get_by_text("force_x: asked for")).to_contain_text("rule")
    flight.get_by_role("slider", name="Time of the flight").focus()
    page.keyboard.press("ArrowRight")
    expect(flight.get_by_text("between two decisions").first).to_be_visible()
    page.get_by_label("rule 2:").click()
    page.get_by_role("button").filter(has_text="m/s,").first.click()
    expect(flight.get_by_label("case")).not_to_have_value("0")
    assert 0 < int(flight.get_by_label("case").input_value()) < NUM_CASES


#: collects the words and dashes that are drawn on canvases from now on
DRAWN = """() => {
    window.drawn = new Set();
    const pen = CanvasRenderingContext2D.prototype, { fillText, setLineDash } = pen;
    pen.fillText = function (words, ...at) { drawn.add(words); return fillText.call(this, words, ...at); };
    pen.setLineDash = function (dashes) { drawn.add(dashes.join()); return setLineDash.call(this, dashes); };
}"""


def test_a_flight_shows_limits_sun_and_the_path_as_opened_in_light_and_dark(open_page, address, axe) -> None:
    page = open_page(address)
    page.get_by_label("rule 2:").click()
    flights, flight = (page.get_by_role("region", name=name) for name in ("Flights", "One flight"))
    refuted = flights.locator(".requirement").filter(has_text="R3 Inspect: refuted")
    expect(refuted).to_contain_text("It is required of 95 % of flights; a failure means a failed mission.")
    case = refuted.get_by_role("button").first
    case.click()
    expect(flight.get_by_label("case")).to_have_value(case.inner_text().removeprefix("flight "))
    expect(flights.locator(".state")).to_have_text("")
    expect(flight.locator(".state")).to_have_text("")
    page.evaluate(DRAWN)
    flight.get_by_role("slider", name="Time of the flight").press("ArrowRight")
    expect(flight.get_by_text("10 s: ")).to_be_visible()
    drawn = page.evaluate("[...drawn]")
    assert {"Sun", "200 m", "start", "7,5"} <= set(drawn)
    expect(flight.get_by_text("limits 15, 200 m")).to_be_visible()
    assert serious_violations(page, axe) == []
    page.emulate_media(color_scheme="dark")
    assert serious_violations(page, axe) == []


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("decision_period_s", "25", "give a whole number of control periods of 10 s"),
        ("dead_band_force_x_n", "-1", "give a number from 0 on"),
    ],
)
def test_a_constant_that_cannot_fly_is_refused_and_taken_back(
    open_page, address, name, text, message
) -> None:
    page = open_page(address)
    field = page.get_by_label(name)
    held = field.input_value()
    field.fill(text)
    field.press("Enter")
    expect(page.get_by_role("status").first).to_contain_text(message)
    expect(field).to_have_value(held)
    expect(page.get_by_text("Nothing changed.")).to_be_visible()


def test_a_controller_without_rules_is_refused(ran) -> None:
    assert "no rules to edit" in ran("edit", "controller=lqr", "--no-browser", code=2).err


@pytest.fixture(scope="module")
def all_cases() -> EditorCases:
    return cases_of()


@pytest.fixture(scope="module")
def before(all_cases):
    return list(all_cases.fly(CHAMPION))[-1]


@pytest.fixture(scope="module")
def tutorial() -> str:
    text = (PROJECT / "docs/tutorial/fly-and-review.md").read_text(encoding="utf-8")
    return " ".join(text.split())


def typed(name: str, text: str):
    return replace(CHAMPION, attributes=tuple(sorted((dict(CHAMPION.attributes) | {name: text}).items())))


def succeeded(flown) -> float:
    return 100.0 * float(np.mean(succeeds(flown.episodes)))


def spent(flown) -> float:
    return float(np.mean(flown.episodes["delta_v_m_s"]))


def test_one_press_makes_it_worse(all_cases, before, tutorial) -> None:
    worse = pressed(0, 2)
    assert worse.systems[0].rules[1].consequents[0].term == "zero"
    now = list(all_cases.fly(worse))[-1]
    assert f"{succeeded(now):.1f} % succeed instead of {succeeded(before):.1f} %, for" in tutorial
    assert f"for {spent(now):.2f} m/s instead of {spent(before):.2f} m/s; *Inspect* is refuted" in tutorial
    words = {requirement.title: word for requirement, word, _ in now.verdicts(all_cases.requirements)}
    assert words["Inspect"] == "refuted"
    assert f"press {most_changed(before, now, 1)[0]}." in tutorial
    assert "positive_small (rule 8)" in findings(worse)
    assert "mirror image, rule 8, still pushes up" in tutorial


def test_a_constant_makes_it_better(all_cases, before, tutorial) -> None:
    now = list(all_cases.fly(typed("coast_below_points", "2.5")))[-1]
    compared = {row.metric.name: row for row in all_cases.compare(before, now)}
    saved = compared["delta_v_m_s"].difference
    low, high = sorted((-saved.low, -saved.high))
    assert f"Delta-v falls by {-saved.mean:.3f} m/s ({low:.3f} to {high:.3f})" in tutorial
    lost = -compared["inspection_rate_percent"].difference.mean
    assert f"the inspection rate by {lost:.2f} percentage points" in tutorial
    assert succeeded(now) == succeeded(before)


def test_what_else_to_try(all_cases, before, tutorial) -> None:
    middle = list(all_cases.fly(pressed(1, 5)))[-1]
    assert f"the middle of the table of `force_y` once: {succeeded(middle):.1f} % succeed" in tutorial
    band = list(all_cases.fly(typed("dead_band_force_x_n", "0.03")))[-1]
    assert f"success falls by {succeeded(before) - succeeded(band):.1f} percentage points" in tutorial
    if not night.IS_WHOLE:  # the table that follows takes twelve evaluations
        return
    changes = []
    for axis, rule in CORNERS:
        system = CHAMPION.systems[axis]
        terms, held = system.outputs[0].terms, system.rules[rule].consequents[0].term
        towards = len(terms) // 2 - system.outputs[0].term_index(held)
        now = list(all_cases.fly(pressed(axis, rule + 1, step=int(np.sign(towards)))))[-1]
        changes.append(abs(succeeded(now) - succeeded(before)))
    most = f"{max(changes):.1f} percentage points"
    assert f"a step towards zero changes success by at most {most}" in tutorial
