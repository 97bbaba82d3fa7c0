"""The mission beside the editor: what a page shows is what a copy flies to."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from pipeline.command_line.cli import main
from pipeline.controllers.source import load
from pipeline.edit import FIRST, Cases, most_changed
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.evaluation.statistics import METRICS
from tests.editors import served
from tests.pipeline.edit.cases import CHAMPION, PATH, cases_of, pressed

pytestmark = pytest.mark.slow

NUM_CASES = 150
WORDS = (f"monte_carlo.num_cases={NUM_CASES}", "sun=random")


@pytest.fixture(scope="module")
def cases() -> Cases:
    return cases_of(WORDS[0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mission")


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    shutil.copy(PATH, folder)
    with served("pipeline", "edit", "controller=champion_27.yaml", *WORDS, folder=folder) as address:
        yield address


def column(page: Page, place: int) -> list[str]:
    """What the table of flights says, top to bottom, once all cases are in it."""
    expect(page.get_by_text(f"{NUM_CASES} flights")).to_be_visible()
    table = page.get_by_role("region", name="Flights").locator("table").first
    return table.locator(f"tbody tr td:nth-of-type({place})").all_inner_texts()


def told(means) -> list[str]:
    """Means of the metrics, as the page puts them."""
    pairs = zip(METRICS, means, strict=True)
    return [f"{mean:.{metric.places}f} {metric.unit}" for metric, mean in pairs]


def flown(cases, controller) -> list[str]:
    return told(metric.of(list(cases.fly(controller))[-1].episodes).mean() for metric in METRICS)


def test_first_some_then_all_cases_of_the_evaluation_are_flown(cases) -> None:
    first, every = cases.fly(CHAMPION)
    controller = replace(load({"path": str(PATH)}, cases.mission), fuzzy=CHAMPION)
    episodes, _ = fly_cases(cases.mission, controller, cases.scenarios)
    assert list(every.episodes) == list(episodes)
    for name, values in episodes.items():
        np.testing.assert_array_equal(every.episodes[name], values)
        np.testing.assert_array_equal(first.episodes[name], values[:FIRST])
    # requirement R3 asks for the points that make a flight a success
    np.testing.assert_array_equal(every.outcomes["R3"].is_met, episodes["inspection_rate_percent"] >= 95.0)


def test_the_flights_that_changed_most_come_first(cases) -> None:
    before, after = list(cases.fly(CHAMPION))[-1], list(cases.fly(pressed(0, 2)))[-1]
    found = most_changed(before, after, 5)
    lost = np.abs(after.episodes["inspected_count"] - before.episodes["inspected_count"])
    ends = before.episodes["success"] & ~before.episodes["violated"]
    ended = after.episodes["success"] & ~after.episodes["violated"]
    assert (ends[found] != ended[found]).all()
    assert lost[found[0]] == lost[ends != ended].max()


def test_a_saved_copy_flies_to_the_numbers_shown(open_page, address, folder, cases) -> None:
    page = open_page(address)
    assert column(page, 2) == column(page, 1) == flown(cases, CHAMPION)
    page.get_by_label("rule 2:").click()
    expect(page.get_by_text("Changed most:")).to_be_visible()
    shown = column(page, 2)
    page.get_by_role("button", name="Save a copy").click()
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("wrote champion_27-edited.yaml")).to_be_visible()
    run = folder / "run"
    words = [f"controller={folder / 'champion_27-edited.yaml'}", "stages=[scenario,evaluate]", *WORDS]
    assert main(["+experiment=evaluate", *words, f"hydra.run.dir={run}"]) == 0
    summary = json.loads((run / "evaluate" / "summary.json").read_text(encoding="utf-8"))
    names = ("delta_v_m_s", "inspection_rate_percent")
    means = [summary[name]["mean"] for name in names]
    shares = [100 * summary[name]["fraction"] for name in ("success_and_within_limits", "violated")]
    assert shown == told([*means, *shares])


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
    expect(flight.get_by_text("force_x: asked for")).to_contain_text("Rule")
    flight.get_by_role("slider", name="time in the flight").focus()
    page.keyboard.press("ArrowRight")
    expect(flight.get_by_text("between two decisions").first).to_be_visible()
    page.get_by_label("rule 2:").click()
    page.get_by_role("button").filter(has_text="m/s,").first.click()
    expect(flight.get_by_label("case")).not_to_have_value("0")
    assert 0 < int(flight.get_by_label("case").input_value()) < NUM_CASES


def test_a_constant_that_cannot_fly_is_refused_in_a_sentence(open_page, address) -> None:
    page = open_page(address)
    column(page, 2)
    period = page.get_by_label("decision_period_s")
    period.fill("25")
    period.press("Enter")
    flights = page.get_by_role("region", name="Flights")
    expect(flights.get_by_text("give a whole number of control periods of 10 s")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text(f"{NUM_CASES} flights")).to_be_visible()
    expect(period).to_have_value("30.0")
    assert flights.get_by_text("give a whole number").count() == 0


def test_a_controller_without_rules_is_refused(ran) -> None:
    assert "no rules to edit" in ran("edit", "controller=lqr", "--no-browser", code=2).err
