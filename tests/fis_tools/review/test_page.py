"""The review page in a browser: what it shows, what one can do with it, and what nobody can do to it."""

import hashlib
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from fis_tools.analysis import arrays
from fis_tools.analysis.flights import inputs_along
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import audit
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, Variable
from fis_tools.review import carried, page
from fis_tools.words.text import sentence
from tests.browser import opening, serious_violations
from tests.fis_tools.render.picture_systems import autopilot_system, one_input_system
from tests.fis_tools.review.cases import HOSTILE, hostile_controller, log_flight, path_of
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, PAPER_LIKE, ROOM, SHIPPED
from tests.fis_tools.step_by_step import firing_strengths
from tests.policies import Page, check_policy, check_references
from tests.programs import program

pytestmark = pytest.mark.slow

NUM_SAMPLES = 120
CHAMPION = serialize.load(SHIPPED["champion_any_sun"])
FOCUSABLE = "a[href], button, input, select, summary, [tabindex='0']"


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights")
    return log_flight(folder / "swing.mcap", PAPER_LIKE, NUM_SAMPLES)


def written(*arguments, **options) -> str:
    """The page with all that it folds opened, as one who clicks would have it."""
    folded = page.write(*arguments, **options)
    return re.sub(r"<details( class=.part.)?>", r"<details\1 open>", folded)


@pytest.fixture(scope="module")
def text(flight):
    return written(PAPER_LIKE, [flight])


@pytest.fixture(scope="module")
def hostile_text():
    return written(hostile_controller())


@pytest.fixture(scope="module")
def champion_text(tmp_path_factory):
    folder = tmp_path_factory.mktemp("champion")
    return written(CHAMPION, [log_flight(folder / f"{name}.mcap", CHAMPION, 60) for name in "abc"])


@pytest.fixture(scope="module")
def shown(browser, tmp_path_factory, text):
    """A page that tests use one after the other, leaving it usable."""
    with opening(browser, tmp_path_factory.mktemp("shown")) as open_page:
        yield open_page(text)


@pytest.fixture
def fresh(opened, text):
    """A page that nobody has touched."""
    return opened(text)


def number(words: str) -> float:
    return float(words.replace("−", "-"))


def number_after(words: str, name: str) -> float:
    match = re.search(rf"{name} = ([−\d.e+-]+)", words)
    assert match, words
    return number(match[1])


def at_share(variable: Variable, share: float) -> float:
    return variable.minimum + share * (variable.maximum - variable.minimum)


def state(shown, index: int = 0) -> np.ndarray:
    """The inputs of a system as the page holds them."""
    return np.array(shown.evaluate(f"review.states[{index}].inputs"))


DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def pixels(shown, selector: str) -> str:
    """What is drawn on a canvas, once it has been drawn."""
    shown.locator(selector).scroll_into_view_if_needed()
    for _ in range(3):
        shown.evaluate(DRAWN)
    content = shown.locator(selector).evaluate("(canvas) => canvas.toDataURL()")
    return hashlib.sha256(content.encode()).hexdigest()


def test_tags_match_and_references_have_targets(text):
    check_references(re.sub(r"(?s)<script.*?</script>", "", text))
    markup = Page(text)
    assert {*markup.values("for"), *markup.values("data-table")} <= set(markup.values("id"))
    assert all(value.startswith("#") for value in markup.values("href"))
    assert markup.values("src") == markup.values("style") == []
    heads = [attributes for tag, attributes in markup.tags if tag == "th"]
    assert all(attributes.get("scope") for attributes in heads)
    check_policy(text)


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


def test_findings_are_those_of_the_audit_and_lead_to_what_they_are_about(shown, flight):
    findings = audit(PAPER_LIKE, inputs_along([flight])).findings
    rows = shown.locator("#findings-table tbody tr")
    text = rows.all_inner_texts()
    assert len(text) == len(findings) > 3
    for finding, row in zip(findings, text, strict=True):
        words = " ".join(row.split())
        assert words.startswith(f"{finding.severity.word} {finding.system} {finding.sentence} {finding.cure}")
    about_rules = next(finding for finding in findings if finding.rules)
    row = rows.nth(findings.index(about_rules))
    row.get_by_role("link", name=f"rule {about_rules.rules[0]}", exact=True).click()
    target = shown.evaluate("document.querySelector(':target td').textContent")
    system = next(system for system in PAPER_LIKE.systems if system.name == about_rules.system)
    assert target == sentence(system.rules[about_rules.rules[0] - 1])


