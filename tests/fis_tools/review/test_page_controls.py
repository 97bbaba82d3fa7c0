"""What one can do with the review page in a browser: sliders, rules, surfaces, time, keys."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from fis_tools.analysis import arrays
from fis_tools.engines.inference import infer
from fis_tools.words.text import sentence
from tests.browser import SWALLOWED
from tests.fis_tools.review.cases import (
    DRAWN,
    NUM_SAMPLES,
    at_share,
    number,
    number_after,
    path_of,
    pixels,
    state,
)
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, PAPER_LIKE

pytestmark = pytest.mark.slow
FOCUSABLE = "a[href], button, input, select, summary, [tabindex='0']"


def test_a_slider_and_a_number_field_move_the_number_to_what_python_infers(shown):
    result = shown.locator("#s1 .live.inference output")
    before = result.inner_text()
    shown.locator("#s1-x1-slider").focus()
    for _ in range(12):
        shown.keyboard.press("ArrowRight")
    shown.evaluate(DRAWN)
    assert result.inner_text() != before
    expected = infer(FORCE_X, state(shown)).values[0]
    assert number_after(result.inner_text(), "force_x") == pytest.approx(expected, rel=1e-4)
    field = shown.locator("#s1-x1")
    assert float(field.input_value()) == pytest.approx(state(shown)[0], rel=1e-5)
    field.fill("42.5")
    expect(shown.locator("#s1-x1-slider")).to_have_value("42.5")
    memberships = shown.locator("#s1 .belongs").first
    expect(memberships).to_contain_text("distance = 42.5 m")
    field.fill("500")
    expect(memberships).to_contain_text("distance = 500 m, taken as 200 m")
    expected = infer(FORCE_X, np.array([500.0, state(shown)[1]])).values[0]
    assert number_after(result.inner_text(), "force_x") == pytest.approx(expected, rel=1e-4)


def test_rules_sort_by_numbers_and_words(shown):
    heads = shown.locator("#s1-rules thead th")
    column = [head.strip() for head in heads.all_inner_texts()].index("share (%)")
    cells = f"document.querySelectorAll('#s1-rules tbody tr > :nth-child({column + 1})')"
    keys = f"[...{cells}].map((cell) => Number(cell.dataset.value))"
    button = heads.nth(column).locator("button")
    values = shown.evaluate(keys)
    assert values == sorted(values, reverse=True)
    assert len(set(values)) > 5
    assert heads.nth(column).get_attribute("aria-sort") == "descending"
    assert heads.nth(0).get_attribute("aria-sort") is None
    button.focus()
    shown.keyboard.press("Enter")
    assert shown.evaluate(keys) == sorted(values)
    heads.nth(1).locator("button").click()
    words = shown.locator("#s1-rules tbody tr td:nth-child(2)").all_inner_texts()
    assert words == sorted(words, key=str.lower)
    heads.nth(0).locator("button").click()
    assert shown.locator("#s1-rules tbody tr th").all_inner_texts() == [str(n) for n in range(1, 26)]


def test_rules_are_filtered_by_words(shown):
    shown.locator("#s1-filter").fill("very towards PS")
    rows = shown.locator("#s1-rules tbody tr:visible td:nth-child(2)").all_inner_texts()
    sentences = map(sentence, FORCE_X.rules)
    expected = [
        sentence
        for sentence in sentences
        if all(word in sentence.lower() for word in ("very", "towards", "ps"))
    ]
    assert sorted(rows) == sorted(expected)
    assert 0 < len(rows) < 25
    assert shown.locator("#s1-filter-status").inner_text() == f"{len(rows)} of 25 shown"
    shown.locator("#s1-filter").fill("")
    assert shown.locator("#s1-rules tbody tr:visible").count() == 25


def test_the_surface_turns_by_mouse_and_by_keys(shown):
    canvas = "#s1 canvas.solid"
    first = pixels(shown, canvas)
    shown.locator(canvas).focus()
    shown.keyboard.press("ArrowLeft")
    turned = pixels(shown, canvas)
    shown.keyboard.press("ArrowUp")
    raised = pixels(shown, canvas)
    box = shown.locator(canvas).bounding_box()
    shown.mouse.move(box["x"] + 200, box["y"] + 150)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 260, box["y"] + 130, steps=3)
    shown.mouse.up()
    dragged = pixels(shown, canvas)
    assert len({first, turned, raised, dragged}) == 4
    shown.mouse.move(box["x"] + 300, box["y"] + 100)
    assert pixels(shown, canvas) == dragged
    shown.keyboard.press("Home")
    assert pixels(shown, canvas) == first


def test_shortcuts_stay_the_browsers(shown):
    before = state(shown)
    assert shown.locator("canvas.solid").count()
    assert shown.evaluate(SWALLOWED) == []
    np.testing.assert_array_equal(state(shown), before)


def test_the_surface_is_that_of_python_and_follows_its_axes_and_held_inputs(shown):
    note = shown.locator("#s2 .live.surface > .note")
    first = pixels(shown, "#s2 canvas.map")
    eta = state(shown, 1)[0]
    shown.locator("#s2 .live.surface select").nth(0).select_option(label="distance (m)")
    swapped = pixels(shown, "#s2 canvas.map")
    shown.locator("#s2-held1").fill("1.5")
    held = pixels(shown, "#s2 canvas.map")
    assert len({first, swapped, held}) == 3
    assert eta != 1.5
    axes = ("distance", "velocity_body_z")
    surface = arrays.surface(FORCE_Z, *axes, fixed={"eta_u": 1.5}, num_points=49).values
    words = note.inner_text()
    assert "with eta_u = 1.5 rad" in words
    numbers = re.findall(r"(−?[\d.]+(?:e[−-]\d+)?) N", words)
    assert list(map(number, numbers)) == pytest.approx([surface.min(), surface.max()], rel=1e-3)
    # choosing what the other axis has exchanges the two
    shown.locator("#s2 .live.surface select").nth(1).select_option(label="distance (m)")
    chosen = shown.locator("#s2 .live.surface option:checked").all_text_contents()
    assert chosen == ["velocity_body_z (m/s)", "distance (m)"]


def test_the_time_along_the_flight_sets_the_inputs_of_every_system(shown):
    slider = shown.locator("#s1 .live.flight input[type=range]")
    slider.fill("70")
    for index, system in enumerate(PAPER_LIKE.systems):
        np.testing.assert_array_equal(state(shown, index), path_of(system, NUM_SAMPLES)[70])
        assert shown.locator(f"#s{index + 1} .live.flight output").inner_text() == "700 s"
    strip = shown.locator("#s2 canvas.strip")
    before = pixels(shown, "#s2 canvas.strip")
    box = strip.bounding_box()
    strip.click(position={"x": 65 + (box["width"] - 80) / 4, "y": 60})
    time = float(shown.locator("#s1 .live.flight output").inner_text().split()[0])
    assert time == pytest.approx(10 * NUM_SAMPLES / 4, abs=15)
    assert pixels(shown, "#s2 canvas.strip") != before


def test_tab_reaches_every_control_and_shows_where_it_is(fresh):
    wanted = fresh.evaluate(
        f"""[...document.querySelectorAll("{FOCUSABLE}")]
          .filter((one) => one.tabIndex === 0 && one.checkVisibility())
          .map((one, i) => (one.dataset.stop = i))"""
    )
    reached = set()
    script = (
        "[document.activeElement].map((one) => [one.dataset.stop, getComputedStyle(one).outlineStyle])[0]"
    )
    for _ in range(len(wanted) + 20):  # what scrolls is reached as well
        fresh.keyboard.press("Tab")
        stop, outline = fresh.evaluate(script)
        if stop is not None:
            reached.add(int(stop))
            assert outline != "none"
    assert len(wanted) > 50
    assert reached == set(wanted)


def test_pointing_tells_and_zooming_shows_a_part(fresh):
    canvas = fresh.locator("#s2 canvas.map")
    whole = pixels(fresh, "#s2 canvas.map")
    box = canvas.bounding_box()
    point = {"x": 58 + (box["width"] - 150) / 4, "y": 14 + (box["height"] - 58) / 2}
    canvas.hover(position=point)
    variable = FORCE_Z.inputs[0]
    quarter = at_share(variable, 0.25)
    text = fresh.locator(".tip").inner_text()
    assert number_after(text, variable.name) == pytest.approx(quarter, rel=0.02)
    canvas.click(position=point)
    fresh.evaluate(DRAWN)
    assert state(fresh, 1)[0] == pytest.approx(quarter, rel=0.02)
    shown_there = fresh.locator("#s2 .live.inference output").inner_text()
    expected = infer(FORCE_Z, state(fresh, 1)).values[0]
    assert number_after(text, "force_z") == pytest.approx(expected, rel=0.01)
    assert number_after(shown_there, "force_z") == pytest.approx(expected, rel=1e-4)
    marked = pixels(fresh, "#s2 canvas.map")
    zoom = fresh.get_by_role("group", name="Zoom of the surface of force_z")
    zoom.get_by_role("button", name="zoom in").click()
    near = pixels(fresh, "#s2 canvas.map")
    canvas.focus()
    fresh.keyboard.press("0")
    assert pixels(fresh, "#s2 canvas.map") == marked
    assert len({whole, marked, near}) == 3
    strip = fresh.locator("#s1 canvas.strip")
    strip.hover(position={"x": 300, "y": 40})
    assert re.match(r"\d+ s, force_x = ", fresh.locator(".tip").inner_text())
    before = pixels(fresh, "#s1 canvas.strip")
    strip.focus()
    fresh.keyboard.press("+")
    assert pixels(fresh, "#s1 canvas.strip") != before


def test_terms_zoom_and_mark_where_the_system_is(fresh):
    variable = FORCE_X.inputs[0]
    middle = at_share(variable, 0.5)
    fresh.evaluate(f"review.states[0].setInput(0, {middle})")
    fresh.evaluate(DRAWN)
    chart = fresh.locator("#s1 .pictures svg.chart").first

    def ends() -> tuple[list[float], float]:
        ticks = chart.locator("text.tick[text-anchor=middle]").all_text_contents()
        return list(map(number, ticks)), float(chart.locator("line.cursor").get_attribute("x1"))

    (first, *_, last), mark = ends()
    assert mark == pytest.approx((28 + 350) / 2)
    chart.focus()
    fresh.keyboard.press("+")
    (nearer, *_, farther), mark = ends()
    width = (variable.maximum - variable.minimum) / 4
    assert middle - width <= nearer
    assert farther <= middle + width
    assert farther - nearer < last - first
    assert mark == pytest.approx((28 + 350) / 2)
    fresh.evaluate(f"review.states[0].setInput(0, {middle + width / 2})")
    fresh.evaluate(DRAWN)
    assert ends()[1] == pytest.approx(28 + 0.75 * 322)
    zoom = fresh.get_by_role("group", name=f"Zoom of the terms of {variable.name}").first
    zoom.get_by_role("button", name="show all").click()
    assert ends()[0][0] == first


def test_pressing_on_membership_functions_sets_the_input(fresh):
    chart = fresh.locator("#s1 .live.inference svg.chart").first
    box = chart.bounding_box()
    chart.click(position={"x": box["width"] * (28 + 0.75 * 322) / 360, "y": box["height"] / 2})
    assert state(fresh)[0] == pytest.approx(at_share(FORCE_X.inputs[0], 0.75), rel=0.02)


def test_what_is_no_number_is_said_to_be_none_and_never_taken_for_another(fresh):
    field = fresh.locator("#s1-x1")
    alert = fresh.locator("#s1 .live.inference").get_by_role("alert").first
    for words in ("12,5", "abc", "", "1.5.2", "0x10", "1e999", "--"):
        field.fill("30")
        field.fill(words)
        expect(alert).to_contain_text("no number")
        expect(field).to_have_attribute("aria-invalid", "true")
        assert state(fresh)[0] == 30
        field.press("Tab")
        expect(field).to_have_value("30")
        expect(alert).to_be_hidden()


def test_what_is_typed_is_not_rewritten_while_it_is_typed(fresh):
    field = fresh.locator("#s1-x1")
    field.fill("1")
    for letter, taken in ((",", 1), ("Backspace", 1), (".", 1), ("5", 1.5), ("e", 1.5), ("1", 15)):
        field.press(letter)
        fresh.evaluate(DRAWN)
        assert state(fresh)[0] == taken
    assert field.input_value() == "1.5e1"


def test_a_link_leads_to_its_rule_though_it_is_filtered_away_and_not_beneath_the_head(fresh):
    fresh.locator("#s1-filter").fill("PL")
    row = fresh.locator("#s1-r13")
    expect(row).to_be_hidden()
    fresh.locator("#s1 .matrix a[href='#s1-r13']").click()
    expect(row).to_be_visible()
    assert fresh.locator("#s1-filter").input_value() == ""
    in_sight = """(row) => {
      const { left, top } = row.getBoundingClientRect();
      return row.contains(document.elementFromPoint(left + 5, top + 5));
    }"""
    assert row.evaluate(in_sight)


def test_rules_sorted_by_what_fires_now_stay_sorted(fresh):
    head = fresh.locator("#s1-rules thead th").last
    head.get_by_role("button").click()
    strengths = "[...document.querySelectorAll('#s1-rules td.now')].map((cell) => Number(cell.dataset.value))"
    before = fresh.evaluate(strengths)
    fresh.locator("#s1-x1").fill("190")
    fresh.wait_for_function(f"before => String({strengths}) !== before", arg=",".join(map(str, before)))
    assert fresh.evaluate(strengths) == sorted(fresh.evaluate(strengths), reverse=True)
    assert head.get_attribute("aria-sort") == "descending"
