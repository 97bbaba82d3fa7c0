"""A compiled function, read for another language: what is known of it is filled in, what is left has types.

Where an argument is known, such as the number of an operator, branches that are not taken are left out, as
are variables that nothing reads, and arguments.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fis_tools.formats.c.text import WORDS
from fis_tools.formats.c.transcribed.folding import NotTranscribed, folded, names_in, resolved, walk

#: What an annotation says; an array is one of its numbers.
Kind = Literal["float", "int", "bool", "None"]
_KINDS: dict[str, Kind] = {
    **{"Floats": "float", "Integers": "int"},
    **{"float": "float", "int": "int", "bool": "bool", "None": "None"},
}
#: Parameters that number operators, shapes and the like: a function is transcribed for what it is told there.
NUMBERED = frozenset({"operator", "implication", "aggregation", "defuzzifier", "method", "sampling", "kind"})


@dataclass
class ScalarFunction:
    """A compiled function as it is transcribed.

    Parameters
    ----------
    name : str
    about : str
        What it does, a sentence.
    parameters : list of str
        Those that are left.
    positions : list of int
        Where these stand among the parameters of the compiled function.
    arrays : dict of str to int
        Those among them that are arrays, with their number of axes.
    measured : set of str
        Arrays whose length counts.
    written : set of str
        Arrays in which something is written.
    kinds : dict of str to Kind
        What parameters and variables hold.
    returns : Kind
    body : list of ast.stmt
        Assignments have one target each.
    calls : dict of ast.Call to ScalarFunction
        The compiled functions that are called.
    declared : dict of ast.stmt to list of str
        Variables that are declared at a statement, in the block that all that uses them is in.
    constant : set of str
        Variables that are set once.
    """

    name: str
    about: str
    parameters: list[str]
    positions: list[int]
    arrays: dict[str, int]
    kinds: dict[str, Kind]
    returns: Kind
    body: list[ast.stmt]
    calls: dict[ast.Call, "ScalarFunction"] = field(default_factory=dict)
    measured: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    declared: dict[ast.stmt, list[str]] = field(default_factory=dict)
    constant: set[str] = field(default_factory=set)

    def kind(self, node: ast.expr) -> Kind:  # noqa: PLR0911 - one for each kind of node
        """Return what an expression is."""
        match node:
            case ast.Constant(value):
                return _KINDS[type(value).__name__]
            case ast.Name(name) | ast.Subscript(ast.Name(name)):
                return self.kinds[name]
            case ast.UnaryOp(ast.Not()) | ast.Compare() | ast.BoolOp():
                return "bool"
            case ast.UnaryOp(_, operand):
                return self.kind(operand)
            case ast.BinOp(left, operator, right):
                return "float" if isinstance(operator, ast.Div) else self._joined(left, right)
            case ast.IfExp(_, body, orelse):
                return self._joined(body, orelse)
            case ast.Call(ast.Name("len")):
                return "int"
            case ast.Call(ast.Name("min" | "max" | "abs"), arguments):
                return self._joined(*arguments)
            case ast.Call():
                return self.calls[node].returns if node in self.calls else "float"
        raise NotTranscribed(node)

    def _joined(self, *nodes: ast.expr) -> Kind:
        kinds = [self.kind(node) for node in nodes]
        return "float" if "float" in kinds else kinds[0]

    @property
    def called(self) -> list["ScalarFunction"]:
        """The function and those that it calls, callees first, each once."""
        functions: list[ScalarFunction] = []
        for callee in self.calls.values():
            functions += [each for each in callee.called if each not in functions]
        return [*functions, self]


def read(
    function: Callable[..., Any],
    known: Mapping[str, int],
    find: Callable[..., ScalarFunction],
    name: str = "",
    about: str | None = None,
    renamed: Mapping[str, str] | None = None,
) -> ScalarFunction:
    """Read a compiled function.

    Parameters
    ----------
    function : callable
        Decorated as `fis_tools.compiled.decorator.compiled`.
    known : mapping of str to int
        Arguments, and their values.
    find : callable
        Gives a function that this one calls, from the compiled one and its known arguments.
    name : str
        What it is called; by default its name without an underscore before it.
    about : str, optional
        What it does, if its docstring does not begin with that.
    renamed : mapping of str to str, optional
        Names of parameters, and what they become.

    Raises
    ------
    NotTranscribed
        At what is not transcribed.
    """
    python: Any = function.py_func  # type: ignore[attr-defined]
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(python))).body
    assert isinstance(definition, ast.FunctionDef)  # noqa: S101 - decorated functions are
    arguments = definition.args.args
    local = {argument.arg for argument in arguments} | _stored(definition)
    constants = {key: value for key, value in python.__globals__.items() if key not in local} | {**known}
    words = {name: f"{name}_value" for name in local & (WORDS | {"function", "in", "new", "this", "var"})}
    new_names = {**(renamed or {}), **words}
    body = folded(definition.body, constants, new_names)
    kinds = {
        new_names.get(argument.arg, argument.arg): _KINDS[ast.unparse(argument.annotation or argument)]
        for argument in arguments
    }
    used = names_in(body)
    read_ = ScalarFunction(
        name or python.__name__.lstrip("_"),
        _sentence(python) if about is None else about,
        [key for key in kinds if key in used],
        [index for index, key in enumerate(kinds) if key in used],
        {
            key: 1
            for argument, key in zip(arguments, kinds, strict=True)
            if ast.unparse(argument.annotation or argument) in ("Floats", "Integers")
        },
        kinds,
        _KINDS[ast.unparse(definition.returns) if definition.returns else "None"],
        body,
    )
    for call in [node for node in walk(body) if isinstance(node, ast.Call)]:
        if hasattr(resolved(call.func, constants), "py_func"):
            _called(read_, call, resolved(call.func, constants), find)
    _measure(read_)
    for _ in range(2):  # a variable may be set before what it is set to is known
        _find_kinds(read_)
    for variable in sorted(names_in(body, ast.Store) - set(read_.parameters)):
        _declare(read_, variable, body)
    return read_


def _called(
    caller: ScalarFunction, call: ast.Call, function: Any, find: Callable[..., ScalarFunction]
) -> None:
    """Read a function that is called, with what it is told filled in."""
    names = list(inspect.signature(function.py_func).parameters)
    arguments_of = dict(zip(names, call.args, strict=True))
    known = {
        name: value.value
        for name, value in arguments_of.items()
        if name in NUMBERED and isinstance(value, ast.Constant)
    }
    callee = find(function, **known)
    call.args = [call.args[index] for index in callee.positions]
    caller.calls[call] = callee
    for name, value in zip(callee.parameters, call.args, strict=True):
        if name in callee.arrays and isinstance(value, ast.Name):
            caller.arrays[value.id] = max(caller.arrays[value.id], callee.arrays[name])
            caller.measured |= {value.id} & ({value.id} if name in callee.measured else set())
            caller.written |= {value.id} & ({value.id} if name in callee.written else set())


def _measure(function: ScalarFunction) -> None:
    """Find axes of arrays, whether their lengths count, and which are written."""
    for node in walk(function.body):
        match node:
            case ast.Subscript(ast.Name(name), index):
                if isinstance(index, ast.Tuple):
                    function.arrays[name] = len(index.elts)
                if isinstance(node.ctx, ast.Store):
                    function.written.add(name)
            case ast.Call(ast.Name("len"), [ast.Name(name)]):
                function.measured.add(name)


def _find_kinds(function: ScalarFunction) -> None:
    for node in walk(function.body):
        match node:
            case ast.Assign([ast.Name(name)], value):
                old = function.kinds.get(name)
                new = function.kind(value)
                function.kinds[name] = "float" if "float" in (old, new) else new
            case ast.For(ast.Name(name)):
                function.kinds[name] = "int"


def _declare(function: ScalarFunction, variable: str, body: list[ast.stmt]) -> None:
    """Find where a variable is declared: in the innermost block with all that uses it."""
    if len([node for node in walk(body) if _is_set(node, variable)]) == 1:
        function.constant.add(variable)
    while True:
        users = [statement for statement in body if variable in names_in([statement])]
        match users:
            case [ast.For(ast.Name(name))] if name == variable:
                return
            case [ast.If() | ast.For() | ast.While() as statement]:
                inner = [statement.body, statement.orelse]
                head = [node for node in ast.iter_child_nodes(statement) if isinstance(node, ast.expr)]
                blocks = [block for block in inner if variable in names_in(block)]
                if len(blocks) == 1 and not any(variable in names_in([node]) for node in head):
                    body = blocks[0]
                    continue
        if all(_counts_by(statement, variable) for statement in users):
            return
        function.declared.setdefault(users[0], []).append(variable)
        return


def _is_set(node: ast.AST, variable: str) -> bool:
    return isinstance(node, ast.Name) and node.id == variable and isinstance(node.ctx, ast.Store)


def _counts_by(statement: ast.AST, variable: str) -> bool:
    """Return whether a variable is in a statement only as that of its loops, which declare it."""
    match statement:
        case ast.For(ast.Name(name)) if name == variable:
            return True
        case ast.Name(name):
            return name != variable
    return all(_counts_by(child, variable) for child in ast.iter_child_nodes(statement))


def _stored(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def _sentence(python: Callable[..., Any]) -> str:
    """Return the first sentence of a docstring as it stands above what returns something."""
    text = " ".join((inspect.getdoc(python) or "").split("\n\n")[0].split()).replace("`", "")
    words = text.removeprefix("Return ")
    return words[:1].upper() + words[1:]
