"""Every command takes outputs that are weighed, or says in a sentence that it does not."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from fis_tools.__main__ import main
from fis_tools.formats import serialize
from fis_tools.model import Formula, FuzzyController, Term
from fis_tools.words.text import sentence, shape_words
from tests.fis_tools.engines.weighed_systems import systems

NAMES = ("constant", "linear", "tsukamoto", "mixed")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("weighed")
    found = {}
    for name in NAMES:
        found[name] = folder / f"{name}.json"
        system = systems()[name]
        found[name].write_text(serialize.dump_json(FuzzyController(name, (system,))), encoding="utf-8")
    return found


def test_a_file_of_ours_holds_what_is_weighed(files: dict[str, Path]) -> None:
    for name, path in files.items():
        assert serialize.load(path).systems == (systems()[name],)


@pytest.mark.parametrize("name", NAMES)
def test_what_needs_fuzzy_sets_says_so(
    name: str, files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simplify", str(files[name]), "-o", str(tmp_path / "out.json")]) == 2
    assert (
        "is for Mamdani systems, whose rules conclude fuzzy sets, but output 'y'" in capsys.readouterr().err
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", NAMES)
def test_the_review_page_has_rules_and_formulas(name: str, files: dict[str, Path], tmp_path: Path) -> None:
    assert main(["review", str(files[name]), "-o", str(tmp_path / "out.html")]) == 0
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    for rule in systems()[name].rules:
        assert sentence(rule) in text
    for term in systems()[name].outputs[0].terms:
        assert shape_words(term) in text


def test_the_audit_says_what_does_not_apply(
    files: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    for name in NAMES:
        assert main(["audit", str(files[name])]) == 0
        told = " ".join(capsys.readouterr().out.split())  # as wide as the terminal is
        assert "y is a weighted average: how its terms cover the range, overlap and are ordered" in told
        assert "y_0 and y_1" not in told


def with_formula(text: str, folder: Path) -> str:
    system = systems()["constant"]
    (y,) = system.outputs
    changed = replace(y, terms=(Term("y_0", Formula(text)), *y.terms[1:]))
    path = folder / f"{len(text)}.json"
    controller = FuzzyController("formula", (replace(system, outputs=(changed,)),))
    path.write_text(serialize.dump_json(controller), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("form", ["c", "fmu", "fis", "fml"])
def test_forms_without_formulas_say_so(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = with_formula("sin(x0)", tmp_path)
    assert main(["export", path, "--format", form, "-o", str(tmp_path / f"sine.{form}")]) == 2
    assert "output 'y'" in capsys.readouterr().err


def test_where_a_formula_has_no_value_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The logarithm of what is below zero has none, and that of zero is infinite."""
    before, after = with_formula("log(x0 - 5)", tmp_path), with_formula("log(x0 - 5) + 1", tmp_path)
    assert main(["explain", before, "--inputs", "x0=4,x1=5"]) == 2
    assert "y is nan there: a formula that a rule concludes has no value" in capsys.readouterr().err
    assert main(["diff", before, after]) == 0
    told = capsys.readouterr().out
    assert re.search(r"y_0 +log\(x0 - 5\) → log\(x0 - 5\) \+ 1", told)
    assert re.search(r"\n +y +the ranges, \d+ inputs +0\.", told)
    assert "nan" not in told
    assert main(["plot", before, "-o", str(tmp_path), "--only", "surfaces"]) == 0


def test_formats_without_the_words_refuse(files: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(files["mixed"]), "--format", "fml"]) == 2
    assert "is weighed, and an FML file has such outputs where all" in capsys.readouterr().err
    assert main(["export", str(files["constant"]), "--format", "fml"]) == 0
    assert "<tskValue>-1.5</tskValue>" in capsys.readouterr().out
    assert main(["export", str(files["constant"]), "--format", "fcl"]) == 0
    told = capsys.readouterr().out
    assert "TERM y_0 := -1.5;" in told
    assert "METHOD : COGS;" in told
