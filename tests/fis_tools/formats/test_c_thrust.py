"""The thrust logic in C: what it says of itself, what analysers say of it, and what it costs."""

import re
from pathlib import Path

import pytest

from fis_tools.formats.c import source
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller
from tests import night
from tests.fis_tools.formats.test_c import run_in
from tests.fis_tools.sample_controllers import GENERAL, SHIPPED
from tests.programs import program

pytestmark = pytest.mark.slow

#: inlined by -O2, the same paths take three times as long
ANALYSED = ("-O1", "-fanalyzer")


def shipped(name: str, **attributes: str) -> FuzzyController:
    fuzzy = read_controller(SHIPPED[name])
    together = dict(fuzzy.attributes) | attributes
    return FuzzyController(name, fuzzy.systems, tuple(sorted(together.items())), fuzzy.provenance)


EVERYTHING = shipped("paper_champion", decision_period_s="30", coast_below_points="2")
WRITTEN = {
    **{name: source.write(shipped(name)) for name in ("champion_any_sun", "ellipse", "paper_champion")},
    "decisions": source.write(shipped("ellipse", decision_period_s="30")),
    "decisions, body": source.write(EVERYTHING),
    "bare": source.write(shipped("ellipse"), bare=True),
    "general": source.write(GENERAL),
}
#: those whose code differs by more than its numbers and the length of its tables
APART = ("champion_any_sun", "decisions, body", "bare", "general")


@pytest.mark.parametrize("name", night.by_day(APART, 2))
def test_gccs_analyser_finds_nothing(name: str, tmp_path: Path) -> None:
    (tmp_path / "controller.c").write_text(WRITTEN[name], encoding="utf-8")
    warnings = [word for word in source.FLAGS.split() if word != "-Werror"]
    done = run_in(tmp_path, program("gcc", "gcc"), *warnings, *ANALYSED, "-Werror", "-c", "controller.c")
    assert (done.returncode, done.stderr) == (0, "")


def found_by_cppcheck(folder: Path, text: str) -> set[str]:
    """Return the names of what cppcheck finds, its addon for MISRA C:2012 among it."""
    (folder / "controller.c").write_text(text, encoding="utf-8")
    words = "--std=c99 --quiet --inconclusive --addon=misra --template={id} controller.c"
    checks = "--enable=warning,style,performance,portability"
    return set(run_in(folder, program("cppcheck", "cppcheck"), checks, *words.split()).stderr.split())


@pytest.mark.parametrize("name", night.by_day(APART[::-1], 2))
def test_cppcheck_finds_only_the_rules_of_misra_that_the_file_names(name: str, tmp_path: Path) -> None:
    named = set(re.findall(r"\((\d+\.\d+)\)", " ".join(WRITTEN[name].split("*/")[0].split(" * "))))
    assert named == {"8.9", "15.5"}
    assert found_by_cppcheck(tmp_path, WRITTEN[name]) <= {f"misra-c2012-{rule}" for rule in named}


def test_analysers_do_find_something(tmp_path: Path) -> None:
    """A slip of the pen in the same file, so that silence means something."""
    text = WRITTEN["ellipse"].replace("const bool is_complete", "const int is_complete")
    text = text.replace("double inputs_0[3];", "double inputs_0[2];")
    assert found_by_cppcheck(tmp_path, text) >= {"misra-c2012-14.4", "arrayIndexOutOfBounds"}
    reads_nothing = "double slip(int at);\ndouble slip(int at) { double *x = 0; return at ? 0.0 : *x; }\n"
    (tmp_path / "controller.c").write_text(WRITTEN["ellipse"] + reads_nothing, encoding="utf-8")
    done = run_in(tmp_path, program("gcc", "gcc"), *ANALYSED, "-c", "controller.c")
    assert "-Wanalyzer-null-dereference" in done.stderr


@pytest.mark.parametrize(
    ("name", "entries"),
    [
        *((name, {"start", "step"}) for name in ("champion_any_sun", "decisions", "decisions, body")),
        ("general", {"infer_room"}),
    ],
)
def test_nothing_is_allocated_called_again_or_kept(name: str, entries: set[str], tmp_path: Path) -> None:
    (tmp_path / "controller.c").write_text(WRITTEN[name], encoding="utf-8")
    assert run_in(tmp_path, program("gcc", "gcc"), "-std=c99", "-O2", "-c", "controller.c").returncode == 0
    listed = run_in(tmp_path, program("nm", "binutils"), "--format=posix", "controller.o").stdout
    symbols = [line.split()[:2] for line in listed.splitlines()]
    assert {kind for _, kind in symbols} <= {"T", "t", "r", "U"}  # no b, d: nothing that can change
    assert {word for word, kind in symbols if kind == "T"} == entries
    assert {word for word, kind in symbols if kind == "U"} <= {
        *(("sqrt", "fmax") if name == "general" else ("floor",)),
        *("__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"),
    }


def test_the_file_says_what_it_is() -> None:
    whole, bare = WRITTEN["champion_any_sun"], WRITTEN["bare"]
    assert "Fuzzy controller champion_any_sun with its thrust logic" in whole
    assert "BARE INFERENCE of fuzzy controller ellipse" in bare
    assert "This is not the controller" in bare
    assert "double bare_infer_force_x(const double inputs[3]);" in bare
    assert "step(" not in bare
    for text in (whole, bare):
        assert "no recursion, no allocation" in " ".join(text.replace(" * ", " ").split())
        assert max(map(len, text.splitlines())) <= 110
    assert "thrust" not in WRITTEN["general"]
    assert "double infer_" in WRITTEN["general"] or "void infer_" in WRITTEN["general"]


def test_an_attribute_that_is_no_number_is_told() -> None:
    with pytest.raises(ValueError, match="has decision_period_s 'often'; give a number from 0 on"):
        source.write(shipped("ellipse", decision_period_s="often"))
