"""The review page in a browser: what it shows, and what nobody can do to it."""

import hashlib
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import expect

from fis_tools.analysis import arrays
from fis_tools.analysis.flights import inputs_along
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import audit
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from fis_tools.review import carried
from fis_tools.words.text import sentence
from tests.browser import serious_violations
from tests.fis_tools.render.picture_systems import autopilot_system, one_input_system
from tests.fis_tools.review.cases import (
    CHAMPION,
    HOSTILE,
    NUM_SAMPLES,
    log_flight,
    number,
    path_of,
    pixels,
    state,
    written,
)
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL, PAPER_LIKE, ROOM, SHIPPED
from tests.fis_tools.step_by_step import firing_strengths
from tests.policies import Page, check_policy, check_references
from tests.programs import program

pytestmark = pytest.mark.slow


def test_tags_match_and_references_have_targets(text):
    check_references(re.sub(r"(?s)<script.*?</script>", "", text))
    markup = Page(text)
    assert {*markup.values("for"), *markup.values("data-table")} <= set(markup.values("id"))
    assert all(value.startswith("#") for value in markup.values("href"))
    assert markup.values("src") == markup.values("style") == []
    heads = [attributes for tag, attributes in markup.tags if tag == "th"]
    assert all(attributes.get("scope") for attributes in heads)
    check_policy(text)


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
        # by key: another test on this page may still scroll it
        table.get_by_role("button").last.press("Enter")
        assert infer(system, state(shown, index - 1)).values[0] == pytest.approx(high, abs=0.012 * 0.2)


def test_flights_of_one_name_are_told_apart(tmp_path):
    controller = FuzzyController("one", (FORCE_Z,))
    paths = [log_flight(tmp_path / folder / "best.mcap", controller, 3) for folder in ("a", "b")]
    text = written(controller, paths)
    assert "a/best (3 inferences), b/best (3 inferences)" in text
    assert "Reviewed along the flight best (3 inferences)." in written(controller, paths[:1])


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
    for words in ("R1", "failed", "not checked here", "For flights with Sun random, safety filter."):
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
