"""What the translator cannot translate it refuses, with file and line; what it translates comes in order."""

import ctypes
import re
import subprocess

import numpy as np
import pytest

from fis_tools.compiled.decorator import compiled, plainly
from pipeline.onboard.arrays import Array, Begun
from pipeline.onboard.operations import OPERATIONS
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression, TranslationError, range_of
from pipeline.onboard.writer import Setting
from tests.programs import program


@compiled
def power(x):
    return x**2.0


@compiled
def listed(x):
    return [y + 1.0 for y in (1.0, x)]


@compiled
def attempted(x):
    try:
        return x + 1.0
    finally:
        pass


@compiled
def waiting(x):
    while x > 1.0:
        x = x - 1.0
    return x


@compiled
def looped(x):
    total = 0.0
    for _ in range(int(x)):
        total += x
    return total


@compiled
def left_from_a_loop(x):
    for i in range(9):
        if x > i:
            return 1.0
    return x


@compiled
def printed(x):
    print(x)  # noqa: T201 - it is refused
    return x


@compiled
def half_way(x):
    return np.zeros(3)[x / 2.0]


@compiled
def whole(x):
    count = 0
    if x > 0.0:
        count = x
    return count


@compiled
def half_bound(x):
    if x > 0.0:
        y = x
    return y


REFUSED = {
    function.__name__: function for function in list(globals().values()) if hasattr(function, "py_func")
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_translation_is_refused_with_its_line(name):
    function = REFUSED[name]
    first = function.py_func.__code__.co_firstlineno
    with pytest.raises(TranslationError) as refusal:
        Translator(Setting(OPERATIONS)).write("entry", function, {"x": Expression("x", is_name=True)})
    file, line = re.match(r"(\S+\.py):(\d+): ", str(refusal.value)).groups()
    assert file == "tests/pipeline/onboard/test_translator.py"
    assert first <= int(line) < first + 8


def test_a_truth_that_is_not_known_is_never_taken():
    with pytest.raises(TranslationError, match="not known"):
        bool(Expression("x", "bool"))


@compiled
def add(cells, x):
    cells[0] = cells[0] + x
    return cells[0]


@compiled
def ordered(cells, x):
    if x > 0.0 and add(cells, x) > 1.0:
        cells[1] = 1.0
    if x < 0.0 or add(cells, 1.0) > 2.0:
        cells[2] = 1.0
    cells[3] = add(cells, 3.0) if x > 1.0 else 2.0 * add(cells, 5.0)
    cells[4] = cells[0] - add(cells, x)
    pair = (cells[0], add(cells, x))
    cells[5] = pair[0]
    cells[6] = 1.0 if cells[0] < add(cells, 7.0) else 0.0
    cells[0] += add(cells, x)


def test_what_changes_an_array_is_called_when_python_calls_it(tmp_path):
    translator, count = Translator(Setting(OPERATIONS)), 7
    cells = Array("state->cells", (count,))
    translator.write("entry", ordered, {"cells": cells, "x": Expression("x", is_name=True)})
    functions = [
        f"{each.signature} {{\n{chr(10).join(line.text for line in each.lines)}\n}}\n"
        for each in translator.functions
    ]
    opening = f"#include <stdbool.h>\nstruct controller {{ double cells[{count}]; }};\n"
    (tmp_path / "entry.c").write_text(opening + "".join(functions))
    words = ["-std=c99", "-shared", "-fPIC", "-o", tmp_path / "entry.so", tmp_path / "entry.c"]
    subprocess.run([program("gcc", "gcc"), *words], check=True)  # noqa: S603
    entry = ctypes.CDLL(str(tmp_path / "entry.so")).entry
    for x in (-1.0, 0.0, 0.5, 1.5):
        by_c, by_python = (ctypes.c_double * count)(), np.zeros(count)
        entry(by_c, ctypes.c_double(x))
        with plainly("tests"):
            ordered(by_python, x)
        assert list(by_c) == by_python.tolist()


@pytest.mark.parametrize(("latest", "is_limited"), [(1, False), (2, True)])
def test_no_row_beyond_a_table_is_read_wherever_its_rows_in_use_begin(latest, is_limited):
    row, begins = (
        Expression(name, "int", True, (0, most)) for name, most in (("row", 3), ("begins", latest))
    )
    part = Begun("table", (5, 2), data=np.zeros((5, 2)), count=4, begins=begins).at((row, 1))
    assert range_of(part.indices[0]) == (0, 4)
    assert ("at_most(" in part.indices[0].text) == is_limited


@compiled
def quadrupled(k):
    return 4 * k


@compiled
def called_twice(cells, i, j):
    cells[0] = float(quadrupled(i)) + float(quadrupled(j))


@pytest.mark.parametrize(("span", "joint"), [((5, 9), (0, 9)), (None, None)])
def test_a_function_that_is_called_twice_stands_for_the_ranges_of_both_and_keeps_what_is_to_be_shown(
    span, joint
):
    translator = Translator(Setting(OPERATIONS, is_proved_apart=True))
    first, second = (Expression(name, "int", True, each) for name, each in (("i", (0, 3)), ("j", span)))
    translator.write("entry", called_twice, {"cells": Array("state->cells", (1,)), "i": first, "j": second})
    kept, entry = translator.functions
    assert (kept.name, entry.name) == ("quadrupled", "entry")
    assert kept.parameters == {"k": ("int", joint)}
    assert sum(line.text.count("quadrupled(") for line in entry.lines) == 2
    assert {each.function for each in translator.obligations} == ({"quadrupled"} if span is None else set())
