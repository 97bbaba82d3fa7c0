"""What a review page begins with: all of it from the controller, and from all flights of a run."""

import json
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from IPython.core.interactiveshell import InteractiveShell
from matplotlib.colors import to_hex

import fis_tools
from fis_tools import __main__ as command_line
from fis_tools.analysis import arrays
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain, shares
from fis_tools.findings.simplification import Budget, simplify
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from fis_tools.render.theme import BRIGHTNESS_MAP, contrast, luminance, readable_on
from fis_tools.review import content, flown, page
from fis_tools.review.content import BRIGHTNESS, level, level_styles
from fis_tools.review.flown import SensedInputs
from fis_tools.source import read_controller
from plain_files.document import Paragraph, Table
from tests.fis_tools.review.cases import path_of
from tests.fis_tools.sample_controllers import EXAMPLES, FORCE_Z, GENERAL, ROOM, SHIPPED, TIPPER
from tests.policies import Page, check_policy

CHAMPION = serialize.load(SHIPPED["champion_27"])


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_controller_says_what_it_is_for_and_what_its_inputs_mean(name: str) -> None:
    controller = serialize.load(SHIPPED[name])
    assert content.lead(controller).startswith(controller.purpose)
    assert len(controller.purpose) > 60
    for variable in (variable for system in controller.systems for variable in system.inputs):
        assert len(variable.description) > 10
        assert not variable.description.startswith(("the same", "that "))
    assert serialize.reads(serialize.dump_yaml(controller), "yaml").controller == controller


def test_a_file_without_a_purpose_is_read_and_says_that_it_has_none() -> None:
    text = serialize.dump_json(replace(CHAMPION, purpose=""))
    assert "purpose" not in text
    old = serialize.reads(text, "json").controller
    assert old.purpose == ""
    assert "No purpose is stated" in content.lead(old)


def test_tables_have_the_places_of_terms_and_what_the_system_answers_there() -> None:
    tables = [block for block in content.rules(CHAMPION) if isinstance(block, Table)]
    assert len(tables) == 3
    across = tables[2]
    assert across.heads[1:] == ["negative, −0.095 m/s", "zero, 0 m/s", "positive, 0.095 m/s"]
    answer = infer(CHAMPION.systems[2], np.array([-0.033, 0.0])).values[0]
    assert list(across.rows[0]) == ["negative, −0.033 m/s", "zero: 0 N", *[f"negative: −{-answer:.4g} N"] * 2]
    large = serialize.load(SHIPPED["champion_any_sun"])
    words = [block.words for block in content.rules(large) if isinstance(block, Paragraph)]
    assert any("more than one table" in text for text in words)


def test_inputs_beyond_their_range_are_told() -> None:
    system = CHAMPION.systems[2]
    met = np.array([[0.1, 0.0], [0.0, 0.05], [0.01, -0.01], [0.0, 0.0]])
    controller = replace(CHAMPION, systems=(system,))
    first, second = content.inputs(controller, {system.name: SensedInputs(met, "here", are_flown=True)}).rows
    assert first[3] == "0 m/s to 0.1 m/s; 25 % beyond its range, clipped to it"
    assert second[3] == "−0.01 m/s to 0.05 m/s"


def test_failures_are_counted_over_all_flights_of_the_run_of_a_recording(tmp_path: Path) -> None:
    for name in ("episodes", "evaluate"):
        (tmp_path / name).mkdir()
    share = {"count": 1, "fraction": 0.25, "low": 0.0456, "high": 0.6994}
    summary = {"num_cases": 4, "success": {**share, "count": 3, "fraction": 0.75}, "violated": share}
    mean = {"mean": 1.0, "standard_deviation": 0.1}
    summary |= {"delta_v_m_s": mean, "inspection_rate_percent": mean}
    (tmp_path / "evaluate" / "summary.json").write_text(json.dumps(summary))
    columns = {
        "case": [0, 1, 2, 3],
        "success": [True, False, True, True],
        "violated": [False, False, True, False],
        "inspection_rate_percent": [99.0, 71.0, 97.0, 99.0],
    }
    pq.write_table(pa.table(columns), tmp_path / "evaluate" / "episodes.parquet")
    evaluations = flown.evaluations([tmp_path / "episodes" / "best.mcap", tmp_path], "")
    assert len(evaluations) == 1
    sentence = flown.failures(evaluations[0])
    assert "1 of 4: 25.0 %" in sentence
    assert sentence.endswith("The worst: case 1 (71.0 %), case 2 (97.0 %, outside).")
    assert flown.evaluations([tmp_path / "elsewhere" / "episodes" / "best.mcap"], "") == []


