"""Logged data as tables: each command reads their columns by the names of inputs."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from fis_tools.analysis import tables
from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.array_types import Floats
from fis_tools.commands import COMMANDS
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation import shares
from fis_tools.formats.serialize import load
from fis_tools.model import Formula, FuzzyController, Term
from fis_tools.words.text import sentence, shape_words
from tests.fis_tools.engines.weighed_systems import SYSTEMS
from tests.fis_tools.sample_controllers import EXAMPLES, TIPPER, with_output

#: in the system's order, service and food
ROWS = np.array([[1.0, 9.0], [4.0, 8.0], [9.5, 2.0]])


def write(path: Path, rows: Floats) -> Path:
    """Write columns in another order than the inputs', a time, and words that nobody asks for."""
    times = [10.0 * row for row in range(len(rows))]
    if path.suffix == ".parquet":
        columns = {"food": rows[:, 1], "guest": ["a, b"] * len(rows), "time_s": times, "service": rows[:, 0]}
        parquet.write_table(pa.table(columns), path)
        return path
    lines = [f'{food},"a, b",{time},{service}' for time, (service, food) in zip(times, rows, strict=True)]
    path.write_text("\ufefffood,guest,time_s, service\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_columns_go_by_their_names(ending, tmp_path):
    values, time_s = tables.read(write(tmp_path / f"evening.{ending}", ROWS), ["service", "food"])
    assert np.array_equal(values, ROWS)
    assert np.array_equal(time_s, [0.0, 10.0, 20.0])


def test_every_command_that_takes_flights_takes_tables(tmp_path, run):
    logged = write(tmp_path / "evening.csv", ROWS)
    system = load(TIPPER).systems[0]
    strengths = np.array([infer(system, row).firing_strengths for row in ROWS])

    printed = run("explain", TIPPER, "--data", logged, "--all").out
    assert "tipper over 3 inferences: " in printed
    for rule, strength in enumerate(strengths.T, start=1):
        (line,) = (line for line in printed.splitlines() if f" {rule}. If" in line)
        assert f" {100 * np.mean(strength >= 0.05):.1f} % " in line
        assert f" {strength.max():.2f} " in line

    assert "3 logged inferences" in run("audit", TIPPER, "--data", logged).out
    expected = shares(system, ROWS)
    assert run("explain", TIPPER, "--flights", logged).out == expected.text()
    at_an_instant = run("explain", TIPPER, "--flights", logged, "--time", "10").out
    assert at_an_instant == run("explain", TIPPER, "--inputs", "service=4,food=8").out
    assert "along the logs" in " ".join(run("simplify", TIPPER, "--flights", logged).out.split())
    doubled = tmp_path / "other.fis"
    doubled.write_text(TIPPER.read_text(encoding="utf-8").replace("[1.5 0]", "[3 0]"), encoding="utf-8")
    assert "the flights, 3 inputs" in run("diff", TIPPER, doubled, "--flights", logged).out
    run("plot", TIPPER, "--flights", logged, "--only", "firing", "-o", tmp_path)
    assert (tmp_path / "tipper-firing.png").stat().st_size > 10_000
    run("surface", TIPPER, "--flights", logged, "-o", tmp_path / "surface.png")
    met = tmp_path / "domain.json"
    met.write_text(json.dumps(as_mapping([box_of(system, ROWS[:2])])), encoding="utf-8")
    assert "at 20 s: tipper senses food = 2, outside 8 to 9" in run("domain", met, logged, code=1).out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("food", "fod"), "by the names of inputs (service, food), and it has no 'food'; did you mean"),
        (("guest", "food"), "and it has 'food' and 'food' for 'food'; leave out one"),
        (("8.0,", "eight,"), "row 3: eight, a, b, 10.0, 4.0 does not hold a number"),
        (("8.0,", "nan,"), "food is nan in its sample 2, and missing or infinite in 1 of 3"),
        (("10.0,", "30.0,"), "time_s runs backwards"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(change, words, tmp_path, refused):
    path = write(tmp_path / "evening.csv", ROWS)
    path.write_text(path.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    assert words in refused("audit", TIPPER, "--flights", path)


def test_a_table_without_times_goes_by_its_rows(tmp_path, run):
    path = tmp_path / "rows.csv"
    path.write_text("service,food\n1,9\n4,8\n", encoding="utf-8")
    by_row = run("explain", TIPPER, "--flights", path, "--time", "2").out
    assert by_row == run("explain", TIPPER, "--inputs", "service=4,food=8").out


@pytest.mark.parametrize("name", ["constant", "linear", "tsukamoto", "mixed"])
def test_what_is_weighed_is_reviewed_and_what_needs_fuzzy_sets_says_so(name, saved, tmp_path, run, refused):
    system = SYSTEMS[name]
    weighed = saved(FuzzyController(name, (system,)))
    assert load(weighed).systems == (system,)
    sentence_of_all = "is for Mamdani systems, whose rules conclude fuzzy sets, but output 'y'"
    assert sentence_of_all in refused("simplify", weighed, "-o", tmp_path / "out.json")
    assert not (tmp_path / "out.json").exists()
    run("review", weighed, "-o", tmp_path / "out.html")
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    for words in (*map(sentence, system.rules), *map(shape_words, system.outputs[0].terms)):
        assert words in text
    audited = " ".join(run("audit", weighed).out.split())  # as wide as the terminal is
    assert "y is a weighted average" in audited
    assert "y_0 and y_1" not in audited


def with_formula(text: str) -> FuzzyController:
    system = SYSTEMS["constant"]
    terms = (Term("y_0", Formula(text)), *system.outputs[0].terms[1:])
    return FuzzyController("formula", (with_output(system, terms=terms),))


@pytest.mark.parametrize("form", ["c", "fmu", "fis"])
def test_forms_without_formulas_say_so(form, tmp_path, saved, refused):
    path = saved(with_formula("sin(x0)"))
    assert "output 'y'" in refused("export", path, "--format", form, "-o", tmp_path / f"sine.{form}")


def test_where_a_formula_has_no_value_is_left_out(tmp_path, saved, run, refused):
    """The logarithm of what is below zero has none, and that of zero is infinite."""
    before = saved(with_formula("log(x0 - 5)"), "before.yaml")
    after = saved(with_formula("log(x0 - 5) + 1"), "after.yaml")
    complaint = refused("explain", before, "--inputs", "x0=4,x1=5")
    assert "y is nan there" in complaint
    difference = run("diff", before, after).out
    assert re.search(r"y_0 +log\(x0 - 5\) → log\(x0 - 5\) \+ 1", difference)
    assert re.search(r"\n +y +the ranges, \d+ inputs +0\.", difference)
    assert "nan" not in difference
    run("plot", before, "-o", tmp_path, "--only", "surfaces")


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
    shutil.copy(EXAMPLES / "tipping.py", tmp_path)
    path = tmp_path / "mine.py"
    path.write_text(PROGRAM.format(mark=str(tmp_path / "it-ran")), encoding="utf-8")
    return path


#: of each command what it needs besides a controller; `domain` and `learn` read none, `edit` does not end
NEEDED: dict[str, tuple[str, ...]] = {
    "export": ("--format", "markdown"),
    "explain": ("--inputs", "quality=6.5,service=9.8"),
    "diff": (str(TIPPER),),
    "plot": ("--only", "rules"),
}


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in {"domain", "learn", "edit"}])
def test_every_command_takes_a_program_that_is_trusted(command, program, monkeypatch, run, refused):
    monkeypatch.chdir(program.parent)
    words = [command, "mine.py:built", *NEEDED.get(command, ())]
    assert "runs its code with all your rights; add --trust if you trust" in refused(*words)
    assert not Path("it-ran").exists()
    run(*words, "--trust")
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
def test_what_cannot_be_read_is_told(written, words, program, monkeypatch, refused):
    monkeypatch.chdir(program.parent)
    assert f"error: {words}" in refused("show", written, "--trust")
