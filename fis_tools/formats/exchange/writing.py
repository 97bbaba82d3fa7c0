"""Systems written for other programs, and what is lost: a template for each form, filled in with its words.

Other programs evaluate the formulas of inputs themselves, cut the terms of an output at points of their own,
and sum over these: MATLAB and Octave at the 101 points of `linspace`, fuzzylite in the middles of the
intervals that a file states. Both take a point for as wide as a step; scikit-fuzzy integrates straight lines
between the points of its universe. The difference grows as a universe gets coarser.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Any

from fis_tools import model
from fis_tools.formats import rendered
from fis_tools.formats.exchange import vocabulary
from fis_tools.formats.exchange.carried import comment
from fis_tools.formats.exchange.dialect import Dialect, Expressed, express, only_system
from fis_tools.formats.exchange.foreign import RAMPS, TABLES
from fis_tools.formats.serialize import Written
from fis_tools.model.shape import Format
from fis_tools.words.text import number


def written(
    controller: model.FuzzyController,
    dialect: Dialect,
    template: str,
    facts: Callable[[Expressed], dict[str, Any]],
) -> Written:
    """Write a controller with one system.

    Parameters
    ----------
    controller : FuzzyController
    dialect : Dialect
    template : str
        Asks for the `system` as the format expresses it, the comment that is `carried`, the operators and
        defuzzifiers, the `blocks` of rules, and what `facts` adds.
    facts : callable
        What only this format asks for.

    Raises
    ------
    fis_tools.formats.exchange.antecedents.NotExpressible
        If the format cannot say what the system computes.
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    carried = comment(controller)
    expressed = express(only_system(controller, dialect), dialect)
    words = {name: getattr(vocabulary, name) for name in ("AND", "OR", "AGGREGATIONS", "DEFUZZIFIERS")}
    text = rendered(
        f"exchange/{template}",
        system=expressed.system,
        carried=carried,
        blocks=_blocks(expressed.system),
        **words,
        **facts(expressed),
    )
    return Written(text, losses(controller, expressed, dialect))


def _blocks(system: model.FuzzySystem) -> list[tuple[str, str, list[tuple[int, model.Rule]]]]:
    """Return the rules, numbered, in blocks of one operator for `and` and one for `or`."""
    groups = groupby(
        enumerate(system.rules, start=1),
        key=lambda numbered: (system.and_operator_of(numbered[1]), system.or_operator_of(numbered[1])),
    )
    return [(*operators, list(rules)) for operators, rules in groups]


def term_words(variable: model.Variable, term: model.Term, file_format: Format) -> tuple[str, list[str]]:
    """Return the word of a term that a format has one for, and its numbers as they are written."""
    shape = term.membership
    match shape:
        case model.Sampled(values):
            points = zip(variable.universe.tolist(), values, strict=True)
            return TABLES[file_format], [repr(float(number)) for point in points for number in point]
        case model.Formula(text):
            return shape.entry.words[file_format][0], [text]
        case model.Ramp(start, end):
            return RAMPS[file_format], [repr(float(start)), repr(float(end))]
        case model.Linear(coefficients, constant):
            numbers = (*coefficients, constant)
            return shape.entry.words[file_format][0], [repr(float(number)) for number in numbers]
    word, *order = shape.entry.words[file_format]
    return word, [repr(float(getattr(shape, name))) for name in order or shape.entry.kinds]


def losses(controller: model.FuzzyController, expressed: Expressed, dialect: Dialect) -> tuple[str, ...]:
    """List what a file does not say of a controller with one system, one sentence each.

    Parameters
    ----------
    controller : FuzzyController
        What was to be written.
    expressed : Expressed
        What `express` made of its system.
    dialect : Dialect
        The format.
    """
    found = [
        f"{what}: {_listed(items)}" for what, items in _differences(controller, expressed, dialect) if items
    ]
    if found and dialect.is_read:
        found.append(
            "a comment in the file carries all of this: fis_tools reads it back, other programs do not"
        )
    return tuple(found)


def _differences(
    controller: model.FuzzyController, expressed: Expressed, dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    (system,) = controller.systems
    originals = (*system.inputs, *system.outputs)
    pairs = list(zip(originals, (*expressed.system.inputs, *expressed.system.outputs), strict=True))
    names = [(system.name, expressed.system.name)]
    for variable, other in pairs:
        names.append((variable.name, other.name))
        names += ((t.name, o.name) for t, o in zip(variable.terms, other.terms, strict=False))
    yield "names become identifiers", [f"{old!r} is {new}" for old, new in dict.fromkeys(names) if old != new]
    yield from _variable_differences(pairs, dialect)
    changed = [
        f"{place} as {len(group)}" if len(group) > 1 else f"{place} in another form"
        for place, (rule, group) in enumerate(zip(system.rules, expressed.rules, strict=True), start=1)
        if not _is_word_for_word(rule, group)
    ]
    yield "rules are written otherwise, with the same meaning", changed
    yield "labels of rules are left out", [rule.label for rule in system.rules if rule.label]
    yield "attributes are left out", [key for key, _ in controller.attributes]
    yield "the purpose is left out", [controller.name] if controller.purpose else []
    yield "provenance is left out", [key for key, _ in controller.provenance]
    if controller.name != expressed.system.name:
        yield "the controller's name is left out", [controller.name]


def _variable_differences(
    pairs: Sequence[tuple[model.Variable, model.Variable]], dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    yield "units are left out", [f"{v.name} in {v.unit}" for v, _ in pairs if v.unit]
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


def _is_word_for_word(rule: model.Rule, group: Sequence[model.Rule]) -> bool:
    """Return whether a rule became one rule of the same form."""
    if len(group) != 1 or len(rule.consequents) != len(group[0].consequents):
        return False
    forms = (model.with_statements(each.antecedent, lambda _: model.Is("", "")) for each in (rule, *group))
    return len(set(forms)) == 1


def _listed(items: Sequence[str], most: int = 4) -> str:
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more
