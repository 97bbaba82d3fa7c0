"""What is transcribed, by name: the compiled functions of inference, each for the numbers that it is told.

The names of what an operator, a defuzzifier or a shape is called come from the tables that number them.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from itertools import product
from typing import Any

from fis_tools import model
from fis_tools.engines import codes, defuzzifier, degrees, sampling
from fis_tools.formats.c.transcribed.functions import ScalarFunction, read
from fis_tools.model.membership import SHAPES
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS, WEIGHING

_Words = Mapping[int, str]
_OPERATORS: _Words = {code: name for name, code in codes.OPERATORS.items()} | {codes.NOT: "not"}
_DEFUZZIFIERS: _Words = {code: name for name, code in codes.DEFUZZIFIERS.items()}
_SAMPLING: _Words = {code: name.replace("-", "_") for name, code in codes.SAMPLING.items()}
_KINDS: _Words = {code: name for name, code in degrees.KINDS.items() if code != degrees.TABLE}
_INVERTED: _Words = {code: shape.entry.name for code, shape in enumerate(codes.INVERTED)}
#: What the numbers stand for that a function may be told, by its parameters.
_WORDS: dict[str, _Words] = {
    "operator": _OPERATORS,
    "implication": _OPERATORS,
    "aggregation": _OPERATORS,
    "defuzzifier": _DEFUZZIFIERS,
    "method": _DEFUZZIFIERS,
    "sampling": _SAMPLING,
}
#: Functions that are called otherwise than in Python, and what the rest of their name says they do.
_CALLED: dict[Any, tuple[str, str | None]] = {
    codes.combine: ("fuzzy", ""),
    codes.change: ("fuzzy", ""),
    degrees.formula: ("degree", "How far x belongs to the shape {}."),
    degrees.interpolated: ("degree_table", None),
    defuzzifier.invert: ("where", "Where the shape {} has a degree above zero."),
}


@cache
def specialised(function: Callable[..., Any], **known: int) -> ScalarFunction:
    """Read a compiled function that is told some numbers.

    Parameters
    ----------
    function : callable
    known : int
        Numbers of operators, shapes and so on, by the names of its parameters.

    Returns
    -------
    ScalarFunction
        Its name ends in what the numbers stand for.
    """
    python: Any = function.py_func  # type: ignore[attr-defined]
    kinds = _KINDS if function is degrees.formula else _INVERTED
    words = [(_WORDS | {"kind": kinds})[key][value] for key, value in known.items()]
    base, about = _CALLED.get(function, (python.__name__.lstrip("_"), None))
    renamed = {}
    if function is degrees.formula:
        renamed = dict(zip("abcd", SHAPES[words[0]].entry.kinds, strict=False))
    return read(
        function, known, specialised, "_".join((base, *words)), about and about.format(*words), renamed
    )


def combining(name: str) -> ScalarFunction:
    """Return the operator, or the hedge, of a name; ``not`` is the complement."""
    code = next(code for code, word in _OPERATORS.items() if word == name)
    is_binary = code in codes.AND_CODES or code in codes.OR_CODES or code == codes.UNBOUNDED_SUM
    return specialised(codes.combine if is_binary else codes.change, operator=code)


def implying(implication: str, aggregation: str) -> ScalarFunction:
    """Return what adds a rule's implied set to the aggregate."""
    numbers = codes.OPERATORS[implication], codes.OPERATORS[aggregation]
    return specialised(defuzzifier.imply, implication=numbers[0], aggregation=numbers[1])


def degree_of(shape: str) -> ScalarFunction:
    """Return how far x belongs to a shape, by the shape's name."""
    return specialised(degrees.formula, kind=degrees.KINDS[shape])


def where(shape: str) -> ScalarFunction:
    """Return where a shape has a degree, by the shape's name."""
    kind = next(code for code, word in _INVERTED.items() if word == shape)
    return specialised(defuzzifier.invert, kind=kind)


def defuzzifying(semantics: model.Semantics, method: str) -> ScalarFunction:
    """Return a defuzzifier: of polygons, or of heights at points as another program has it."""
    number = codes.DEFUZZIFIERS[method]
    if codes.SAMPLING[semantics] == codes.POLYGON:
        return specialised(defuzzifier.defuzzify, defuzzifier=number)
    return specialised(sampling.defuzzify_sampled, sampling=codes.SAMPLING[semantics], method=number)


def aggregating() -> ScalarFunction:
    """Return what joins terms that are cut, at their crossings too."""
    return specialised(defuzzifier.aggregate)


def _all() -> Iterator[tuple[str, Callable[[], ScalarFunction]]]:
    """Yield what is transcribed, with its name."""
    for name in _OPERATORS.values():
        yield f"fuzzy_{name}", partial(combining, name)
    for shape in _KINDS.values():
        yield f"degree_{shape}", partial(degree_of, shape)
    for shape in _INVERTED.values():
        yield f"where_{shape}", partial(where, shape)
    for pair in product(AND_OPERATORS, AGGREGATIONS):
        yield f"imply_{pair[0]}_{pair[1]}", partial(implying, *pair)
    for semantics, method in product(model.ALL_SEMANTICS, codes.DEFUZZIFIERS):
        if method not in WEIGHING:
            before = "" if codes.SAMPLING[semantics] == codes.POLYGON else f"sampled_{semantics}_"
            yield f"defuzzify_{before}{method}", partial(defuzzifying, semantics, method)
    yield "aggregate", aggregating
    yield "counted", partial(specialised, degrees.counted)
    yield "degree_table", partial(specialised, degrees.interpolated)


#: What is transcribed, by its name; a function is read when it is called for.
ENTRIES: dict[str, Callable[[], ScalarFunction]] = dict(_all())