def test_a_finding_shows_where_it_is_seen(opened):
    controller = serialize.load(SHIPPED["paper_champion"])
    shown = opened(written(controller))
    button = shown.locator("button.show-point").first
    index = int(button.get_attribute("data-system")) - 1
    point = json.loads(button.get_attribute("data-point"))
    button.click()
    names = [variable.name for variable in controller.systems[index].inputs]
    assert dict(zip(names, state(shown, index), strict=True)).items() >= point.items()


def test_proved_ranges_hold_all_outputs_and_the_extremes_are_attained(shown):
    for index, system in enumerate(PAPER_LIKE.systems, start=1):
        outputs = arrays.evaluate(system, arrays.spread_inputs(system))
        table = shown.locator(f"#s{index} table", has_text="proved by interval arithmetic")
        name, _, proved, *_ = table.locator("tbody tr").locator("th, td").all_inner_texts()
        low, high = (number(word.split()[0]) for word in proved.split(" to "))
        assert name == system.outputs[0].name
        assert low - 1e-4 <= outputs.min() < outputs.max() <= high + 1e-4
        table.get_by_role("button").last.click()
        assert infer(system, state(shown, index - 1)).values[0] == pytest.approx(high, abs=0.012 * 0.2)


def test_flights_of_one_name_are_told_apart(tmp_path):
    controller = FuzzyController("one", (FORCE_Z,))
    paths = [log_flight(tmp_path / folder / "best.mcap", controller, 3) for folder in ("a", "b")]
    text = written(controller, paths)
    assert "a/best (3 inferences), b/best (3 inferences)" in text
    assert "Reviewed along the flight best (3 inferences)." in written(controller, paths[:1])


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


def test_the_theme_follows_the_system_and_the_switch(opened, text):
    ground = "getComputedStyle(document.body).backgroundColor"
    dark, light = (opened(text, color_scheme=scheme) for scheme in ("dark", "light"))
    assert dark.evaluate(ground) != light.evaluate(ground) == "rgb(255, 255, 255)"
    drawn = pixels(dark, "#s1 canvas.map")
    dark.locator("#theme").select_option("light")
    assert dark.evaluate(ground) == light.evaluate(ground)
    assert pixels(dark, "#s1 canvas.map") != drawn


def test_nothing_is_wider_than_a_narrow_screen(opened, text, hostile_text):
    for content in (text, hostile_text):
        assert opened(content, width=390).evaluate("document.documentElement.scrollWidth") <= 390


