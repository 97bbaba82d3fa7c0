"""Compiled functions borrow nothing but parameters, which their callers hold."""

import ast
from collections.abc import Iterator

from tests.places import PACKAGES, PROJECT


def borrowing(code: str) -> Iterator[tuple[str, str]]:
    """The functions of a module that borrow, each with an expression that it borrows."""
    for function in ast.walk(ast.parse(code)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for call in ast.walk(function):
            if isinstance(call, ast.Call) and ast.unparse(call.func).rpartition(".")[2] == "borrowed":
                for part in parts(call.args[0]):
                    yield function.name, ast.unparse(part)


def parts(value: ast.expr) -> Iterator[ast.expr]:
    if isinstance(value, ast.Tuple):
        for element in value.elts:
            yield from parts(element)
    else:
        yield value


def parameters(code: str) -> dict[str, set[str]]:
    """The parameters of each function of a module."""
    functions = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.FunctionDef)]
    return {each.name: {argument.arg for argument in each.args.args} for each in functions}


def not_held(code: str) -> list[tuple[str, str]]:
    """What functions borrow that no caller holds: numba may free it after its last use by name."""
    held = parameters(code)
    return [(name, part) for name, part in borrowing(code) if part not in held[name]]


def test_what_is_borrowed_are_parameters():
    modules = [path for package in PACKAGES for path in sorted((PROJECT / package).rglob("*.py"))]
    codes = {path.relative_to(PROJECT).as_posix(): path.read_text(encoding="utf-8") for path in modules}
    assert sum(len(list(borrowing(code))) for code in codes.values()) > 40
    assert {path: parts for path, code in codes.items() if (parts := not_held(code))} == {}


def test_what_a_function_allocates_is_not_held():
    code = "def f(a):\n    room = np.zeros(9)\n    return borrowed((a, room, np.empty(3)))\n"
    assert not_held(code) == [("f", "room"), ("f", "np.empty(3)")]