@pytest.mark.parametrize("controller", ['"x"', "[" * 100_000], ids=["a word", "too deep"])
def test_a_file_that_is_no_evidence_is_said(tmp_path: Path, controller: str) -> None:
    path = tmp_path / "evidence.json"
    path.write_text(f'{{"schema": "evidence", "requirements": [], "controller": {controller}}}')
    with pytest.raises(ControllerFileError, match="is no evidence that can be read"):
        content.read_evidence(path, "0")


@pytest.fixture(scope="module")
def iris(tmp_path_factory) -> FuzzyController:
    learned = tmp_path_factory.mktemp("learned") / "iris.json"
    table = EXAMPLES / "iris.csv"
    assert command_line.main(["learn", str(table), "--target", "species", "-o", str(learned)]) == 0
    return serialize.load(learned)


def test_a_learned_system_has_a_page_with_its_data_errors_and_formulas(iris) -> None:
    provenance = dict(iris.provenance)
    assert provenance["learned_from"] == "iris.csv, 150 rows"
    assert "of 150 rows that they did not learn from; always setosa: 33.3%" in provenance["held_out"]
    text = page.write(iris)
    check_policy(text)
    assert "<script" not in text
    for words in (*provenance.values(), "virginica is 0.98", "Terms, and what rules conclude"):
        assert words in text
    assert text.count('src="data:image/png;base64,') == 3
    assert text.count("☐") == len(page.CHECKS)
    assert f"SHA-256 {serialize.fingerprint(iris)}, which is that of what" in text


def test_what_flips_the_class_of_a_classifier_is_found_by_walking(iris) -> None:
    (system,) = iris.systems
    start = {"petal_length": 4.8, "petal_width": 1.6}
    explained = explain(system, start)
    walked = {}
    for column, variable in enumerate(system.inputs):
        values = np.linspace(variable.minimum, variable.maximum, 4001)
        rows = np.tile([start[variable.name] for variable in system.inputs], (4001, 1))
        rows[:, column] = values
        classes = arrays.evaluate(system, rows).argmax(axis=1)
        here = int(np.argmin(np.abs(values - start[variable.name])))
        for way in (1, -1):
            indices = range(here, len(values) if way > 0 else -1, way)
            index = next((n for n in indices if classes[n] != classes[here]), None)
            if index is not None:
                walked[variable.name, system.outputs[classes[index]].name] = values[index]
    assert {(flip.input.name, flip.other.name) for flip in explained.class_flips} == set(walked)
    for flip in explained.class_flips:
        step = (flip.input.maximum - flip.input.minimum) / 4000
        assert flip.first == pytest.approx(walked[flip.input.name, flip.other.name], abs=1.01 * step)
    words = explained.text()
    assert "Class: versicolor. What would flip it" in words
    assert "negative" not in words
    assert words.count("  the default, as no rule fires: ") == 2  # where both columns are of other flowers
    silent = explain(system, {"petal_length": 1.0, "petal_width": 2.5}).text()
    assert "Class: the default" in silent


def test_the_colours_are_those_of_pictures():
    colours = mpl.colormaps[BRIGHTNESS_MAP](np.linspace(0.0, 1.0, len(BRIGHTNESS)))
    assert tuple(map(to_hex, colours)) == BRIGHTNESS


def test_brighter_is_greater():
    assert np.all(np.diff([luminance(colour) for colour in BRIGHTNESS]) > 0)
    for count in (1, 2, 5, 7):
        levels = [level(index, count) for index in range(count)]
        assert levels == sorted(set(levels))
        assert 0 <= levels[0] <= levels[-1] < len(BRIGHTNESS)
    steps = np.diff([luminance(BRIGHTNESS[level(index, 5)]) for index in range(5)])
    assert np.all(steps > 0.02)


