"""The first page: what it flies is what the product flies, bit for bit, and people can use it."""

import base64
import gzip
import html
import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from docs.scripts import home
from docs.scripts.home import CONTROLLER, FILE, NUM_STARTS, experiment
from fis_tools.analysis import shapley
from fis_tools.engines.compiler import compile
from fis_tools.formats.serialize import load
from fis_tools.model.thrust import REASONS
from pipeline.controllers import source
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.scenarios import evaluation_scenarios
from tests import night
from tests.browser import LOOKS, SWALLOWED, serious_violations

pytestmark = pytest.mark.slow

#: read from the page's memory as base64, since a list of so many numbers takes long
READ = """([name, first, count]) => {
    const array = flightPage.flights.log[name].subarray(first, first + count);
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    let text = ""; bytes.forEach(byte => { text += String.fromCharCode(byte); });
    return btoa(text);
}"""


@cache
def flights():
    """Return the mission, the controller and the starts of the page."""
    flown = experiment()
    return flown.mission, source.named(CONTROLLER, flown.mission), evaluation_scenarios(flown)


@pytest.fixture(scope="module")
def page_text():
    return home.page()


@pytest.fixture
def shown(opened, page_text):
    """The page once all flights are flown."""
    page = opened(page_text, reduced_motion="reduce")
    page.wait_for_function("() => document.getElementById('many').textContent.includes('succeed')")
    return page


def logged(page, name, count, kind):
    return np.frombuffer(base64.b64decode(page.evaluate(READ, [name, 0, count])), dtype=kind)


def starts_of(page):
    """Return the page's starts, which another order of sums in linear algebra may round otherwise."""
    starts = list(flights()[2])
    for index, start in list(enumerate(starts))[1:]:
        page.evaluate(f"() => flightPage.flights.fly({index}, {index + 1}, {{ isLogged: true }})")
        position = logged(page, "position", 3, np.float64)
        np.testing.assert_allclose(position, start.position_m, rtol=1e-14)
        starts[index] = replace(start, position_m=position)
    return starts


def test_the_browser_flies_every_start_to_the_products_bits(shown):
    (mission, controller, _), starts = flights(), starts_of(shown)
    rows = mission.num_controls + 1
    assert len(starts) == NUM_STARTS
    for index, start in list(enumerate(starts))[1:]:
        shown.evaluate(f"() => flightPage.flights.fly({index}, {index + 1}, {{ isLogged: true }})")
        log = fly_logged(mission, controller, start)
        position = logged(shown, "position", 3 * rows, np.float64).reshape(rows, 3)
        assert position.tobytes() == log.position_m.tobytes(), index
        inspected = logged(shown, "isInspected", log.is_inspected.size, np.uint8)
        assert np.array_equal(inspected.reshape(log.is_inspected.shape), log.is_inspected), index
        assert np.array_equal(logged(shown, "spent", rows, np.float64), log.delta_v_m_s), index


def test_edited_rules_fly_to_the_products_bits_as_saved(shown, tmp_path):
    (mission, _, _), starts = flights(), starts_of(shown)
    rng = np.random.default_rng(7)
    systems = load(FILE).systems
    for case in range(night.count(10, 30)):
        rules, peaks = [], []
        for index, system in enumerate(systems):
            (output,) = system.outputs
            rule, term = rng.integers(len(system.rules)), rng.integers(len(output.terms))
            rules.append(f"{index}-{rule}-{term}")
            at = int(rng.integers(len(system.inputs) + 1))
            variable = (*system.inputs, output)[at]
            peaks.append(f"{index}_{at}_1_{rng.uniform(variable.minimum, variable.maximum)}")
        shown.evaluate(
            "address => { location.hash = address; }", f"rules={'.'.join(rules)}&peaks={'~'.join(peaks)}"
        )
        saved = tmp_path / f"edited-{case}.yaml"
        saved.write_text(
            shown.evaluate("async () => { await flightPage.flyAll(); return flightPage.asYaml(); }")
        )
        outcomes = np.array(shown.evaluate("() => [...flightPage.flights.outcomes]")).reshape(NUM_STARTS, -1)
        expected = fly_all(mission, source.load({"path": str(saved)}, mission), starts)
        assert np.array_equal(outcomes[1:, 0], expected.delta_v_m_s[1:]), case
        assert np.array_equal(outcomes[1:, 1], expected.inspected_count[1:]), case