def printed_by(name: str, *arguments: str) -> str:
    command = [program(name, "poppler-utils"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603


def test_it_prints_every_rule_and_no_control_where_all_is_asked_for(opened, text, tmp_path):
    shown = opened(text, color_scheme="dark")
    # what is filtered on the screen is printed all the same
    shown.locator("#s1-filter").fill("nothing has these words")
    path = tmp_path / "review.pdf"
    shown.pdf(path=path, format="A4")
    printed = " ".join(printed_by("pdftotext", "-raw", str(path), "-").split())
    for system in PAPER_LIKE.systems:
        for rule in system.rules:
            assert sentence(rule) in printed
    for finding in audit(PAPER_LIKE).findings:
        assert " ".join(finding.sentence.split()) in printed
    # terms in numbers are folded on the screen
    assert "Gaussian, mean 50, standard deviation 25" in printed
    assert "Signature" in printed
    assert printed.count("no. rule share (%)") > 2, "heads are repeated on every page of a table"
    for control in ("Theme", "Show rules with", "Show findings with", "Along x"):
        assert control in shown.locator("body").inner_text()
        assert control not in printed
    # the heat maps are drawn although they were never in sight, and the screen is dark again
    listed = printed_by("pdfimages", "-list", str(path))
    assert len(re.findall(r"^\s*\d+\s+\d+\s+image", listed, re.MULTILINE)) == 2
    assert shown.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"


def test_the_summary_prints_on_two_pages_with_what_is_decided(opened, champion_text, tmp_path):
    shown = opened(champion_text)
    row = shown.locator("tr.finding", has=shown.locator(".severity", has_text="warning")).first
    row.get_by_role("combobox").select_option("waived")
    row.get_by_role("textbox").fill("the thrusters are larger than this")
    note = shown.locator("tr.severity-note").first
    note.get_by_role("combobox").select_option("accepted")
    shown.locator("[name=name]").fill("Ada Lovelace")
    shown.get_by_label("Every constant has the value").check()
    shown.evaluate("document.documentElement.toggleAttribute('data-summary')")
    path = tmp_path / "summary.pdf"
    shown.pdf(path=path, format="A4")
    assert re.search(r"^Pages:\s+2$", printed_by("pdfinfo", str(path)), re.MULTILINE)
    printed = " ".join(printed_by("pdftotext", "-raw", str(path), "-").split())
    assert "waived: the thrusters are larger than this" in printed
    assert "Notes without a decision, not printed: " in printed
    assert "Ada Lovelace" in printed
    assert "☑ Every constant has the value" in printed
    assert "☐ The terms mean" in printed
    assert serialize.fingerprint(CHAMPION) in printed
    assert "dead_band_force_x_n" in printed
    assert sentence(CHAMPION.systems[0].rules[0]) not in printed


def signed(shown):
    """What the page saves, as a file and as data."""
    with shown.expect_download() as download:
        shown.get_by_role("button", name="Save as JSON").click()
    return json.loads(Path(download.value.path()).read_text(encoding="utf-8"))


def test_a_review_is_saved_and_loaded_again_for_the_same_controller_alone(opened, text, tmp_path):
    shown = opened(text, accept_downloads=True)
    status = shown.locator("#signature-status")
    expect(status).to_contain_text("5 checks not ticked, no decision, no name, no date.")
    row = shown.locator("tr.finding").first
    row.get_by_role("combobox").select_option("waived")
    expect(status).to_contain_text("1 finding waived without a reason")
    row.get_by_role("textbox").fill('"quoted" <b>reason</b>')
    expect(status).not_to_contain_text("without a reason")
    for box in shown.locator("#signature input[type=checkbox]").all():
        box.check()
    shown.locator("[name=decision]").select_option("approved with remarks")
    shown.locator("[name=name]").fill("Ada Lovelace")
    shown.locator("[name=date]").fill("2026-11-20")
    shown.locator("[name=remarks]").fill("look again")
    saved = signed(shown)
    assert saved["controller"] == {"name": PAPER_LIKE.name, "sha256": serialize.fingerprint(PAPER_LIKE)}
    facts = {"name": "Ada Lovelace", "date": "2026-11-20", "decision": "approved with remarks"}
    assert facts.items() <= saved.items()
    assert all(saved["checks"].values())
    assert len(saved["findings"]) == shown.locator("tr.finding").count()
    assert saved["findings"][0]["reason"] == '"quoted" <b>reason</b>'
    assert len({entry["finding"] for entry in saved["findings"]}) == len(saved["findings"])

    path = tmp_path / "saved.json"
    path.write_text(json.dumps(saved))
    again = opened(text, accept_downloads=True)
    again.locator("#load").set_input_files(path)
    expect(again.locator("#signature-status")).to_contain_text("Loaded.")
    assert signed(again) == saved

    other = opened(written(GENERAL))
    other.locator("#load").set_input_files(path)
    expect(other.locator("#signature-status")).to_contain_text("another controller")
    assert other.locator("[name=name]").input_value() == ""
    path.write_text("{")
    other.locator("#load").set_input_files(path)
    expect(other.locator("#signature-status")).to_contain_text("not JSON")


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


def test_time_inputs_and_output_are_on_one_screen(opened, champion_text):
    shown = opened(champion_text)
    shown.locator("#s1-inference").evaluate("(heading) => heading.scrollIntoView()")
    section = shown.locator("#s1")
    parts = ".live.flight input[type=range], .live.inference input[type=range], .live.inference output"
    for part in section.locator(parts).all():
        box = part.bounding_box()
        assert 0 <= box["y"] < box["y"] + box["height"] <= 900


def test_how_it_flew_requirements_and_constants_are_told(opened, tmp_path):
    run = tmp_path / "run"
    log_flight(run / "episodes" / "best.mcap", CHAMPION, 5)
    (run / "evaluate").mkdir()
    mean = {"mean": 0.5, "standard_deviation": 0.25}
    share = {"count": 57, "fraction": 0.95, "low": 0.863, "high": 0.983}
    inside = {"count": 56, "fraction": 0.933, "low": 0.841, "high": 0.974}
    shares = {"success": share, "success_and_within_limits": inside}
    summary = {"num_cases": 60, "delta_v_m_s": mean, "inspection_rate_percent": mean, **shares}
    summary |= {"confidence_percent": 90.0, "controller_sha256": serialize.fingerprint(CHAMPION)}
    (run / "evaluate" / "summary.json").write_text(json.dumps(summary))
    required = {"id": "R1", "text": "Stay outside.", "verified_by": ["test"], "why": "4 of 9 left"}
    evidence = {
        "schema": "evidence",
        "controller": {"name": CHAMPION.name, "sha256": serialize.fingerprint(CHAMPION)},
        "conditions": {"sun": "random", "safety": "filter"},
        "requirements": [required | {"verdict": "failed"}],
    }
    path = tmp_path / "evidence.json"
    path.write_text(json.dumps(evidence))
    shown = opened(written(CHAMPION, [run], evidence=path))
    logged, requirements = (shown.locator(part).inner_text() for part in ("#logged", "#requirements"))
    assert "56 of 60: 93.3 % (84.1 to 97.4)" in logged
    assert "57 of 60" not in logged
    assert "90 % confidence intervals of shares in brackets" in logged
    assert "3 of 60: 5.0 % (1.7 to 13.7) inspect too little" in logged
    for words in ("R1", "failed", "For flights with Sun random, safety filter."):
        assert words in requirements
    assert "255.2" in shown.locator("#constants tr", has_text="urgency_time_s").inner_text()
    order = shown.evaluate("[...document.querySelectorAll('main > section')].map(({ id }) => id)")
    assert order[:7] == [*("requirements", "does", "logged", "uncovered", "findings", "constants", "systems")]
    path.write_text(json.dumps(evidence | {"controller": {"name": "other", "sha256": "0"}}))
    with pytest.raises(ControllerFileError, match="about the controller 'other'"):
        written(CHAMPION, evidence=path)
    lazy = replace(
        CHAMPION, attributes=tuple({**dict(CHAMPION.attributes), "coast_below_points": "90"}.items())
    )
    text = opened(written(lazy, [run])).locator("main").inner_text()
    for words in (
        "flown by another controller",
        "Over all 60 flights of the evaluation of another controller, which tells nothing of this one",
        "all 60 of the evaluation of another controller",
        "How often it fails: the evaluation is of another controller.",
    ):
        assert words in text
    (run / "evaluate" / "summary.json").write_text("{")
    with pytest.raises(ControllerFileError, match=r"summary\.json: "):
        written(CHAMPION, [run])


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_axe_finds_nothing_serious(opened, text, axe, width, scheme):
    shown = opened(text, width=width, color_scheme=scheme)
    assert serious_violations(shown, axe) == []


def test_hostile_names_are_only_text(opened, hostile_text):
    assert len(Page(hostile_text).all("script")) == 2
    shown = opened(hostile_text)
    assert shown.evaluate("typeof window.pwned") == "undefined"
    assert shown.locator("h1").inner_text() == HOSTILE[0]
    assert shown.locator("img, svg[onload], iframe").count() == 0
    for name in HOSTILE:
        assert name in shown.locator("#s1 .rules").inner_text()
        assert shown.locator("svg text.name", has_text=name).count() > 0


def test_scripts_that_are_not_of_the_page_do_not_run(browser, text, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(text, encoding="utf-8")
    inject = """() => {
      const script = document.createElement("script");
      script.textContent = "window.pwned = 1";
      document.body.append(script);
      document.body.insertAdjacentHTML("beforeend", "<img src='x' onerror='window.pwned = 2'>");
    }"""
    with browser.new_page(offline=True) as shown:
        shown.goto(path.as_uri())
        shown.evaluate(inject)
        shown.wait_for_timeout(50)
        assert shown.evaluate("typeof window.pwned") == "undefined"


def test_all_kinds_of_systems_are_shown(opened):
    shown = opened(written(FuzzyController("kinds", (ROOM, one_input_system()))))
    shown.locator("#s1 .live.inference select").select_option(label="vent")
    expect(shown.locator("#s1 .live.inference output")).to_contain_text("vent = ")
    assert pixels(shown, "#s2 canvas.response") != pixels(shown, "#s1 canvas.map")
    assert shown.locator("#s1 .matrix").count() == 0
    assert shown.locator("#s2 .matrix td").count() == 5


def test_words_and_rules_are_there_without_scripts(opened, text):
    shown = opened(text, java_script_enabled=False)
    assert sentence(FORCE_Z.rules[44]) in shown.locator("#s2-rules").inner_text()


def test_three_systems_of_125_rules_along_long_flights_stay_small(opened, tmp_path):
    names = ("first", "second", "third")
    controller = FuzzyController("large", tuple(replace(autopilot_system(), name=name) for name in names))
    flights = [log_flight(tmp_path / f"{name}.mcap", controller, 200) for name in names[:2]]
    text = written(controller, flights * 4)
    assert len(text.encode()) < 3_000_000
    shown = opened(text)
    assert shown.locator("#s3-rules tbody tr").count() == 125
    assert pixels(shown, "#s3 canvas.strip")
    shown.locator("#s3 .live.flight select").first.select_option(index=1)
    assert shown.locator("#s1 .live.flight select").first.input_value() == "1"


def test_the_command_refuses_a_flight_of_another_controller(flight, tmp_path, saved, run, refused):
    path = tmp_path / "pages" / "review.html"
    run("review", flight, "-o", path)
    assert "swing" in path.read_text(encoding="utf-8")
    message = refused("review", saved(GENERAL), "--flights", flight, "-o", path)
    assert "was flown without any of the systems room" in message
    refused("review", "nowhere.yaml")


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


def test_heads_are_called_as_they_read(shown):
    rules = shown.locator("#s1-rules")
    for name in ("no.", "rule", "share (%)", "needed (%)", "now"):
        head = rules.get_by_role("columnheader", name=name, exact=True)
        assert head.get_by_role("button", name=f"Sort by {name}", exact=True).count() == 1


def test_what_never_fires_is_counted_over_all_of_a_long_flight(opened, flight, monkeypatch):
    monkeypatch.setattr(carried, "MOST_SAMPLES", 5)
    shown = opened(written(PAPER_LIKE, [flight]))
    strengths = firing_strengths(FORCE_X, path_of(FORCE_X, NUM_SAMPLES))
    silent = int((strengths.max(axis=0) < 0.05).sum())
    assert silent < int((strengths[carried.kept_rows(NUM_SAMPLES, 5)].max(axis=0) < 0.05).sum())
    note = shown.locator("#s1 .live.flight .note")
    expect(note).to_contain_text(f"{silent} of 25 rules never fire at 0.05 or more on this flight.")
    expect(note).to_contain_text(f"Of its {NUM_SAMPLES} inferences 5 are shown.")


def test_a_flight_by_another_controller_is_said_to_be_one(flight, text):
    first, *others = PAPER_LIKE.systems
    changed = replace(PAPER_LIKE, systems=(replace(first, rules=first.rules[:-1]), *others))
    words = f"swing ({NUM_SAMPLES} inferences; flown by another controller). Where another controller flew"
    assert words in written(changed, [flight])
    assert "flown by another controller" not in text


def test_a_flight_given_twice_counts_once(flight, text):
    twice = [flight, flight.parent / ".." / flight.parent.name / flight.name]
    assert written(PAPER_LIKE, twice) == text


def test_the_signature_under_a_part_is_for_what_is_exported_of_it(tmp_path, paper, run):
    output, part = tmp_path / "review.html", ("--system", "force_z")
    run("review", paper, *part, "-o", output)
    text = output.read_text(encoding="utf-8")
    exported = run("export", paper, *part, "--format", "json").out
    assert hashlib.sha256(exported.encode()).hexdigest() in text
    assert "<strong>force_z</strong> alone" in text
    assert "export CONTROLLER --system force_z --format json" in text
