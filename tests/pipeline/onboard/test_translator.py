"""What the translator cannot translate it refuses, with file and line."""

import re

import pytest

from fis_tools.compiled.decorator import compiled
from pipeline.onboard.operations import OPERATIONS
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression, TranslationError
from pipeline.onboard.writer import Setting


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