def test_the_rule_that_is_named_moves_the_force_most(shown):
    mission, controller, starts = flights()
    compiled = [compile(system) for system in controller.systems]
    num_pushes = 0
    for index in (3, 70, 140):
        shown.evaluate(f"() => flightPage.flights.fly({index}, {index + 1}, {{ isLogged: true }})")
        log = fly_logged(mission, controller, starts[index])
        for k, axis in np.argwhere(log.is_decided[:, np.newaxis] & (log.force_hill_n != 0.0)):
            inputs = log.fis_input[k, axis, :2]
            expected = shapley.shares(compiled[axis], inputs[np.newaxis]).values[0, :, 0]
            shares = shown.evaluate(
                "([axis, inputs]) => flightPage.flights.shares(axis, inputs)", [int(axis), inputs.tolist()]
            )
            assert np.abs(np.subtract(shares, expected)).max() < 1e-12, (k, axis, inputs, shares, expected)
            sign = float(np.sign(log.force_hill_n[k, axis]))
            named = shown.evaluate(
                "([axis, k, sign]) => flightPage.mostMoving(axis, k, sign)", [int(axis), int(k), sign]
            )
            assert expected[named] * sign == pytest.approx(max(expected * sign), abs=1e-12)
            num_pushes += 1
    assert num_pushes > 20


def test_points_are_drawn_as_lit_that_are_lit(shown):
    mission, controller, starts = flights()
    shown.evaluate("() => flightPage.flights.fly(5, 6, { isLogged: true })")
    counts = shown.evaluate(
        """() => {
            const { flown, isLit } = flightPage;
            return Array.from({ length: flown.numSamples }, (_, k) =>
                flown.points.filter((point, j) => isLit(point, flown.sun(k)) && !flown.isSeen(k, j)).length);
        }"""
    )
    assert counts == fly_logged(mission, controller, starts[5]).num_candidates.tolist()


def test_a_guess_is_answered_by_the_flights(shown):
    shown.get_by_role("button", name="Most fail").click()
    answer = shown.locator("#guess")
    answer.get_by_text("leave the limits").wait_for()
    before, after = map(float, re.findall(r"([\d.]+) %", answer.inner_text()))
    assert before > 95.0
    assert after < 50.0
    shown.get_by_role("button", name="The champion's own rules").click()
    shown.get_by_text("Guess first").wait_for()


def test_an_address_brings_the_flight_back(opened, page_text):
    first, other = (opened(page_text, reduced_motion="reduce") for _ in range(2))
    first.locator("#azimuth").fill("-120")
    first.locator("#sun").fill("200")
    first.locator("#cell-1-4 button").click()
    first.wait_for_function("() => location.hash.includes('rules=')")
    first.evaluate("() => flightPage.flyAll()")
    other.wait_for_function("() => globalThis.flightPage !== undefined")
    other.evaluate("address => { location.hash = address; }", first.evaluate("() => location.hash"))
    other.wait_for_function("() => document.getElementById('azimuth').value === '-120'")
    read = "() => JSON.stringify([flightPage.flown.position(200), flightPage.systems])"
    # flights are flown after the sliders move
    other.wait_for_function(f"expected => ({read})() === expected", arg=first.evaluate(read))


def test_a_start_is_dragged(shown):
    shown.wait_for_timeout(100)
    box = shown.locator("canvas").bounding_box()
    x, y, _ = shown.evaluate("() => flightPage.view.startAt")
    before = shown.evaluate("() => flightPage.flown.position(0)")
    shown.mouse.move(box["x"] + x, box["y"] + y)
    shown.mouse.down()
    shown.mouse.move(box["x"] + x + 30, box["y"] + y + 40)
    shown.mouse.up()
    after = shown.evaluate("() => flightPage.flown.position(0)")
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before))
    assert np.linalg.norm(np.subtract(after, before)) > 5.0


