"""What a file of another program cannot hold of a controller, in sentences."""

from collections.abc import Iterator, Sequence

from fis_tools.formats.exchange.dialect import Dialect, Said
from fis_tools.formats.exchange.elsewhere import changes
from fis_tools.model import And, Expression, FuzzyController, FuzzySystem, Hedged, Is, Not, Or, Rule, Variable
from fis_tools.words.text import number


def losses(controller: FuzzyController, said: Said, dialect: Dialect) -> tuple[str, ...]:
    """List what a file does not say of a controller with one system, one sentence each.

    Parameters
    ----------
    controller : FuzzyController
        What was to be written.
    said : Said
        What `say` made of its system.
    dialect : Dialect
        The format.
    """
    found = [f"{what}: {_listed(items)}" for what, items in _differences(controller, said, dialect) if items]
    moved = list(changes(controller.systems[0], said, takes_middles=dialect.holds_resolution))
    if moved:
        found.append(f"other programs sample in ways of their own, so that answers differ: {_listed(moved)}")
    if found and dialect.is_read:
        found.append(
            "a comment in the file carries all of this: fis_tools reads it back, other programs do not"
        )
    return tuple(found)


def _differences(
    controller: FuzzyController, said: Said, dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    (system,) = controller.systems
    originals = (*system.inputs, *system.outputs)
    pairs = list(zip(originals, (*said.system.inputs, *said.system.outputs), strict=True))
    names = [(system.name, said.system.name)]
    for variable, other in pairs:
        names.append((variable.name, other.name))
        names += ((t.name, o.name) for t, o in zip(variable.terms, other.terms, strict=False))
    yield "names become identifiers", [f"{old!r} is {new}" for old, new in dict.fromkeys(names) if old != new]
    yield from _variable_differences(pairs, dialect)
    made = [f"{v.name} is {t.name}" for v in said.source.inputs for t in v.terms[_count(system, v) :]]
    yield "hedged statements become terms of their own, sampled", made
    changed = [
        f"{place} as {len(group)}" if len(group) > 1 else f"{place} in another form"
        for place, (rule, group) in enumerate(zip(system.rules, said.rules, strict=True), start=1)
        if not _is_word_for_word(rule, group)
    ]
    yield "rules are written otherwise, with the same meaning", changed
    yield "labels of rules are left out", [rule.label for rule in system.rules if rule.label]
    yield "attributes are left out", [key for key, _ in controller.attributes]
    yield "provenance is left out", [key for key, _ in controller.provenance]
    if controller.name != said.system.name:
        yield "the controller's name is left out", [controller.name]


def _count(system: FuzzySystem, variable: Variable) -> int:
    return len(system.variable(variable.name).terms)


def _variable_differences(
    pairs: Sequence[tuple[Variable, Variable]], dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    yield "units are left out", [f"{v.name} in {v.unit}" for v, o in pairs if v.unit != o.unit]
    yield "descriptions are left out", [v.name for v, o in pairs if v.description != o.description]
    yield (
        "the points of universes are left out, and readers choose their own",
        [
            f"{v.name} {v.num_points}" + (" uneven ones" if v.points else "")
            for v, o in pairs
            if (v.num_points, v.points) != (o.num_points, o.points)
        ],
    )
    defaults = [f"{v.name} {number(v.default)}" for v, _ in pairs if v.default is not None]
    yield "the output when no rule fires is left out", [] if dialect.holds_defaults else defaults
    yield (
        "membership functions are written otherwise, with the same meaning inside the range",
        [
            f"{v.name} {term.name}"
            for v, o in pairs
            for term, other in zip(v.terms, o.terms, strict=False)
            if term.membership != other.membership
        ],
    )


def _is_word_for_word(rule: Rule, group: Sequence[Rule]) -> bool:
    """Return whether a rule became one rule of the same form."""
    if len(group) != 1 or len(rule.consequents) != len(group[0].consequents):
        return False
    return _form(rule.antecedent) == _form(group[0].antecedent)


def _form(expression: Expression) -> object:
    match expression:
        case Is():
            return "is"
        case Not(operand):
            return ("not", _form(operand))
        case Hedged(hedge, operand):
            return (hedge, _form(operand))
        case And(operands) | Or(operands):
            return (type(expression), tuple(_form(operand) for operand in operands))


def _listed(items: Sequence[str], most: int = 4) -> str:
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more
