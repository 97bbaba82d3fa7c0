"""Fingerprints change with all that code is compiled from, however it is imported, and with nothing else."""

import importlib
import itertools
import os
import sys
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.compiled.decorator import compiled, is_compiling
from fis_tools.compiled.fingerprint import UnknownPartError, fingerprint, functions_of
from pipeline.flight.fly import many
from pipeline.flight.period.act import attitude, safety
from pipeline.physics import quaternion
from tests.places import PROJECT
from tests.programs import run_python

pytest.importorskip("numba")
from numba import float64, int64, njit, typeof

pytestmark = pytest.mark.skipif(not is_compiling(), reason="they are of code that is compiled")

#: Ways to come by what `low` of a package defines: lines at the top, and the words by which it is called.
WAYS = {
    "from {p}.low import f": "f",
    "from {p}.low import (\n    f,  # laws (see there)\n)": "f",
    "from {p}.low import (  # laws (see there)\n    f\n)": "f",
    "from {p} import low; import math": "low.f",
    "from {p} import low as other": "other.f",
    "from {p}.low import f as \\\n    g": "g",
    "from . import low": "low.f",
    "from .low import f": "f",
    "from .low import *": "f",
    "from {p} import *": "low.f",
    "import {p}.low": "{p}.low.f",
    "import os, {p}.low as l": "l.f",
    "import {p}": "{p}.low.f",  # set by whoever imported the module
    "try:\n    from {p} import low\nexcept ImportError:\n    low = None": "low.f",
    "try:\n    import nowhere\nexcept ImportError:\n    from {p}.low import f": "f",
    "from typing import TYPE_CHECKING\nif not TYPE_CHECKING:\n    from {p}.low import f": "f",
    "if True:\n\tfrom {p}.low import f": "f",
    "def late():\n    from {p}.low import f\n    return f\nf = late()": "f",
    "def late():\n    global f\n    from {p}.low import f\nlate()": "f",
    "class Holder:\n    from {p}.low import f\nf = Holder.f": "f",
    "import importlib\nlow = importlib.import_module('{p}.low')": "low.f",
    "import importlib\nf = importlib.import_module('.low', __package__).f": "f",
    "low = __import__('{p}.low', fromlist=['f'])": "low.f",
    "import sys, {p}.low\nf = sys.modules['{p}.low'].f": "f",
    "exec('from {p}.low import f')": "f",
    "from {p}.between import f": "f",
    "from {p} import between": "between.low.f",
    "from {p}.low import f as g\nf = (g,)[0]": "f",
}
HEAD = "from fis_tools.compiled.decorator import compiled\n"
LOW = HEAD + "STEP = {step}\n\n@compiled\ndef f(x):\n    return {body}\n"
CALLER = "{way}\n" + HEAD + "\n@compiled\ndef call(x):\n    return 1 + {name}(x)\n"
BODIES = ("x + STEP", "x - STEP", "x * STEP", "STEP", "x", "STEP + x", "x + STEP + STEP", "abs(x) - STEP")
names = itertools.count()