def test_the_sun_is_dragged_to_where_the_pointer_is(shown):
    shown.wait_for_timeout(100)
    box = shown.locator("canvas").bounding_box()
    x, y, _ = shown.evaluate("() => flightPage.view.sunAt")
    before = shown.evaluate("() => flightPage.flown.sun(0)")
    shown.mouse.move(box["x"] + x, box["y"] + y)
    shown.mouse.down()
    shown.mouse.move(box["x"] + x + 50, box["y"] + y + 30, steps=3)
    shown.mouse.up()
    after = shown.evaluate("() => flightPage.flown.sun(0)")
    assert np.linalg.norm(after) == pytest.approx(1.0)
    assert np.dot(before, after) < 0.999
    # the direction under the pointer, though the length drawn may differ
    centre, drawn = shown.evaluate("() => [flightPage.view.on([0, 0, 0]), flightPage.view.sunAt]")
    wanted = np.array([x + 50, y + 30]) - centre[:2]
    shown_at = np.array(drawn[:2]) - centre[:2]
    assert np.arctan2(*wanted) == pytest.approx(np.arctan2(*shown_at), abs=0.02)


def test_the_keyboard_reaches_everything(shown):
    shown.locator("canvas").focus()
    turned = shown.evaluate("() => flightPage.view.angles.yaw")
    shown.keyboard.press("ArrowLeft")
    assert shown.evaluate("() => flightPage.view.angles.yaw") != turned
    shown.keyboard.press("Space")
    assert shown.get_by_role("button", name="Pause").is_visible()
    shown.keyboard.press("Space")
    rule = shown.locator("#cell-0-0 button")
    rule.focus()
    text = rule.inner_text()
    shown.keyboard.press("Enter")
    assert shown.locator("#cell-0-0 button").inner_text() != text
    assert shown.evaluate("() => document.activeElement.closest('td').id") == "cell-0-0"
    shown.locator("summary").first.click()
    peak = shown.locator("#peak-0-0-1")
    peak.focus()
    shown.keyboard.press("ArrowRight")
    assert shown.evaluate("() => document.activeElement.id") == "peak-0-0-1"
    assert shown.evaluate("() => flightPage.systems[0].inputs[0].terms[1].peak") > 0.0


