"""C does to an array what Python does, bit for bit, or the translator refuses the function in a sentence."""

import itertools
import re
import shutil

import numpy as np
import pytest

from pipeline.onboard.allowed import ARITHMETIC, COMPARED, KINDS, NEGATIVE, STORED
from pipeline.onboard.expressions import OPERATORS
from tests.pipeline.onboard import constructs, drawn
from tests.pipeline.onboard.agreement import NUM_CELLS, compared, flies_alike, is_open

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written")
FUNCTIONS = [
    function
    for function in vars(constructs).values()
    if hasattr(function, "py_func")
    and function.__module__ == constructs.__name__
    and function.py_func.__code__.co_varnames[: function.py_func.__code__.co_argcount] == ("cells", "x")
]
#: an operand of each kind, that depends on the number x
OPERANDS = {"double": "(x + 0.25)", "int": "k", "bool": "(x > 0.5)"}
#: how operators are written
SYMBOLS = {
    **{"Add": "+", "Sub": "-", "Mult": "*", "Div": "/", "FloorDiv": "//", "Mod": "%"},
    **{"BitAnd": "&", "BitOr": "|", "BitXor": "^"},
}


@pytest.fixture(scope="module")
def agreement(tmp_path_factory):
    return compared(FUNCTIONS, tmp_path_factory.mktemp("constructs"), shutil.which("gcc"))


def test_each_construct_does_the_same_or_is_refused_as_its_docstring_says(agreement):
    assert agreement.different == {}
    assert agreement.without_result == []
    for function in FUNCTIONS:
        is_refused, _, reason = function.__doc__.partition(": ")
        if is_refused != "Refused":
            assert function.__name__ in agreement.same, agreement.refused.get(function.__name__)
        else:
            assert reason in agreement.refused[function.__name__]


def test_what_is_refused_is_told_with_its_line(agreement):
    for name, message in agreement.refused.items():
        file, line = re.match(r"(\S+\.py):(\d+): ", message).groups()
        code = getattr(constructs, name).py_func.__code__
        assert file == "tests/pipeline/onboard/constructs.py"
        assert code.co_firstlineno <= int(line) < code.co_firstlineno + 16


def _loaded(bodies, folder):
    """Functions of a number, each with a counter k from 1 to 3."""
    text = drawn.OPENING
    for name, body in bodies.items():
        text += (
            f"@compiled\ndef {name}(cells, x):\n    for k in range(1, 9):\n        cells[0] += {body}\n\n\n"
        )
    return drawn.load("signatures", text, list(bodies), folder)


def test_every_operation_of_the_tables_does_the_same_and_every_other_is_refused(tmp_path):
    bodies, allowed = {}, set()
    kinds = [kind for kind in KINDS if kind in OPERANDS]
    for node, (left, right) in itertools.product(OPERATORS, itertools.product(kinds, kinds)):
        symbol = SYMBOLS[node.__name__]
        name = f"{node.__name__}_{left}_{right}"
        bodies[name] = f"1.5 * ({OPERANDS[left]} {symbol} {OPERANDS[right]})"
        if symbol in "&|^":  # of conditions, a condition, which is no number
            bodies[name] = f"1.5 if {OPERANDS[left]} {symbol} {OPERANDS[right]} else 0.5"
        if (symbol, left, right) in ARITHMETIC or (symbol in "&|^" and left == right == "bool"):
            allowed.add(name)
    for left, right in itertools.product(kinds, kinds):
        name = f"Compared_{left}_{right}"
        bodies[name] = f"1.5 if {OPERANDS[left]} <= {OPERANDS[right]} else 0.5"
        if (left, right) in COMPARED:
            allowed.add(name)
    for kind in kinds:
        bodies[f"Negative_{kind}"] = f"1.5 * (-{OPERANDS[kind]})"
        if kind in NEGATIVE:
            allowed.add(f"Negative_{kind}")
    agreement = compared(_loaded(bodies, tmp_path), tmp_path, shutil.which("gcc"))
    assert agreement.different == {}
    assert set(agreement.same) == allowed
    assert set(agreement.refused) == bodies.keys() - allowed


def test_a_variable_takes_the_kinds_that_are_listed_for_its_own(tmp_path):
    kinds = [kind for kind in KINDS if kind in OPERANDS]
    text, names, allowed = drawn.OPENING, [], set()
    for target, value in itertools.product(kinds, kinds):
        name = f"{target}_{value}"
        names.append(name)
        shown = "1.5 if y else 0.5" if target == "bool" else "1.5 * y"
        text += (
            f"@compiled\ndef {name}(cells, x):\n    for k in range(0, 9):\n        y = {OPERANDS[target]}\n"
            f"        if x > 0.5:\n            y = {OPERANDS[value]}\n        cells[0] += {shown}\n\n\n"
        )
        if value in STORED[target]:
            allowed.add(name)
    agreement = compared(drawn.load("stored", text, names, tmp_path), tmp_path, shutil.which("gcc"))
    assert agreement.different == {}
    assert set(agreement.same) == allowed


@pytest.mark.parametrize("kind", drawn.CLASSES)
def test_random_functions_do_the_same_or_are_refused(kind, tmp_path):
    agreement = compared(drawn.functions(0, 8, kind, tmp_path), tmp_path, shutil.which("gcc"))
    assert agreement.different == {}
    assert len(agreement.same) + len(agreement.refused) + len(agreement.without_result) == 8


@pytest.mark.parametrize(("kind", "seed"), [("fill", 1_000_253), ("negative_condition", 1_000_197)])
def test_what_numpy_refuses_or_leaves_open_is_no_difference(kind, seed, tmp_path):
    """The maximum of two zeros, and the negative of a condition that NumPy made."""
    agreement = compared(drawn.functions(seed, 1, kind, tmp_path), tmp_path, shutil.which("gcc"))
    assert agreement.same == [f"{kind}_{seed}"], agreement


def test_what_numpy_leaves_open_is_held_against_what_flies():
    flown = np.arange(NUM_CELLS) * 0.5
    constructs.maximum_of_zeros(flown, 1.0)
    assert is_open(constructs.maximum_of_zeros)
    assert flies_alike(constructs.maximum_of_zeros, 1.0, flown)
    flown[6] = -flown[6]
    assert not flies_alike(constructs.maximum_of_zeros, 1.0, flown)


def test_most_plain_random_functions_are_translated(tmp_path):
    agreement = compared(drawn.functions(1, 24, "plain", tmp_path), tmp_path, shutil.which("gcc"))
    assert len(agreement.same) >= 12
