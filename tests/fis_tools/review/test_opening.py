"""What a review page begins with: all of it from the controller, and from all flights of a run."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fis_tools import __main__ as command_line
from fis_tools.analysis import arrays
from fis_tools.document import Paragraph, Table
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation import explain
from fis_tools.formats import serialize
from fis_tools.review import flown, opening, page
from fis_tools.review.flown import Samples
from tests.places import PROJECT
from tests.policies import check_policy

SHIPPED = sorted(
    path
    for path in (PROJECT / "conf" / "controller").glob("*.yaml")
    if "schema: fuzzy-controller" in path.read_text(encoding="utf-8")
)
CHAMPION = serialize.load(PROJECT / "conf" / "controller" / "champion_27.yaml")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_controller_says_what_it_is_for_and_what_its_inputs_mean(path: Path) -> None:
    controller = serialize.load(path)
    assert opening.lead(controller).startswith(controller.purpose)
    assert len(controller.purpose) > 60
    for variable in (one for system in controller.systems for one in system.inputs):
        assert len(variable.description) > 10
        assert not variable.description.startswith(("the same", "that "))
    assert serialize.reads(serialize.dump_yaml(controller), "yaml").controller == controller


def test_a_file_without_a_purpose_is_read_and_says_that_it_has_none() -> None:
    text = serialize.dump_json(replace(CHAMPION, purpose=""))
    assert "purpose" not in text
    old = serialize.reads(text, "json").controller
    assert old.purpose == ""
    assert "nobody has written" in opening.lead(old)


def test_tables_have_the_places_of_terms_and_what_the_system_answers_there() -> None:
    tables = [block for block in opening.rules(CHAMPION) if isinstance(block, Table)]
    assert len(tables) == 3
    across = tables[2]
    assert across.heads[1:] == ["negative, −0.095 m/s", "zero, 0 m/s", "positive, 0.095 m/s"]
    answer = infer(CHAMPION.systems[2], np.array([-0.033, 0.0])).values[0]
    assert list(across.rows[0]) == ["negative, −0.033 m/s", "zero: 0 N", *[f"negative: −{-answer:.4g} N"] * 2]
    large = serialize.load(PROJECT / "conf" / "controller" / "champion_any_sun.yaml")
    assert any(
        "more than one table" in one.words for one in opening.rules(large) if isinstance(one, Paragraph)
    )


def test_inputs_beyond_their_range_are_told() -> None:
    system = CHAMPION.systems[2]
    met = np.array([[0.1, 0.0], [0.0, 0.05], [0.01, -0.01], [0.0, 0.0]])
    one = replace(CHAMPION, systems=(system,))
    first, second = opening.inputs(one, {system.name: Samples(met, "here", are_flown=True)}).rows
    assert first[3] == "0 m/s to 0.1 m/s; 25 % beyond its range, and taken as its end"
    assert second[3] == "−0.01 m/s to 0.05 m/s"


def test_failures_are_counted_over_all_flights_of_the_run_of_a_recording(tmp_path: Path) -> None:
    for name in ("episodes", "evaluate"):
        (tmp_path / name).mkdir()
    share = {"count": 1, "fraction": 0.25, "low": 0.0456, "high": 0.6994}
    summary = {"num_cases": 4, "success": {**share, "count": 3, "fraction": 0.75}, "violated": share}
    (tmp_path / "evaluate" / "summary.json").write_text(json.dumps(summary))
    columns = {
        "case": [0, 1, 2, 3],
        "success": [True, False, True, True],
        "violated": [False, False, True, False],
        "inspection_rate_percent": [99.0, 71.0, 97.0, 99.0],
    }
    pq.write_table(pa.table(columns), tmp_path / "evaluate" / "episodes.parquet")
    found = flown.evaluations([tmp_path / "episodes" / "best.mcap", tmp_path])
    assert len(found) == 1
    told = flown.failures(found[0])
    assert "1 of 4: 25.0 %" in told
    assert told.endswith("The worst: case 1 (71.0 %), case 2 (97.0 %, outside).")
    assert flown.evaluations([tmp_path / "elsewhere" / "episodes" / "best.mcap"]) == []


def test_a_learned_system_has_a_page_with_its_data_errors_and_formulas(tmp_path: Path) -> None:
    learned = tmp_path / "iris.json"
    table = PROJECT / "docs" / "examples" / "iris.csv"
    assert command_line.main(["learn", str(table), "--target", "species", "-o", str(learned)]) == 0
    controller = serialize.load(learned)
    told = dict(controller.provenance)
    assert told["learned_from"] == "iris.csv, 150 rows"
    assert "of 150 rows that they did not learn from; always setosa: 33.3%" in told["held_out"]
    text = page.write(controller)
    check_policy(text)
    assert "<script" not in text
    for words in (*told.values(), "virginica is 0.98", "Terms, and what rules conclude"):
        assert words in text
    assert text.count('src="data:image/png;base64,') == 3


def test_what_flips_the_class_of_a_classifier_is_found_by_walking(tmp_path: Path) -> None:
    learned = tmp_path / "iris.json"
    table = PROJECT / "docs" / "examples" / "iris.csv"
    command_line.main(["learn", str(table), "--target", "species", "-o", str(learned)])
    system = serialize.load(learned).systems[0]
    start = {"petal_length": 4.8, "petal_width": 1.6}
    found = explain(system, start)
    walked = {}
    for variable in system.inputs:
        values = np.linspace(variable.minimum, variable.maximum, 4001)
        rows = np.array(
            [[({**start, variable.name: value})[v.name] for v in system.inputs] for value in values]
        )
        classes = arrays.evaluate(system, rows).argmax(axis=1)
        here = int(np.argmin(np.abs(values - start[variable.name])))
        for way in (1, -1):
            places = range(here, len(values) if way > 0 else -1, way)
            place = next((n for n in places if classes[n] != classes[here]), None)
            if place is not None:
                walked[variable.name, system.outputs[classes[place]].name] = values[place]
    assert {(flip.input.name, flip.other.name) for flip in found.class_flips} == set(walked)
    for flip in found.class_flips:
        step = (flip.input.maximum - flip.input.minimum) / 4000
        assert flip.first == pytest.approx(walked[flip.input.name, flip.other.name], abs=1.01 * step)
    words = found.text()
    assert "Class: versicolor. What would flip it" in words
    assert "negative" not in words
