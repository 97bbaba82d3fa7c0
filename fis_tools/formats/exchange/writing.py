"""Systems written for other programs, and what is lost: a template for each form, filled in with its words.

Other programs evaluate the formulas of inputs themselves, cut the terms of an output at points of their own,
and sum over these: MATLAB and Octave at the 101 points of `linspace`, fuzzylite in the middles of the
intervals that a file states. Both take a point for as wide as a step; scikit-fuzzy integrates straight lines
between the points of its universe. The difference grows as a universe gets coarser.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats
from fis_tools.engines import inference
from fis_tools.formats import rendered
from fis_tools.formats.exchange import vocabulary
from fis_tools.formats.exchange.carried import comment
from fis_tools.formats.exchange.dialect import Dialect, Expressed, express, only_system
from fis_tools.formats.exchange.foreign import RAMPS, TABLES
from fis_tools.formats.serialize import Written
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS
from fis_tools.model.shape import Format
from fis_tools.model.variables import shape_values
from fis_tools.words.text import number


def written(
    controller: model.FuzzyController,
    dialect: Dialect,
    template: str,
    facts: Callable[[Expressed], dict[str, Any]],
    limited_support: Callable[[model.FuzzySystem], Iterable[str]] = lambda _: (),
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
    limited_support : callable
        What only some readers of the format understand, in sentences.

    Raises
    ------
    fis_tools.formats.exchange.antecedents.NotExpressible
        If the format cannot say what the system computes.
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    carried = comment(controller)
    expressed = express(only_system(controller, dialect), dialect)
    words = {
        name: getattr(vocabulary, name) for name in ("AND", "OR", "AGGREGATIONS", "DEFUZZIFIERS", "HEDGES")
    }
    text = rendered(
        f"exchange/{template}",
        system=expressed.system,
        carried=carried,
        blocks=_blocks(expressed.system),
        **words,
        **facts(expressed),
    )
    return Written(text, (*losses(controller, expressed, dialect), *limited_support(expressed.system)))


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


#: Inputs at which answers are compared, the most and the fewest; fewer of many points, which take longer.
SAMPLES = 256, 16
POINTS = 20_000
#: The share of an output's range from which on a change is told.
NOTABLE = 1e-3


def changes(original: model.FuzzySystem, expressed: Expressed, *, takes_middles: bool) -> Iterator[str]:
    """Tell for each output how far the answers of other programs are from those of the original.

    Parameters
    ----------
    original : FuzzySystem
        What was written.
    expressed : Expressed
        What a reader of the file sees.
    takes_middles : bool
        Whether the readers sample the middles of intervals, as fuzzylite does.
    """
    low, high = (np.array([getattr(v, end) for v in original.inputs]) for end in ("minimum", "maximum"))
    most, fewest = SAMPLES
    count = min(most, max(fewest, POINTS // max(v.num_points for v in original.outputs)))
    samples = np.random.default_rng(0).random((count, len(low))) * (high - low) + low
    ours = inference.evaluate(original, samples)
    theirs = answers(expressed.system, samples, takes_middles=takes_middles)
    for output, change in zip(original.outputs, np.abs(ours - theirs).max(axis=0), strict=True):
        share = change / (output.maximum - output.minimum)
        if share >= NOTABLE:
            amount = number(float(f"{change:.2g}"))
            yield f"{output.name} by up to {amount}, {100 * share:.2g} % of its range"


def answers(system: model.FuzzySystem, samples: Floats, *, takes_middles: bool) -> Floats:
    """Return the outputs, (n, num_outputs), as sums over points, for samples (n, num_inputs)."""
    firing = inference.firing_strengths(system, samples)
    columns = []
    for place, output in enumerate(system.outputs):
        if system.weighs(output):
            columns.append(inference.evaluate(system, samples)[:, place])
            continue
        edges = np.linspace(output.minimum, output.maximum, output.num_points)
        points = 0.5 * (edges[1:] + edges[:-1]) if takes_middles else output.universe
        heights = _heights(system, output, firing, points)
        columns.append(_defuzzified(system.defuzzifier_of(output), points, heights, output))
    return np.stack(columns, axis=1)


def _heights(system: model.FuzzySystem, output: model.Variable, firing: Floats, points: Floats) -> Floats:
    """Return what the rules conclude together, (n, points)."""
    strengths: dict[str, list[Floats]] = {}
    for strength, rule in zip(firing.T, system.rules, strict=True):
        for consequent in rule.consequents:
            if consequent.variable == output.name:
                strengths.setdefault(consequent.term, []).append(consequent.weight * strength)
    imply, aggregate = AND_OPERATORS[system.implication], AGGREGATIONS[output.aggregation]
    heights = np.zeros((len(firing), len(points)))
    for term, activations in strengths.items():
        shape = output.terms[output.term_index(term)].membership
        if isinstance(shape, model.Sampled):
            degrees = np.interp(points, output.universe, shape.values)
        else:
            degrees = shape_values(points, shape)
        each = [np.max(activations, axis=0)] if output.counts_strongest else activations
        for activation in each:
            heights = aggregate(heights, imply(activation[:, np.newaxis], degrees[np.newaxis]))
    return heights


def _defuzzified(defuzzifier: str, points: Floats, heights: Floats, output: model.Variable) -> Floats:
    total = heights.sum(axis=1)
    fires = total > 0.0
    found = np.full(len(heights), output.default, dtype=np.float64)
    top = heights == heights.max(axis=1, keepdims=True)
    match defuzzifier:
        case "centroid":
            values = heights @ points / np.where(fires, total, 1.0)
        case "bisector":
            values = points[np.argmax(np.cumsum(heights, axis=1) >= 0.5 * total[:, np.newaxis], axis=1)]
        case "som":
            values = points[np.argmax(top, axis=1)]
        case "lom":
            values = points[top.shape[1] - 1 - np.argmax(top[:, ::-1], axis=1)]
        case _:
            values = (top @ points) / top.sum(axis=1)
    found[fires] = values[fires]
    return found


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
    moved = list(changes(controller.systems[0], expressed, takes_middles=dialect.resolution > 0))
    if moved:
        found.append(f"other programs sample in ways of their own, so that answers differ: {_listed(moved)}")
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
    counts = [len(variable.terms) for variable in system.inputs]
    grown = zip(expressed.source.inputs, counts, strict=True)
    made = [f"{variable.name} is {term.name}" for variable, count in grown for term in variable.terms[count:]]
    yield "hedged statements become terms of their own, sampled", made
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
    yield (
        "ranges are left out, and readers take what the terms reach",
        [v.name for v, o in pairs if (v.minimum, v.maximum) != (o.minimum, o.maximum)],
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
    return _form(rule.antecedent) == _form(group[0].antecedent)


def _form(expression: model.Expression) -> object:
    match expression:
        case model.Is():
            return "is"
        case model.Not(operand):
            return ("not", _form(operand))
        case model.Hedged(hedge, operand):
            return (hedge, _form(operand))
        case model.And(operands) | model.Or(operands):
            return (type(expression), tuple(_form(operand) for operand in operands))


def _listed(items: Sequence[str], most: int = 4) -> str:
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more
