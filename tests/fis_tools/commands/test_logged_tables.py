"""Logged data as tables: each command reads their columns by the names of inputs."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray
from pyarrow import parquet

from fis_tools.__main__ import main
from fis_tools.analysis import tables
from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.commands import COMMANDS
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.findings.explanation import shares
from fis_tools.formats import serialize
from fis_tools.formats.serialize import load
from fis_tools.model import Formula, FuzzyController, Term
from fis_tools.words.text import sentence, shape_words
from tests.fis_tools.engines.weighed_systems import systems
from tests.places import PROJECT

TIPPER = PROJECT / "docs" / "examples" / "tipper.fis"
#: in the system's order, service and food
ROWS = np.array([[1.0, 9.0], [4.0, 8.0], [9.5, 2.0]])


def write(path: Path, rows: NDArray[np.float64]) -> Path:
    """Write columns in another order than the inputs', a time, and words that nobody asks for."""
    times = [10.0 * row for row in range(len(rows))]
    if path.suffix == ".parquet":
        columns = {"food": rows[:, 1], "guest": ["a, b"] * len(rows), "time_s": times, "service": rows[:, 0]}
        parquet.write_table(pa.table(columns), path)
        return path
    lines = [f'{food},"a, b",{time},{service}' for time, (service, food) in zip(times, rows, strict=True)]
    path.write_text("\ufefffood,guest,time_s, service\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def told(capsys: pytest.CaptureFixture[str], *words: object, status: int = 0) -> str:
    assert main([str(word) for word in words]) == status, capsys.readouterr().err
    captured = capsys.readouterr()
    return captured.out if status == 0 else captured.err


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_columns_go_by_their_names(ending, tmp_path):
    values, time_s = tables.read(write(tmp_path / f"evening.{ending}", ROWS), ["service", "food"])
    assert np.array_equal(values, ROWS)
    assert np.array_equal(time_s, [0.0, 10.0, 20.0])


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_column_may_name_its_unit_and_no_other(ending, tmp_path):
    path = tmp_path / f"heat.{ending}"
    if ending == "csv":
        path.write_text("temperature (°C)\n21.5\n", encoding="utf-8")
    else:
        parquet.write_table(pa.table({"temperature (°C)": [21.5]}), path)
    values, _ = tables.read(path, ["temperature"], {"temperature": "temperature (°C)"})
    assert np.array_equal(values, [[21.5]])
    with pytest.raises(ControllerFileError, match="it has no 'temperature'"):
        tables.read(path, ["temperature"], {"temperature": "temperature (K)"})


def test_every_command_that_takes_flights_takes_tables(tmp_path, capsys):
    logged = write(tmp_path / "evening.csv", ROWS)
    system = load(TIPPER).systems[0]
    strengths = np.array([infer(system, row).firing_strengths for row in ROWS])

    printed = told(capsys, "explain", TIPPER, "--data", logged, "--all")
    assert "tipper over 3 inferences: " in printed
    for rule, strength in enumerate(strengths.T, start=1):
        (line,) = (line for line in printed.splitlines() if f" {rule}. If" in line)
        assert f" {100 * np.mean(strength >= 0.05):.1f} % " in line
        assert f" {strength.max():.2f} " in line

    assert "3 logged inferences" in told(capsys, "audit", TIPPER, "--data", logged)
    expected = shares(system, ROWS)
    assert told(capsys, "explain", TIPPER, "--flights", logged) == expected.text()
    at_an_instant = told(capsys, "explain", TIPPER, "--flights", logged, "--time", "10")
    assert at_an_instant == told(capsys, "explain", TIPPER, "--inputs", "service=4,food=8")
    assert "along the logs" in " ".join(told(capsys, "simplify", TIPPER, "--flights", logged).split())
    doubled = (tmp_path / "other.fis", TIPPER.read_text(encoding="utf-8").replace("[1.5 0]", "[3 0]"))
    doubled[0].write_text(doubled[1], encoding="utf-8")
    assert "the flights, 3 inputs" in told(capsys, "diff", TIPPER, doubled[0], "--flights", logged)
    told(capsys, "plot", TIPPER, "--flights", logged, "--only", "firing", "-o", tmp_path)
    assert (tmp_path / "tipper-firing.png").stat().st_size > 10_000
    told(capsys, "surface", TIPPER, "--flights", logged, "-o", tmp_path / "surface.png")
    met = tmp_path / "domain.json"
    met.write_text(json.dumps(as_mapping([box_of(system, ROWS[:2])])), encoding="utf-8")
    assert main(["domain", str(met), str(logged)]) == 1
    assert "at 20 s: tipper senses food = 2, outside 8 to 9" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("food", "fod"), "by the names of inputs (service, food), and it has no 'food'; did you mean"),
        (("guest", "food"), "and it has two 'food'"),
        (("8.0,", "eight,"), "row 3: eight, a, b, 10.0, 4.0 does not hold a number"),
        (("8.0,", "nan,"), "food is nan in its sample 2, and missing or infinite in 1 of 3"),
        (("10.0,", "30.0,"), "time_s runs backwards"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(change, words, tmp_path, capsys):
    path = write(tmp_path / "evening.csv", ROWS)
    path.write_text(path.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    assert words in told(capsys, "audit", TIPPER, "--flights", path, status=2)


def test_a_table_without_times_goes_by_its_rows(tmp_path, capsys):
    path = tmp_path / "rows.csv"
    path.write_text("service,food\n1,9\n4,8\n", encoding="utf-8")
    by_row = told(capsys, "explain", TIPPER, "--flights", path, "--time", "2")
    assert by_row == told(capsys, "explain", TIPPER, "--inputs", "service=4,food=8")


NAMES = ("constant", "linear", "tsukamoto", "mixed")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("weighed")
    found = {}
    for name in NAMES:
        found[name] = folder / f"{name}.json"
        system = systems()[name]
        found[name].write_text(serialize.dump_json(FuzzyController(name, (system,))), encoding="utf-8")
    return found


def test_a_file_of_ours_holds_what_is_weighed(files):
    for name, path in files.items():
        assert serialize.load(path).systems == (systems()[name],)


@pytest.mark.parametrize("name", NAMES)
def test_what_needs_fuzzy_sets_says_so(name, files, tmp_path, capsys):
    assert main(["simplify", str(files[name]), "-o", str(tmp_path / "out.json")]) == 2
    assert (
        "is for Mamdani systems, whose rules conclude fuzzy sets, but output 'y'" in capsys.readouterr().err
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", NAMES)
def test_the_review_page_has_rules_and_formulas(name, files, tmp_path):
    assert main(["review", str(files[name]), "-o", str(tmp_path / "out.html")]) == 0
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    for rule in systems()[name].rules:
        assert sentence(rule) in text
    for term in systems()[name].outputs[0].terms:
        assert shape_words(term) in text


def test_the_audit_says_what_does_not_apply(files, capsys):
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


@pytest.mark.parametrize("form", ["c", "fmu", "fis"])
def test_forms_without_formulas_say_so(form, tmp_path, capsys):
    path = with_formula("sin(x0)", tmp_path)
    assert main(["export", path, "--format", form, "-o", str(tmp_path / f"sine.{form}")]) == 2
    assert "output 'y'" in capsys.readouterr().err


def test_where_a_formula_has_no_value_is_left_out(tmp_path, capsys):
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


TIPPING = PROJECT / "docs" / "examples" / "tipping.py"
PROGRAM = """\
from pathlib import Path
Path({mark!r}).touch()
import tipping
built = tipping.build_tipping()
fast = 1
def broken():
    raise RuntimeError("no luck")
"""


@pytest.fixture
def program(tmp_path):
    shutil.copy(TIPPING, tmp_path)
    path = tmp_path / "mine.py"
    path.write_text(PROGRAM.format(mark=str(tmp_path / "it-ran")), encoding="utf-8")
    return path


#: of each command what it needs besides a controller; `domain` and `learn` read none, `edit` does not end
NEEDED: dict[str, tuple[str, ...]] = {
    "export": ("--format", "markdown"),
    "explain": ("--inputs", "quality=6.5,service=9.8"),
    "diff": (str(PROJECT / "docs" / "examples" / "tipper.fis"),),
    "plot": ("--only", "rules"),
}


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in {"domain", "learn", "edit"}])
def test_every_command_takes_a_program_that_is_trusted(command, program, monkeypatch, capsys):
    monkeypatch.chdir(program.parent)
    words = [command, "mine.py:built", *NEEDED.get(command, ())]
    assert main(words) == 2
    assert (
        "reading it runs its code with all your rights; add --trust if you trust" in capsys.readouterr().err
    )
    assert not Path("it-ran").exists()
    assert main([*words, "--trust"]) == 0, capsys.readouterr().err
    assert Path("it-ran").exists()


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("mine.py:buitl", "mine.py has no object 'buitl'; did you mean 'built'?"),
        ("mine.py", "mine.py has no object ''"),
        ("none.py:built", "none.py:built: there is no such file"),
        ("mine.py:broken", "mine.py:broken cannot be run (RuntimeError: no luck)"),
        ("mine.py:fast", "mine.py:fast: "),
    ],
)
def test_what_cannot_be_read_is_told(written, words, program, monkeypatch, capsys):
    monkeypatch.chdir(program.parent)
    assert main(["show", written, "--trust"]) == 2
    assert f"error: {words}" in capsys.readouterr().err
