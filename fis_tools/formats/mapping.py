"""A controller as plain data: dicts, lists, strings and numbers, the common ground of its JSON and YAML.

The mapping has ``schema: fuzzy-controller``, ``schema_version: 1``, ``name``, maybe a ``purpose``,
``attributes``, ``provenance`` and ``systems``, and maybe ``wires`` between them, each ``{from:
SYSTEM/OUTPUT, to: SYSTEM/INPUT}``. A system has ``name``, ``inputs``, ``outputs`` and
``rules``. A variable has ``name``, ``unit``, ``range`` and ``points`` (or ``universe``, every point of
it), ``terms``, maybe a ``description``, and, for an output, ``default`` and maybe ``defuzzifier``,
``accumulation`` and ``aggregation``. The keys of a term tell its shape, where ``shape`` does not; the
``lower`` and ``upper`` of an interval type-2 set are shapes. A system may have an ``implication``, a
``type_reduction``, and ``semantics``: the program whose inference it means. A full rule
table is the list of its output terms, the last
input changing fastest; any other rule base is a list of ``{if: ..., then: [...]}`` with ``is``, ``and``,
``or``, ``not`` nested, and maybe a ``label``, an ``and_operator`` and an ``or_operator``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any, TypeVar

from fis_tools import model
from fis_tools.errors import ControllerFileError, raised_as, require_known, suggestion
from fis_tools.model.membership import SHAPES
from fis_tools.model.operators import HEDGES
from fis_tools.model.validate import (
    MAX_NESTING,
    MOST_INPUTS,
    MOST_MEMBERSHIPS,
    MOST_RULES,
    MOST_SYSTEMS,
    MOST_TERMS,
    controller_problems,
    require_valid,
)

SCHEMA = "fuzzy-controller"
SCHEMA_VERSION = 1

#: Points of a universe: as many as a system of one term may have.
MOST_POINTS = MOST_MEMBERSHIPS
#: Problems told when a file is refused.
MOST_PROBLEMS = 8
#: Wires: one for each input.
MOST_WIRES = MOST_SYSTEMS * MOST_INPUTS
#: Letters of a text, such as a purpose.
LONGEST_TEXT = 100_000

#: Shapes that their keys alone tell.
_KNOWN_BY_KEYS = ("gaussian", "triangular", "trapezoidal", "sampled")
_Item = TypeVar("_Item")

# Writing.


def to_mapping(controller: model.FuzzyController) -> dict[str, Any]:
    """Turn a controller into plain data: dicts, lists, strings and numbers.

    Raises
    ------
    InvalidSystem
        If something is wrong with the controller: what is written can be read again.
    """
    require_valid(controller)
    wires = [{"from": wire.source, "to": wire.target} for wire in controller.wires]
    return {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "name": controller.name,
        **_unusual(controller, "purpose"),
        "attributes": dict(controller.attributes),
        "provenance": dict(controller.provenance),
        "systems": [_system_mapping(system) for system in controller.systems],
        **({"wires": wires} if wires else {}),
    }


def _system_mapping(system: model.FuzzySystem) -> dict[str, Any]:
    """Return a system as plain data; usual settings are left out."""
    return {
        **{key: getattr(system, key) for key in ("name", "and_operator", "or_operator", "defuzzifier")},
        **_unusual(system, "implication", "semantics", "type_reduction"),
        "inputs": [_variable_mapping(variable) for variable in system.inputs],
        "outputs": [_variable_mapping(variable) for variable in system.outputs],
        "rules": _rules_list(system),
    }


def _unusual(thing: Any, *keys: str) -> dict[str, Any]:
    """Return the fields of a dataclass that differ from their defaults."""
    usual = {field.name: field.default for field in fields(thing)}
    return {key: _plain(getattr(thing, key)) for key in keys if getattr(thing, key) != usual[key]}


def _plain(value: Any) -> Any:
    """Return a number as a float, and numbers as a list of them."""
    if isinstance(value, model.MembershipFunction):
        return _membership_mapping(value)
    if isinstance(value, tuple):
        return [float(number) for number in value]
    return value if isinstance(value, str) else float(value)


def _variable_mapping(variable: model.Variable) -> dict[str, Any]:
    """Return a variable as plain data; defaults are left out."""
    extent = {"range": _plain((variable.minimum, variable.maximum)), "points": variable.num_points}
    return {
        "name": variable.name,
        "unit": variable.unit,
        **_unusual(variable, "description"),
        **(extent if variable.points is None else {"universe": _plain(variable.points)}),
        **_unusual(variable, "default", "defuzzifier", "accumulation", "aggregation"),
        **({"clip": True} if variable.is_clipped else {}),
        "terms": [{"name": term.name, **_membership_mapping(term.membership)} for term in variable.terms],
    }


def _membership_mapping(membership: model.MembershipFunction) -> dict[str, Any]:
    name = membership.entry.name
    shape = {} if name in _KNOWN_BY_KEYS else {"shape": name}
    return {**shape, **{key: _plain(getattr(membership, key)) for key in _keys(name)}}


def _rules_list(system: model.FuzzySystem) -> list[Any]:
    """Return the rules: the terms of a full table in order, or one mapping a rule."""
    table = model.rule_table(system)
    if table is not None and not any(rule.label for rule in system.rules):
        return [system.outputs[0].terms[index].name for index in table]
    return [_rule_mapping(rule) for rule in system.rules]


def _rule_mapping(rule: model.Rule) -> dict[str, Any]:
    """Return a rule as plain data."""
    return {
        **_unusual(rule, "label", "and_operator", "or_operator"),
        "if": _expression_mapping(rule.antecedent),
        "then": [
            {"variable": c.variable, "term": c.term, "weight": float(c.weight)} for c in rule.consequents
        ],
    }


def _expression_mapping(expression: model.Expression) -> dict[str, Any]:
    """Return an antecedent as plain data."""
    match expression:
        case model.Is(variable, term):
            return {"is": [variable, term]}
        case model.Not(operand):
            return {"not": _expression_mapping(operand)}
        case model.Hedged(hedge, operand):
            return {hedge: _expression_mapping(operand)}
    return {expression.word: [_expression_mapping(operand) for operand in expression.operands]}


# Reading.


def from_mapping(mapping: Mapping[str, Any]) -> model.FuzzyController:
    """Rebuild a controller from plain data.

    Raises
    ------
    ControllerFileError
        If a key is unknown or missing, a value is of the wrong kind, or the controller has problems.
    """
    if not isinstance(mapping, Mapping) or "schema" not in mapping:
        raise ControllerFileError(
            f"this is not a fuzzy controller; a controller file begins with 'schema: {SCHEMA}'"
        )
    schema, version = mapping["schema"], mapping.get("schema_version")
    if schema != SCHEMA:
        raise ControllerFileError(f"the schema is {_kind_of(schema)}; expected {SCHEMA!r}")
    if isinstance(version, bool) or version != SCHEMA_VERSION:
        raise ControllerFileError(
            f"the schema version is {_kind_of(version)}, this program reads version {SCHEMA_VERSION}; "
            "use the program that wrote the file, or write it again"
        )
    where = "the controller"
    required = ("schema", "schema_version", "name", "systems")
    _check_keys(mapping, where, required, ("purpose", "attributes", "provenance", "wires"))
    controller = model.FuzzyController(
        name=_text(mapping["name"], f"{where}: name"),
        systems=tuple(_items(mapping["systems"], "systems", _system, MOST_SYSTEMS)),
        attributes=_facts(mapping.get("attributes", {}), "attributes"),
        provenance=_facts(mapping.get("provenance", {}), "provenance"),
        purpose=_text(mapping.get("purpose", ""), f"{where}: purpose"),
        wires=tuple(_items(mapping.get("wires", ()), "wires", _wire, MOST_WIRES)),
    )
    refuse_problems(controller)
    return controller


def refuse_problems(controller: model.FuzzyController) -> None:
    """Refuse a controller with problems; the first of them are listed.

    Raises
    ------
    ControllerFileError
        With a sentence each.
    """
    problems = controller_problems(controller)
    if problems:
        more = [f"… and {len(problems) - MOST_PROBLEMS} more"] if len(problems) > MOST_PROBLEMS else []
        raise ControllerFileError("\n".join(problems[:MOST_PROBLEMS] + more))


def _check_keys(value: Any, where: str, required: Sequence[str], optional: Sequence[str] = ()) -> None:
    """Raise ControllerFileError for unknown and missing keys."""
    if not isinstance(value, Mapping):
        raise ControllerFileError(
            f"{where} is {_kind_of(value)}; expected a mapping with {', '.join(required)}"
        )
    require_known(value, (*required, *optional), f"{where}: unknown key", ControllerFileError)
    for key in required:
        if key not in value:
            raise ControllerFileError(f"{where}: the key {key!r} is missing; add it, or get a whole copy")


def _kind_of(value: object) -> str:
    if isinstance(value, str | int | float):
        return f"{str(value)[:40]!r}" if isinstance(value, str) else str(value)
    return {dict: "a mapping", list: "a list", type(None): "empty"}.get(type(value), type(value).__name__)


def _text(value: Any, where: str) -> str:
    """Read a text."""
    if not isinstance(value, str):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected a word: quote it")
    if len(value) > LONGEST_TEXT:
        raise ControllerFileError(f"{where} has {len(value)} letters; at most {LONGEST_TEXT} are read")
    return value


def _number(value: Any, where: str) -> float:
    """Read a number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected a number")
    try:
        return float(value)
    except OverflowError as error:
        raise ControllerFileError(f"{where} is too large a number; use another unit") from error