class Package:
    """A package with a module `low`, and a caller for each way to import it."""

    def __init__(self, folder: Path, name: str, ways: list[str]) -> None:
        self.folder, self.name, self.ways = folder, name, ways
        (folder / name).mkdir()
        self.write("__init__", "__all__ = ['low']\n")
        self.write("between", f"from {name} import low\nfrom {name}.low import f\n")
        for number, way in enumerate(ways):
            words = {"way": way.format(p=name), "name": WAYS[way].format(p=name)}
            self.write(f"caller_{number}", CALLER.format(**words))

    def write(self, module: str, text: str) -> None:
        (self.folder / self.name / f"{module}.py").write_text(text)

    def load(self, step: int, body: str) -> list[Any]:
        """Return the callers as loaded anew, after an edit."""
        self.write("low", LOW.format(step=step, body=body))
        for module in [module for module in sys.modules if module.partition(".")[0] == self.name]:
            del sys.modules[module]
        importlib.invalidate_caches()
        importlib.import_module(f"{self.name}.low")
        modules = [
            importlib.import_module(f"{self.name}.caller_{number}") for number in range(len(self.ways))
        ]
        return [module.call for module in modules]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder of packages, from which sources are read anew each time."""
    folder = tmp_path_factory.mktemp("packages")
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))
    sys.dont_write_bytecode = before


edits = st.tuples(st.integers(-3, 3), st.sampled_from(BODIES))


@settings(max_examples=60, deadline=None)
@given(ways=st.lists(st.sampled_from(sorted(WAYS)), min_size=1, max_size=4), first=edits, second=edits)
def test_what_answers_otherwise_has_another_fingerprint_however_it_is_imported(folder, ways, first, second):
    package = Package(folder, f"package_{next(names)}", ways)
    before, after = package.load(*first), package.load(*second)
    for old, new in zip(before, after, strict=True):
        answers = [
            [1 + eval(body, {"x": x, "STEP": step}) for x in (-2, 0, 3)]  # noqa: S307 - of this file
            for step, body in (first, second)
        ]
        are_equal = fingerprint(old, (int64,)) == fingerprint(new, (int64,))
        assert are_equal <= (answers[0] == answers[1])
        assert are_equal == (first == second or _says_the_same(first, second))
        assert {function.__name__ for function in functions_of(new)} == {"call", "f"}


def _says_the_same(first: tuple[int, str], second: tuple[int, str]) -> bool:
    """Whether two edits differ only in a value that the function does not use."""
    return first[1] == second[1] == "x"


@pytest.mark.slow
def test_edits_between_processes_are_seen_in_every_form_of_import(tmp_path):
    """Answers of compiled code are those of plain Python, after each edit; unedited code is found again."""
    ways = sorted(WAYS)
    package = Package(tmp_path, "mypk", ways)
    run = (
        f"import importlib, mypk.low\nnames = [f'mypk.caller_{{n}}' for n in range({len(ways)})]\n"
        "calls = [importlib.import_module(name).call for name in names]\nprint([call(5) for call in calls])\n"
        "print(sum(sum(call.stats.cache_hits.values()) for call in calls))"
    )
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    path = os.pathsep.join([str(tmp_path), str(PROJECT)])
    for (step, body), answer, hits in (
        ((5, "x + STEP"), 11, 0),
        ((5, "x * STEP"), 26, 0),
        ((3, "x * STEP"), 16, 0),
        ((5, "x + STEP"), 11, len(ways)),
    ):
        package.write("low", LOW.format(step=step, body=body))
        done = run_python("-c", run, folder=tmp_path, path=path, **variables)
        assert done.stdout == f"{[answer] * len(ways)}\n{hits}\n"
        assert "not kept" not in done.stderr


def defined(text: str, **values: Any) -> Any:
    """Return the compiled function `f` of a text, in which some values are global."""
    module = ModuleType("somewhere")
    vars(module).update(values, compiled=compiled, np=np)
    exec(text, vars(module))  # noqa: S102 - of this file
    return module.f


class Color(IntEnum):
    RED = 1


class Pair(NamedTuple):
    x: float
    y: float


def pair(*fields: str) -> Any:
    """Return a named tuple class of one name, with some fields."""
    kind = NamedTuple("Pair", [(field, float) for field in fields])  # type: ignore[misc]
    kind.__module__ = __name__
    return kind


F = "@compiled\ndef f(x):\n    return {}\n"


@pytest.mark.parametrize(
    ("body", "first", "second"),
    [
        ("x + A", {"A": 1}, {"A": 2}),
        ("x + A", {"A": 1}, {"A": 1.0}),
        ("x + A", {"A": 1}, {"A": True}),
        ("x + A", {"A": 0.0}, {"A": -0.0}),
        ("x + A[1]", {"A": (1, 2.0)}, {"A": (1, 3.0)}),
        ("x + A[1]", {"A": np.array([1.0, 2.0])}, {"A": np.array([1.0, 3.0])}),
        ("x + A[1]", {"A": np.zeros(2)}, {"A": np.zeros(2, dtype=np.float32)}),
        ("x + A.x", {"A": Pair(1.0, 2.0)}, {"A": pair("y", "x")(1.0, 2.0)}),
        ("A(x, 2.0).x", {"A": Pair}, {"A": pair("y", "x")}),
        ("A(x)", {"A": np.sin}, {"A": np.cos}),
        ("A(x)", {"A": abs}, {"A": np.sqrt}),
        ("A(x)", {"A": njit(lambda x: x + 1)}, {"A": njit(lambda x: x + 2)}),
        ("[x + A for _ in range(2)][0]", {"A": 1}, {"A": 2}),
    ],
)
def test_every_value_that_a_function_uses_counts(body, first, second):
    def of(values: dict[str, Any]) -> str:
        return fingerprint(defined(F.format(body), **values), (float64,))

    assert of(first) == of(first) != of(second)


def test_options_defaults_closures_types_and_the_order_of_fields_count():
    inside = "def make(y):\n    @compiled\n    def f(x):\n        return x + y\n    return f\nf = make({y})"
    texts = [
        F.format("x"),
        F.format("x").replace("@compiled", "@compiled(error_model='numpy')"),
        F.format("x").replace("(x)", "(x=1)"),
        F.format("x").replace("(x)", "(x=2)"),
        *(inside.format(y=y) for y in (1, 2)),
    ]
    kinds = [(float64,), (int64,), (typeof(np.zeros(2)),), (typeof(Pair(1.0, 2.0)),)]
    kinds += [
        (typeof(pair("y", "x")(1.0, 2.0)),),
        (typeof((pair("y", "x")(1.0, 2.0), 1)),),
        (float64, float64),
    ]
    prints = [fingerprint(defined(text), (float64,)) for text in texts]
    prints += [fingerprint(defined(texts[0]), kind) for kind in kinds[1:]]
    assert len(set(prints)) == len(texts) + len(kinds) - 1


def test_files_lines_comments_and_what_is_not_used_do_not_count():
    first = defined(F.format("x + A"), A=1, B=1)
    second = defined("\n# moved\n\n" + F.format("x + A  # so"), A=1, B=2)
    assert fingerprint(first, (float64,)) == fingerprint(second, (float64,))


def test_a_set_in_code_is_described_in_one_order_in_every_process():
    look = (
        "from numba import float64\nfrom fis_tools.compiled.decorator import compiled\n"
        "from fis_tools.compiled.fingerprint import fingerprint\n"
        "@compiled\ndef f(x):\n    return x in {'a', 'b', 'c', 'd'}\nprint(fingerprint(f, (float64,)))"
    )
    runs = {run_python("-c", look, PYTHONHASHSEED=str(seed)).stdout for seed in range(3)}
    assert len(runs) == 1


def helper(x):
    return x


@pytest.mark.parametrize("value", [helper, [1], {1: 2}, object(), type("C", (), {}), np.array([None])])
def test_what_cannot_be_described_is_refused_by_name(value):
    with pytest.raises(UnknownPartError, match="it uses "):
        fingerprint(defined(F.format("A(x)"), A=value), (float64,))


def test_a_function_as_an_argument_is_refused():
    with pytest.raises(UnknownPartError, match="it is called with a function"):
        fingerprint(defined(F.format("x")), (typeof(njit(helper)),))


def test_enumerations_count_by_their_members():
    class Other(IntEnum):
        RED = 2

    Other.__qualname__, Other.__module__ = Color.__qualname__, Color.__module__
    prints = {fingerprint(defined(F.format("x + A"), A=kind.RED), (float64,)) for kind in (Color, Other)}
    assert len(prints) == 2


def test_a_change_of_what_was_compiled_before_is_refused():
    function = defined(F.format("x + A"), A=1)
    fingerprint(function, (float64,))
    function.py_func.__globals__["A"] = 2
    with pytest.raises(UnknownPartError, match="has changed; start Python anew"):
        fingerprint(function, (int64,))


def test_a_kernel_depends_on_all_that_it_calls_and_on_nothing_else():
    flight = set(functions_of(many.fly_many))
    for part in (attitude.turn_deputies, safety.assure, quaternion.from_dcm):
        assert flight > set(functions_of(part))
    modules = {function.__module__ for function in flight}
    assert "fis_tools.engines.kernel" in modules
    assert not any("reference" in module or "formats" in module for module in modules)