@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_fits_and_axe_finds_nothing(opened, page_text, axe, width, scheme):
    page = opened(page_text, width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function("() => document.getElementById('many').textContent.includes('succeed')")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    # axe adds a script, which the page's policy allows nobody but a test
    assert serious_violations(page, axe) == []


def test_the_first_page_is_small(page_text):
    assert len(gzip.compress(page_text.encode())) < 125_000
    assert '<link rel="icon" href="data:' in page_text  # some browsers ask for it, others do not
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", page_text.partition("<script")[0])
    assert Path(home.PLAYER, "modules", "plain.wasm").stat().st_size < 200_000


def test_each_reason_is_the_products(shown):
    mission, controller, starts = flights()
    names, kinds = list(REASONS), set()
    for index in (3, 70, 140):
        shown.evaluate(f"() => flightPage.flights.fly({index}, {index + 1}, {{ isLogged: true }})")
        log = fly_logged(mission, controller, starts[index])
        reasons = shown.evaluate(
            """() => Array.from({ length: flightPage.flown.numSamples - 1 }, (_, k) =>
                [0, 1, 2].map(axis => flightPage.flown.reason(k, axis)))"""
        )
        expected = [[names[code] for code in row] for row in log.reason.tolist()]
        assert reasons == expected, index
        kinds |= {name for row in expected for name in row}
    assert {"fired", "silent", "dead_band", "waiting", "coasting"} <= kinds


def test_nothing_is_said_that_was_not_decided_at_the_sample(opened, page_text):
    address = "#azimuth=-60&elevation=0&distance=75&sun=270&k=360"
    page = opened(page_text, reduced_motion="reduce")
    page.evaluate("address => { location.hash = address; }", address)
    expect(page.locator(".why")).to_have_text(
        "The flight ends here. Nothing is decided any more; the dashed path is free motion."
    )
    mission, *_ = flights()
    rows = mission.num_controls
    force = logged(page, "force", 3 * rows, np.float64).reshape(rows, 3)
    decided = logged(page, "isDecided", rows, np.uint8)
    (push, *_) = np.flatnonzero(np.any(force != 0.0, axis=1))
    stride = round(float(dict(load(FILE).attributes)["decision_period_s"]) / mission.control_period_s)
    assert push % stride == 0
    assert decided[push]
    said = [
        " ".join(row["text"] for row in page.evaluate("k => flightPage.flown.reasons(k)", int(k)))
        for k in (push, push + 1)
    ]
    minutes, seconds = divmod(push * mission.control_period_s, 60)
    assert said[0].startswith("Push ")
    assert said[1].startswith(f"At {minutes:.0f} min {seconds:02.0f} s: push ")
    assert page.evaluate("k => flightPage.flown.force(k)", int(push + 1)) == [0.0, 0.0, 0.0]


def test_edited_rules_are_compared_with_the_champion(opened, page_text):
    mission, controller, starts = flights()
    outcomes = fly_all(mission, controller, list(starts)[1:])
    share = 100 * np.mean(outcomes.is_success(mission.inspection_threshold_percent) & ~outcomes.is_violated)
    page = opened(page_text, reduced_motion="reduce")
    page.evaluate("() => { location.hash = 'rules=0-7-0'; }")
    page.wait_for_function("() => document.getElementById('many').textContent.includes('(was')")
    assert f"(was {share:.1f})" in page.locator("#many").inner_text()
    # the question's answer is about one rule, whatever else was changed
    edited = page.evaluate("() => flightPage.systems")
    page.get_by_role("button", name="The champion's own rules").click()
    for cell in ("#cell-1-0", "#cell-2-0"):
        page.locator(f"{cell} button").click()
    page.get_by_role("button", name="Most fail").click()
    page.get_by_text("One rule of 27 did that").wait_for()
    before = float(re.findall(r"([\d.]+) % succeeded", page.locator("#guess").inner_text())[0])
    page.evaluate(
        "() => { flightPage.systems[0].rules[7].then = flightPage.flights.table.systems[0].rules[7].then; }"
    )
    assert edited != page.evaluate("() => flightPage.systems")
    again = page.evaluate("async () => (await flightPage.flyAll()).success")
    assert again == pytest.approx(before, abs=0.05)


def test_shortcuts_stay_the_browsers_and_sliders_have_names(shown):
    for name in ("Direction in the orbit plane", "North or south of the plane", "Distance", "The Sun"):
        assert shown.get_by_role("slider", name=name, exact=True).count() == 1
    read = "() => [flightPage.view.angles, flightPage.view.zoom]"
    before = shown.evaluate(read)
    assert shown.locator(".handle").count() > 10
    assert shown.evaluate(SWALLOWED) == []
    assert shown.evaluate(read) == before


def test_a_drag_by_finger_does_not_scroll(opened, page_text):
    page = opened(page_text, 400, has_touch=True, is_mobile=True, reduced_motion="reduce")
    assert page.locator("canvas").evaluate("each => getComputedStyle(each).touchAction") == "pinch-zoom"


def test_a_picture_is_painted_once_a_changed_sample(opened, page_text):
    page = opened(page_text, reduced_motion="reduce")
    page.wait_for_function("() => document.getElementById('many').textContent.includes('succeed')")
    painted = page.evaluate(
        """async () => {
            const { view } = flightPage, paint = view.paint.bind(view), samples = [];
            view.paint = () => { samples.push(view.sample); paint(); };
            view.show(0);
            view.play();
            await new Promise(resolve => setTimeout(resolve, 2500));
            view.pause();
            return samples;
        }"""
    )
    assert len(painted) > 10
    assert len(painted) == len(set(painted))


def test_links_lead_somewhere_without_the_site():
    text = home.page(is_alone=True).partition("<script")[0]
    links = re.findall(r'href="(?!data:|#)([^"]+)"', text)
    assert len(links) > 10
    paths = {link: os.path.normpath(home.PROJECT / "build" / link) for link in links}
    assert [link for link, path in paths.items() if not os.path.isfile(path)] == []


def test_the_question_on_the_page_is_answered_by_a_proof(page_text):
    (matched,) = re.findall(r"bounds tipper\.fis --ask &quot;([^&]+)&quot;|--ask \"([^\"]+)\"", page_text)[:1]
    question = html.unescape("".join(matched))
    path = home.PROJECT / "docs" / "examples" / "tipper.fis"
    command = [sys.executable, "-m", "fis_tools", "bounds", path, "--ask", question]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603
    assert f"{question}: no, proved" in printed