def _flag(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected true or false")
    return value


def _count(value: Any, where: str) -> int:
    """Read a whole number."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected a whole number")
    if value > MOST_POINTS:
        raise ControllerFileError(f"{where} is more than {MOST_POINTS}; 101 is usual")
    return value


def _items(value: Any, where: str, read: Callable[[Any, str], _Item], most: int = MOST_POINTS) -> list[_Item]:
    """Read a list, each item by `read`."""
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected a list")
    if len(value) > most:
        raise ControllerFileError(f"{where} has {len(value)} entries; at most {most} are read")
    return [read(item, f"{where}[{index}]") for index, item in enumerate(value)]


def _each(
    read: Callable[[Any, str], _Item], most: int = MOST_POINTS
) -> Callable[[Any, str], tuple[_Item, ...]]:
    return lambda value, where: tuple(_items(value, where, read, most))


_numbers = _each(_number)
#: What reads the values of keys.
Readers = Mapping[str, Callable[[Any, str], Any]]
NO_KEYS: Readers = MappingProxyType({})


def _read(value: Any, where: str, required: Readers, optional: Readers = NO_KEYS) -> dict[str, Any]:
    """Read a mapping with a reader for each key; optional keys may be missing."""
    _check_keys(value, where, tuple(required), tuple(optional))
    readers = {**required, **optional}
    return {key: read(value[key], f"{where}.{key}") for key, read in readers.items() if key in value}


def _facts(value: Any, where: str) -> tuple[tuple[str, str], ...]:
    if not isinstance(value, Mapping):
        raise ControllerFileError(f"{where} is {_kind_of(value)}; expected a mapping of words to words")
    return tuple(sorted((_text(key, where), _fact(fact, f"{where}: {key}")) for key, fact in value.items()))


def _fact(value: Any, where: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int | float) else _text(value, where)


def _wire(value: Any, where: str) -> model.Wire:
    return model.Wire(*_read(value, where, {"from": _text, "to": _text}).values())


#: Words that name an operator or a method; `controller_problems` refuses unknown ones.
_OPERATORS: Readers = dict.fromkeys(("and_operator", "or_operator"), _text)
_METHODS: Readers = dict.fromkeys(("defuzzifier", "accumulation", "aggregation"), _text)


def _system(value: Any, where: str) -> model.FuzzySystem:
    """Read a system from plain data."""
    variables: Readers = {"inputs": _each(_variable, MOST_INPUTS), "outputs": _each(_output, MOST_TERMS)}
    required: Readers = {"name": _text, **variables, "rules": lambda rules, _: rules}
    content = _read(
        value,
        where,
        required,
        {**_OPERATORS, **dict.fromkeys(("defuzzifier", "implication", "semantics", "type_reduction"), _text)},
    )
    rules = _rules(content.pop("rules"), f"{where}.rules", content["inputs"], content["outputs"])
    return model.FuzzySystem(rules=rules, **content)


def _output(value: Any, where: str) -> model.Variable:
    return _variable(value, where, NO_KEYS, {"default": _number, **_METHODS})


def _variable(value: Any, where: str, default: Readers = NO_KEYS, more: Readers = NO_KEYS) -> model.Variable:
    """Read a variable from plain data; `default` and `more` are the readers of an output's keys."""
    is_listed = isinstance(value, Mapping) and "universe" in value
    required: Readers = {
        "name": _text,
        "universe" if is_listed else "range": _numbers,
        "terms": _each(_term, MOST_TERMS),
    }
    optional: Readers = {"unit": _text, "points": _count, "description": _text, "clip": _flag}
    content = {"unit": "", **_read(value, where, {**required, **default}, {**optional, **more})}
    content["is_clipped"] = content.pop("clip", False)
    num_points, points = content.pop("points", None), content.pop("universe", None)
    if points is not None:
        if not points or num_points not in (None, len(points)):
            raise ControllerFileError(
                f"{where}.universe has {len(points)} numbers; list every point, drop 'points'"
            )
        low, high = points[0], points[-1]
    else:
        ends = content.pop("range")
        if len(ends) != 2:
            raise ControllerFileError(f"{where}.range has {len(ends)} numbers; expected [lowest, highest]")
        low, high = ends
    num_points = len(points) if points else 101 if num_points is None else num_points
    return model.Variable(minimum=low, maximum=high, num_points=num_points, points=points, **content)


def _term(value: Any, where: str) -> model.Term:
    membership = _membership(value, where, ("name",))
    return model.Term(_text(value["name"], f"{where}.name"), membership)


def _membership(value: Any, where: str, more: Sequence[str] = ()) -> model.MembershipFunction:
    """Read a shape, whose mapping has the keys of its numbers, and more."""
    shape = _shape_of(value, where)
    _check_keys(value, where, (*more, *_keys(shape)), ("shape",))
    if shape == "between" and more:
        bounds = (_membership(value[key], f"{where}.{key}") for key in _keys(shape))
        return model.Between(*bounds)
    if shape == "between":
        raise ControllerFileError(f"{where} is an interval type-2 set inside of one; write a shape")
    readers: dict[str, Any] = {
        "values": _numbers,
        "coefficients": _numbers,
        "text": _text,
        "x": _numbers,
        "y": _numbers,
    }
    parameters = {key: readers.get(key, _number)(value[key], f"{where}.{key}") for key in _keys(shape)}
    return SHAPES[shape](**parameters)


def _shape_of(value: Any, where: str) -> str:
    """Return the shape of a term: the one it names, or the one that most of its keys belong to."""
    if not isinstance(value, Mapping):
        raise ControllerFileError(
            f"{where} is {_kind_of(value)}; expected a mapping with name, mean, standard_deviation"
        )
    if "shape" in value:
        shape = _text(value["shape"], f"{where}.shape")
        require_known([shape], SHAPES, f"{where}: unknown shape", ControllerFileError)
        return shape
    given = set(value)
    missed = {shape: len(set(_keys(shape)) - given) for shape in _KNOWN_BY_KEYS}
    return max(_KNOWN_BY_KEYS, key=lambda shape: (len(_keys(shape)) - missed[shape], -missed[shape]))


def _keys(shape: str) -> tuple[str, ...]:
    """Return the keys of a shape, which are the names of its parameters."""
    return tuple(field.name for field in fields(SHAPES[shape]))


def _rules(
    value: Any, where: str, inputs: tuple[model.Variable, ...], outputs: tuple[model.Variable, ...]
) -> tuple[model.Rule, ...]:
    """Read rules, one by one or as a table of terms."""
    if not isinstance(value, Sequence) or not value or not all(isinstance(rule, str) for rule in value):
        return tuple(_items(value, where, _rule, MOST_RULES))
    if len(value) > MOST_RULES:
        raise ControllerFileError(f"{where} has {len(value)} entries; at most {MOST_RULES} are read")
    if len(outputs) != 1:
        raise ControllerFileError(
            f"{where} is a table of terms but the system has {len(outputs)} outputs; write each rule as "
            "{if: ..., then: [...]}"
        )
    with raised_as(ControllerFileError, ValueError, where=f"{where}: "):
        return model.table_rules(inputs, outputs[0], value)


def _rule(value: Any, where: str) -> model.Rule:
    """Read a rule."""
    content = _read(
        value, where, {"if": _expression, "then": _each(_consequent)}, {"label": _text, **_OPERATORS}
    )
    return model.Rule(content.pop("if"), content.pop("then"), **content)


def _consequent(value: Any, where: str) -> model.Consequent:
    return model.Consequent(**_read(value, where, {"variable": _text, "term": _text}, {"weight": _number}))


def _expression(value: Any, where: str, depth: int = 0) -> model.Expression:
    """Read an antecedent from plain data, such as ``{and: [{is: [x, low]}, ...]}``."""
    if not isinstance(value, Mapping) or len(value) != 1:
        raise ControllerFileError(
            f"{where} is {_kind_of(value)}; expected one of is, not, and, or, or a hedge, with its operands"
        )
    if depth > MAX_NESTING:
        raise ControllerFileError(f"{where} is nested more than {MAX_NESTING} deep; split the rule")
    ((word, operand),) = value.items()
    if word == "is":
        pair = _items(operand, f"{where}.is", _text)
        if len(pair) != 2:
            raise ControllerFileError(f"{where}.is has {len(pair)} words; expected [variable, term]")
        return model.Is(*pair)
    if word == "not" or word in HEDGES:
        inside = _expression(operand, f"{where}.{word}", depth + 1)
        return model.Not(inside) if word == "not" else model.Hedged(word, inside)
    if word in {"and", "or"}:
        operands = _items(
            operand, f"{where}.{word}", lambda item, location: _expression(item, location, depth + 1)
        )
        return model.And(tuple(operands)) if word == "and" else model.Or(tuple(operands))
    raise ControllerFileError(
        f"{where}: unknown word {word!r}; {suggestion(str(word), ('is', 'not', 'and', 'or', *HEDGES))}"
    )
