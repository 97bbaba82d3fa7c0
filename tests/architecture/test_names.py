"""Names of the field: no binding that names nothing, one meaning of a class's name, named working arrays."""

import ast
from collections import defaultdict

import pytest

from pipeline import constants
from tests.places import PACKAGES, PROJECT

#: words that fit anything: that it is somewhere, or that somebody found it or wanted it
NAMELESS = {"place", "places", "found", "own", "asked", "told", "one"}
#: compiled code that protobuf writes
GENERATED = "_pb2.py"


def sources(*folders):
    """The modules in some folders, by path, as syntax trees."""
    for folder in folders:
        for path in sorted((PROJECT / folder).rglob("*.py")):
            if not path.name.endswith(GENERATED):
                yield path.relative_to(PROJECT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def bindings(tree):
    """The names that a module binds, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.alias) and node.asname:
            yield node.asname, node.lineno


@pytest.mark.parametrize("folder", [*PACKAGES, "tests"])
def test_no_name_is_a_word_that_names_nothing(folder):
    bad = [
        f"{path}:{line} {name}"
        for path, tree in sources(folder)
        for name, line in bindings(tree)
        if name.strip("_").lower() in NAMELESS
    ]
    assert bad == [], "name what it is: index, column, path, match, user_..., requested, reported, ..."


def test_a_name_that_names_nothing_is_seen():
    tree = ast.parse(
        "import a as told\ndef f(place):\n    one = [found for found in place]\nclass _Own: asked: int"
    )
    names = [name for name, _ in bindings(tree)]
    assert {"told", "place", "one", "found", "_Own", "asked", "f"} == set(names)


def test_a_class_name_has_one_meaning():
    where = defaultdict(list)
    for path, tree in sources(*PACKAGES):
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                where[node.name].append(path)
    assert {name: paths for name, paths in where.items() if len(paths) > 1} == {}


def takers(tree, kind):
    """The functions of a module that take an argument annotated as of a kind."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            given = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            if any(arg.annotation and kind in ast.unparse(arg.annotation) for arg in given):
                yield node.name


def test_only_the_steps_of_a_period_take_the_whole_workspace():
    whole = {
        f"{path.removeprefix('pipeline/flight/period/')}:{name}"
        for path, tree in sources("pipeline/flight/period")
        for name in takers(tree, "Workspace")
    }
    steps = {f"steps.py:{name}" for name in ("look", "decide", "act", "move_on")}
    assert whole == steps | {
        "look/sight.py:see",
        "decide/exchange.py:share_out",
        "decide/exchange.py:choose_lane_target",
    }, "name the working arrays that a function reads and writes"


def test_constants_of_nature_stand_in_one_place():
    # a thousand is a number of many things
    values = {value for name, value in vars(constants).items() if name.isupper() and value != 1000.0}
    copies = [
        f"{path}:{node.lineno} {node.value}"
        for path, tree in sources(*PACKAGES, "benchmarks")
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, float | int) and node.value in values
        if path != "pipeline/constants.py"
    ]
    assert len(values) >= 6
    assert copies == []