def test_words_stand_out_from_every_level():
    pairs = re.findall(r"background: (#\w{6}); color: (#\w{6})", level_styles())
    assert [ground for ground, _ in pairs] == list(BRIGHTNESS)
    assert min(contrast(ground, ink) for ground, ink in pairs) >= 4.5
    for ground, ink in pairs:
        assert ink == to_hex(readable_on(ground))


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_words_and_lines_stand_out_from_the_page(theme):
    style = (files("fis_tools.review") / "style.css").read_text(encoding="utf-8")
    matches = re.findall(r"--([\w-]+): light-dark\((#\w{6}), (#\w{6})\)", style)
    colours = {name: pair[theme] for name, *pair in matches}
    words = ("ink", "muted", "accent", "serious", "warning", *(f"term-{index}" for index in range(7)))
    for name in words:
        for ground in ("paper", "panel"):
            assert contrast(colours[name], colours[ground]) >= 4.5, (name, ground)
    assert contrast(colours["mark"], colours["paper"]) >= 3.0


OF_SPACE = (
    r"\b(spac\w+|orbit\w*|satellites?|chief|deputy|fl(y|ies|ying|ew|own|ights?)|sun|sunlit|camera|thrust\w*"
    r"|delta-v|inspect\w*|episodes?|coast\w*|mission|hill|forces? (was|were))\b"
)


@pytest.mark.slow
@pytest.mark.parametrize("has_log", [False, True])
def test_a_page_has_no_word_of_space(opened, tmp_path: Path, has_log: bool) -> None:
    controller = read_controller(TIPPER)
    log = tmp_path / "evening.csv"
    rows = path_of(controller.systems[0], 30)
    np.savetxt(log, rows, delimiter=",", header="service,food", comments="")
    text = page.write(controller, [log] if has_log else [])
    markup = Page(text)
    texts = [words for tag, words in markup.texts if tag not in {"script", "style"}]
    labels = [words for name in ("aria-label", "title", "placeholder") for words in markup.values(name)]
    shown = opened(text.replace('<details class="part">', '<details class="part" open>'))
    drawn = shown.evaluate(
        "[document.body.textContent.replace(document.getElementById('carried').textContent, ''),"
        " ...[...document.querySelectorAll('[aria-label]')].map((one) => one.ariaLabel)].join(' ')"
    )
    script = next(words for tag, words in markup.texts if tag == "script" and '"use strict"' in words)
    everything = " ".join([*texts, *labels, drawn.replace(script, "")])
    assert ("along the log" in everything) == has_log
    assert ("Selected logs are" in everything) == has_log
    assert "What happens between decisions" not in everything  # nothing was simulated
    assert re.findall(OF_SPACE, everything, re.IGNORECASE) == []
    if has_log:
        assert "row 1" in shown.locator(".live.flight").first.inner_text()


def test_a_notebook_shows_fuzzy_nouns_as_tables_and_pictures() -> None:
    shell = InteractiveShell()
    shell.display_formatter.active_types = ["text/plain", "text/html", "image/svg+xml"]
    fis_tools.show_in(shell)
    variable = FORCE_Z.inputs[0]
    things = (GENERAL, ROOM, variable, 1)
    shown = [shell.display_formatter.format(thing)[0] for thing in things]
    assert f"<h1>{GENERAL.name}</h1>" in shown[0]["text/html"]
    assert shown[0]["text/html"].count("<h2>") == len(GENERAL.systems)
    assert "<table" in shown[1]["text/html"]
    assert shown[2]["image/svg+xml"].lstrip().startswith("<?xml")
    assert all(term.name in shown[2]["image/svg+xml"] for term in variable.terms)
    assert shown[3] == {"text/plain": "1"}


@pytest.mark.slow
def test_results_show_themselves_in_words_where_there_is_no_notebook() -> None:
    inputs = [0.5 * (variable.minimum + variable.maximum) for variable in FORCE_Z.inputs]
    controller = FuzzyController("one", (FORCE_Z,))
    results = [
        audit(controller),
        difference(controller, controller),
        explain(FORCE_Z, inputs),
        shares(FORCE_Z, np.array([inputs])),
        simplify(controller, {FORCE_Z.name: np.array([inputs])}, Budget(flights_only=True)),
    ]
    for result in results:
        words = repr(result)
        assert not words.startswith(type(result).__name__ + "(")
        assert "Gaussian(" not in words
        assert len(words) < 5000
