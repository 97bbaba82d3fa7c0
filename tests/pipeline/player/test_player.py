"""The player of a page: cases are opened by presses and keys, and all panels show one time."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import expect

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.player.panel import panel
from pipeline.player.runs import CaseColumn, CasePlot, PlayedCases, PlayedPage, PlayedRun
from pipeline.report.case_measures import MEASURES
from pipeline.report.played import carried_of, player_of_starts
from pipeline.scenarios import evaluation_scenarios
from tests import night
from tests.browser import serious_violations
from tests.pipeline.player.pages import PAINTS, as_page, cases_of, run_of, shows

pytestmark = pytest.mark.slow


def test_presses_and_keys_open_cases(ready):
    page = ready("champion_27")
    box = page.locator(".fuel-dots canvas").bounding_box()
    x, y = page.evaluate("() => player.dots[0].where(8)")
    page.locator(".fuel-dots canvas").scroll_into_view_if_needed()
    box = page.locator(".fuel-dots canvas").bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_function("() => player.row !== 3")
    assert page.evaluate("() => [player.row, player.cases.numbers[player.row]]") == [8, 108]
    page.get_by_role("button", name="Open case", exact=False).nth(2).click()
    costly = np.argsort([-log.delta_v_m_s[-1] for log in run_of("champion_27")[3]], kind="stable")
    shows(page, 100 + int(costly[2]))
    page.locator(".fuel-dots canvas").focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    shows(page, 100 + int(costly[3]))
    bar = page.locator(".bars rect.bar").last
    bar.focus()
    page.keyboard.press("Enter")
    shows(page, 100 + int(costly[0]))


def test_all_panels_show_one_time_and_the_address_keeps_it(ready):
    page = ready("champion_27", address="run=trial&case=105&k=124")
    log = run_of("champion_27")[3][5]
    read = """() => {
        const all = words => [...document.querySelectorAll(`#player ${words}`)];
        return { k: player.sides[0].view.sample, slider: +document.querySelector("#player .time").value,
            plots: all("svg[role=slider]").map(each => +each.getAttribute("aria-valuenow")),
            values: all("svg text.now").map(each => each.textContent) };
    }"""
    for key, k in (("", 124), ("ArrowRight", 125), ("PageUp", 95), ("Home", 0), ("End", 360)):
        if key:
            page.locator("#player .distance svg").focus()
            page.keyboard.press(key)
        page.wait_for_function("k => player.sides[0].view.heard === k", arg=k)
        seen = f"{log.is_inspected[k].sum()}"
        values = [f"{np.linalg.norm(log.position_m[k]):.1f} m", f"{log.delta_v_m_s[k]:.3f} m/s", seen]
        expect(page.locator("#player .count")).to_contain_text(f"{seen} of 99 points")
        for _ in range(PAINTS):  # each panel is painted with the next picture of the screen
            shown = page.evaluate(read)
            if shown["values"] == values:
                break
            page.wait_for_timeout(100)
        assert shown["values"] == values
        assert (shown["k"], shown["slider"], set(shown["plots"])) == (k, k, {k})
    page.wait_for_function("() => location.hash === '#run=trial&case=105&k=360'")
    expect(page.locator("#player .why")).to_have_text(re.compile(r"^\s*The flight ends here\."))


#: points of a drag by a finger, of 10 by 4 pixels each
NUM_DRAGGED = 16
#: what such a drag may move
MOVED = "() => [player.lead.view.angles.yaw, player.lead.view.angles.pitch, player.lead.view.sample]"


def test_a_drag_by_finger_turns_the_view_and_moves_the_time_but_no_page(ready):
    page = ready("champion_27", width=400, has_touch=True, is_mobile=True)
    fingers = page.context.new_cdp_session(page)

    def drag(part):
        """Drag up and to the left by a finger from the middle of a part; return how far the page scrolled."""
        element = page.locator(f"#player {part}").first
        element.evaluate("each => each.scrollIntoView({ block: 'center' })")
        box = element.bounding_box()
        before = page.evaluate("() => scrollY")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for step in range(NUM_DRAGGED):
            points = [{"x": x - 4 * step, "y": y - 10 * step}]
            kind = "touchMove" if step else "touchStart"
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            page.wait_for_timeout(16)
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.wait_for_timeout(300)
        return page.evaluate("() => scrollY") - before

    assert drag(".distance h4") > 100  # elsewhere it does
    yaw, pitch, k = page.evaluate(MOVED)
    assert drag(".scene canvas") == 0
    turned_yaw, turned_pitch, same = page.evaluate(MOVED)
    assert turned_yaw - yaw > 0.3
    assert pitch - turned_pitch > 0.3
    assert same == k
    for plot in (".distance", ".fuel", ".progress"):
        page.evaluate("() => player.lead.view.show(350)")
        assert drag(f"{plot} svg[role=slider]") == 0
        page.wait_for_function("() => player.lead.view.sample < 200")


def test_numbers_and_pictures_are_saved(ready, tmp_path):
    page = ready("champion_27", address="case=102&k=10")
    log = run_of("champion_27")[3][2]
    with page.expect_download() as waiting:
        page.get_by_role("button", name="CSV of Distance from the chief").click()
    assert waiting.value.suggested_filename == "trial-case-102-distance.csv"
    waiting.value.save_as(tmp_path / "distance.csv")
    rows = list(csv.DictReader((tmp_path / "distance.csv").read_text().splitlines()))
    far = np.linalg.norm(log.position_m, axis=1)
    np.testing.assert_allclose([float(row["distance_m"]) for row in rows[:361]], far, rtol=1e-12)
    for kind, start in (("SVG", b"<svg"), ("PNG", b"\x89PNG")):
        with page.expect_download() as waiting:
            page.get_by_role("button", name=f"{kind} of Δv spent").click()
        waiting.value.save_as(tmp_path / "picture")
        assert (tmp_path / "picture").read_bytes().startswith(start)


def test_cases_that_a_page_does_not_carry_say_how_to_fly_them(ready):
    _, _, _, logs = run_of("champion_27")
    page = ready("champion_27", recorded=(3, 5))
    assert page.evaluate("() => player.sides[0].flight.spent(360)") == pytest.approx(
        logs[3].delta_v_m_s[-1], rel=1e-6
    )
    page.evaluate("() => player.open(5)")
    shows(page, 105)
    position = page.evaluate("() => player.sides[0].flight.position(200)")
    np.testing.assert_allclose(position, logs[5].position_m[200], rtol=1e-6)
    page.evaluate("() => player.open(6)")
    page.get_by_text("fly RUN case=106").wait_for()
    shows(page, 105)


AT_SAMPLE = "k => player.sides.every(({ view }) => view.sample === k && view.heard === k)"
COMPARED = ("champion_27", "champion_27_parking")


@pytest.fixture(scope="module")
def compared():
    """A page of two runs side by side."""
    runs = [(name, *run_of(name)) for name in COMPARED]
    cases = cases_of(runs[0][4])
    fuel = [np.array([log.delta_v_m_s[-1] for log in logs]) for *_, logs in runs]
    columns = [CaseColumn(f"fuel_{letter}", letter, 3, each) for letter, each in zip("AB", fuel, strict=True)]
    plots = [CasePlot("fuel-B", "B beside A", ("fuel_A", "fuel_B"), is_paired=True)]
    cases = PlayedCases(cases.numbers, [cases.succeeds[0]] * 2, columns, plots)
    played = [
        PlayedRun(name, name, mission, controller, starts) for name, mission, controller, starts, _ in runs
    ]
    return as_page(panel(PlayedPage("", "two", [(run, carried_of(run)) for run in played], cases, 3)))


def test_runs_fly_a_case_side_by_side_under_one_time(opened, compared):
    page = opened(compared, 1400, reduced_motion="reduce")
    page.wait_for_function("() => globalThis.player?.sides?.every(side => side.flight)")
    x, y = page.evaluate("() => player.dots[0].where(8)")
    canvas = page.locator(".fuel-B canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_function("() => player.row === 8")
    spent = page.evaluate("() => player.sides.map(side => side.flight.spent(360))")
    assert spent == [run_of(name)[3][8].delta_v_m_s[-1] for name in COMPARED]
    page.locator(".side").nth(1).locator(".distance svg").focus()
    for key, k in (("Home", 0), ("PageDown", 30), ("ArrowRight", 31)):
        page.keyboard.press(key)
        page.wait_for_function(AT_SAMPLE, arg=k)
        sliders = page.locator("#player svg[role=slider]")
        assert {each.get_attribute("aria-valuenow") for each in sliders.all()} == {str(k)}
    assert page.locator("#player .playback:visible").count() == 1
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 1400


#: by day each width and each scheme
SHOWN = night.by_day([(400, "light"), (400, "dark"), (1400, "dark"), (1400, "light"), (1920, "light")], 2)


@pytest.mark.parametrize(("width", "scheme"), [each for each in SHOWN if each[0] < 1920])
def test_runs_side_by_side_fit_and_axe_finds_nothing(opened, compared, axe, width, scheme):
    page = opened(compared, width, reduced_motion="reduce", color_scheme=scheme)
    page.wait_for_function("() => globalThis.player?.sides?.every(side => side.flight)")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_page_of_ten_thousand_cases_is_small():
    mission, controller, starts, logs = run_of("champion_27")
    drawn = np.random.default_rng(0).normal(size=(10_000, 3))
    many = [replace(starts[0], position_m=75.0 * row / np.linalg.norm(row)) for row in drawn]
    run = PlayedRun("A", "trial", mission, controller, many)
    values = np.random.default_rng(1).random(10_000)
    columns = [replace(column, values=values) for column in cases_of(logs).columns]
    cases = PlayedCases(np.arange(10_000), [values > 0.1], columns, MEASURES["inspection"].plots)
    assert len(as_page(panel(PlayedPage("", "many", [(run, carried_of(run))], cases)))) < 1_500_000


@pytest.mark.parametrize(("width", "scheme"), [*SHOWN, *([(1920, "dark")] if night.IS_WHOLE else [])])
def test_the_player_fits_and_axe_finds_nothing(ready, axe, width, scheme):
    page = ready("champion_27", width=width, color_scheme=scheme)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_player_of_a_thousand_cases_adds_little_to_a_page():
    words = ("+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=1000")
    job = compose_experiment(words).experiment
    controller = source.named("champion_27", job.mission)
    shown = player_of_starts(job, job.mission, controller, evaluation_scenarios(job))
    assert sum(len(part.encode()) for part in (shown.style, shown.body, shown.script)) < 200_000
