"""Systems written for other programs, and what is lost: a template for each form, filled in with its words.

Other programs evaluate the formulas of inputs themselves, cut the terms of an output at points of their own,
and sum over these: MATLAB and Octave at the 101 points of `linspace`, fuzzylite in the middles of the
intervals that a file states. Both take a point for as wide as a step; scikit-fuzzy integrates straight lines
between the points of its universe. The difference grows as a universe gets coarser.

A comment carries what a form has no place for. It is one line: a mark with a version, then the whole
controller as JSON, as `fis_tools.formats.mapping` describes it. It counts only as far as the file still shows
what the controller looks like in this format. Where a person has changed the file, what can be seen counts
alone. Reading it executes nothing.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

from fis_tools import model
from fis_tools.errors import ControllerFileError, raised_as
from fis_tools.formats import notation, rendered, serialize
from fis_tools.formats.exchange import dialect as dialects
from fis_tools.formats.exchange import vocabulary
from fis_tools.formats.exchange.antecedents import ANY, NotExpressible, any_term
from fis_tools.formats.exchange.dialect import Dialect, Expressed, express, only_system
from fis_tools.formats.exchange.fcl_words import FUNCTIONS
from fis_tools.formats.exchange.foreign import RAMPS, TABLES
from fis_tools.formats.mapping import from_mapping, refuse_problems, to_mapping
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model import TOOLS, FuzzyController, FuzzySystem, Rule, Term, Variable, numbers, sample
from fis_tools.model.intervals import has_intervals
from fis_tools.model.membership import Format
from fis_tools.model.systems import reach
from fis_tools.words.text import number


def written(
    controller: FuzzyController, dialect: Dialect, template: str, facts: Callable[[Expressed], dict[str, Any]]
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
    fis_tools.errors.Mistake
        If something is wrong with the controller, or it has several systems.
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


def _blocks(system: FuzzySystem) -> list[tuple[str, str, list[tuple[int, Rule]]]]:
    """Return the rules, numbered, in blocks of one operator for `and` and one for `or`."""
    groups = groupby(
        enumerate(system.rules, start=1),
        key=lambda numbered: (system.and_operator_of(numbered[1]), system.or_operator_of(numbered[1])),
    )
    return [(*operators, list(rules)) for operators, rules in groups]


def term_words(term: Term, file_format: Format, is_set: bool) -> tuple[str, list[str]]:
    """Return the word of a term that a format has one for, and its numbers as they are written."""
    shape = term.membership
    if file_format == "fcl":
        return _fcl_words(shape)
    match shape:
        case model.Polyline(x, y):
            points = zip(x, y, strict=True)
            return TABLES[file_format], [repr(float(number)) for point in points for number in point]
        case model.Formula(text):
            return shape.entry.words[file_format][0], [text]
        case model.Ramp(start, end):
            word = RAMPS[file_format]
            if file_format == "fis" and is_set:  # MATLAB knows it by two words
                word, start, end = ("linsmf", start, end) if start < end else ("linzmf", end, start)
            return word, [repr(float(start)), repr(float(end))]
        case model.Linear(coefficients, constant):
            factors = (*coefficients, constant)
            return shape.entry.words[file_format][0], [repr(float(factor)) for factor in factors]
    word, *order = shape.entry.words[file_format]
    return word, [repr(float(getattr(shape, name))) for name in order or shape.entry.kinds]


def _fcl_words(shape: model.MembershipFunction) -> tuple[str, list[str]]:
    """Return a term in the words of FCL, where numbers are formulas and tables are points in parentheses."""
    match shape:
        case model.Polyline(x, y):
            return "", [f"({float(a)!r}, {float(b)!r})" for a, b in zip(x, y, strict=True)]
        case model.Constant(value):
            return "", [repr(float(value))]
        case model.Formula():
            return "FUNCTION", [_in_fcl(shape.parsed)]
        case model.Cosine(centre, width):  # by half its width
            return "COSINE", [repr(0.5 * float(width)), repr(float(centre))]
    word, *order = shape.entry.words["fcl"]
    return word, [repr(float(getattr(shape, name))) for name in order or shape.entry.kinds]


def _in_fcl(part: numbers.Part) -> str:
    """Return a formula with the functions that jFuzzyLogic has; its log is the decimal one."""
    if not part.parts:
        return part.word or repr(part.number)
    texts = [_in_fcl(each) for each in part.parts]
    if part.word not in numbers.FUNCTIONS:
        return f"({f' {part.word} '.join(texts)})"
    words = {ours: word for word, ours in FUNCTIONS.items()} | {"abs": "abs"}
    if part.word not in words:
        raise NotExpressible(
            f"a formula has {part.word}(), and FCL knows only {', '.join(FUNCTIONS)}; export as fll or json"
        )
    return f"{words[part.word]}({', '.join(texts)})"


def losses(controller: FuzzyController, expressed: Expressed, dialect: Dialect) -> tuple[str, ...]:
    """List what a file cannot hold of a controller with one system, one sentence each.

    Parameters
    ----------
    controller : FuzzyController
        What was to be written.
    expressed : Expressed
        What `express` made of its system.
    dialect : Dialect
        The format.
    """
    sentences = [
        f"{what}: {_listed(items)}" for what, items in _differences(controller, expressed, dialect) if items
    ]
    if sentences and dialect.is_read:
        sentences.append(
            "a comment in the file carries all of this: fis_tools reads it back, other programs do not"
        )
    return tuple(sentences)


def _differences(
    controller: FuzzyController, expressed: Expressed, dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    """Yield what a file says otherwise than the controller: a kind of difference, and the places."""
    (system,) = controller.systems
    pairs = list(zip(system.variables, expressed.system.variables, strict=True))
    names = [(system.name, expressed.system.name)]
    for variable, other in pairs:
        names.append((variable.name, other.name))
        names += ((t.name, o.name) for t, o in zip(variable.terms, other.terms, strict=False))
    yield "names become identifiers", [f"{old!r} is {new}" for old, new in dict.fromkeys(names) if old != new]
    yield from _variable_differences(pairs, dialect)
    changed = [
        f"{rule_number} as {len(group)}" if len(group) > 1 else f"{rule_number} in another form"
        for rule_number, (rule, group) in enumerate(zip(system.rules, expressed.rules, strict=True), start=1)
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
    pairs: Sequence[tuple[Variable, Variable]], dialect: Dialect
) -> Iterator[tuple[str, list[str]]]:
    """Yield what a file says otherwise of variables: a kind of difference, and the places."""
    yield "units are left out", [f"{v.name} in {v.unit}" for v, _ in pairs if v.unit]
    yield "descriptions are left out", [v.name for v, o in pairs if v.description != o.description]
    points = [
        f"{v.name} {v.num_points}" + (" uneven ones" if v.points else "")
        for v, o in pairs
        if (v.num_points, v.points) != (o.num_points, o.points)
    ]
    yield "the points of universes are left out, and readers choose their own", points
    defaults = [f"{v.name} {number(v.default)}" for v, _ in pairs if v.default is not None]
    yield "the output when no rule fires is left out", [] if dialect.holds_defaults else defaults
    terms = [
        f"{v.name} {term.name}"
        for v, o in pairs
        for term, other in zip(v.terms, o.terms, strict=False)
        if term.membership != other.membership
    ]
    yield "membership functions are written otherwise, with the same meaning inside the range", terms


def _is_word_for_word(rule: Rule, group: Sequence[Rule]) -> bool:
    """Return whether a rule became one rule of the same form."""
    if len(group) != 1 or len(rule.consequents) != len(group[0].consequents):
        return False
    forms = (model.with_statements(each.antecedent, lambda _: model.Is("", "")) for each in (rule, *group))
    return len(set(forms)) == 1


def _listed(items: Sequence[str]) -> str:
    more = f" and {len(items) - 4} more" if len(items) > 4 else ""
    return ", ".join(items[:4]) + more


#: What the comment begins with; the number is the version of this way of carrying.
MARK = "fis_tools carries 1: "
_ANY_MARK = "fis_tools carries "
#: A fact of a controller whose file was changed after it was written.
EDITED = (serialize.EDITED, "by hand in an exchange file, after that was written")


def comment(controller: FuzzyController) -> str:
    """Return a controller as one line of ASCII that ends no comment of any format.

    Raises
    ------
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    content = json.dumps(to_mapping(controller), separators=(",", ":"), allow_nan=False)
    return MARK + content.replace("--", "-\\u002d").replace("*", "\\u002a")


def understand(visible: FuzzySystem, comments: Iterable[tuple[int, str]], dialect: Dialect) -> Reading:
    """Complete the system of a file by its comment, or by assumptions.

    Parameters
    ----------
    visible : FuzzySystem
        What the file shows; an output's default is None where it states none.
    comments : iterable of (line number, text)
        All comments of the file, without their signs.
    dialect : Dialect
        The format.

    Raises
    ------
    ControllerFileError
        If the comment is damaged, or the system has problems.
    """
    carried = _find(comments)
    visible, missing = _with_what_is_missing(visible)
    complete = visible
    if not TOOLS[visible.semantics].has_outputs_without_default:
        outputs = (
            replace(v, default=dialects.middle(v.minimum, v.maximum)) if v.default is None else v
            for v in visible.outputs
        )
        complete = replace(visible, outputs=tuple(outputs))
    refuse_problems(FuzzyController(visible.name, (complete,)))
    with raised_as(ControllerFileError, NotExpressible):
        dialects.refuse_joined(complete)
    about_points = (_universes_words(visible, dialect), *jumps_between_points(visible))
    assumed = (*about_points, *_beyond_words(visible), *_defaults_words(visible), *missing)
    if carried is None:
        return Reading(FuzzyController(visible.name, (complete,)), assumed, about_points)
    try:
        expressed = express(carried.systems[0], dialect)
    except NotExpressible as error:
        raise ControllerFileError(
            f"the comment '{_ANY_MARK}…' is not of this file ({error}); delete it to read what the file shows"
        ) from error
    if _without_idle_operators(expressed.system) == _without_idle_operators(complete):
        return Reading(carried, ())
    note = "the file was changed after it was written: what it shows counts, and its comment is left out"
    edited = serialize.renamed(FuzzyController(visible.name, (complete,), provenance=(EDITED,)))
    return Reading(edited, (note, *assumed), about_points)


def _without_idle_operators(system: FuzzySystem) -> FuzzySystem:
    """Return a system without operators that none of its rules uses: files do not state these."""
    plain = FuzzySystem("", (), (), ())
    kinds = {type(part) for rule in system.rules for part in model.parts_of(rule.antecedent)}
    return replace(
        system,
        and_operator=system.and_operator if model.And in kinds else plain.and_operator,
        or_operator=system.or_operator if model.Or in kinds else plain.or_operator,
        type_reduction=system.type_reduction if has_intervals(system) else plain.type_reduction,
    )


def _find(comments: Iterable[tuple[int, str]]) -> FuzzyController | None:
    """Return the controller that a comment of our own carries; None without such a comment."""
    marked = [(line, text.strip()) for line, text in comments if text.strip().startswith(_ANY_MARK)]
    if not marked:
        return None
    line, text = marked[0]
    cure = "get a whole copy, or delete this comment to read what the file shows"
    if len(marked) > 1:
        raise ControllerFileError(f"line {marked[1][0]}: a second comment '{_ANY_MARK}…'; keep one of them")
    if not text.startswith(MARK):
        raise ControllerFileError(
            f"line {line}: the comment is not of version {MARK.strip(' :')!r}; read the file with the "
            "program that wrote it, or delete this comment to read what the file shows"
        )
    try:
        controller = from_mapping(notation.read_json(text.removeprefix(MARK)))
    except ControllerFileError as error:
        raise ControllerFileError(f"line {line}: the comment is damaged ({error}); {cure}") from error
    if len(controller.systems) != 1:
        raise ControllerFileError(f"line {line}: the comment carries several systems; {cure}")
    return controller


def _with_what_is_missing(visible: FuzzySystem) -> tuple[FuzzySystem, list[str]]:
    """Complete a system with weighted outputs as other programs do; return notes on what was done.

    Numbers linear in an input need no terms of it, and outputs that are weighed no range.
    """
    inputs, outputs, notes = list(visible.inputs), list(visible.outputs), []
    for index, variable in enumerate(inputs if visible.weighed else ()):
        if not variable.terms:
            inputs[index] = replace(variable, terms=(any_term(variable),))
            notes.append(
                f"{visible.name}: {variable.name} has no terms, and gets {ANY!r}, which all belong to"
            )
    for index, output in enumerate(outputs):
        if visible.weighs(output) and output.minimum == output.maximum:
            low, high = reach(output, inputs)
            outputs[index] = replace(output, minimum=low, maximum=high)
            notes.append(
                f"{visible.name}: the range of {output.name} is empty, and becomes what its terms reach, "
                f"{number(low)} to {number(high)}"
            )
    return replace(visible, inputs=tuple(inputs), outputs=tuple(outputs)), notes


def _universes_words(visible: FuzzySystem, dialect: Dialect) -> str:
    """Return at which points numbers are those of the program, where the file does not say."""
    title = TOOLS[visible.semantics].title
    points = f"{dialects.OUTPUT_POINTS} points of each output"
    if visible.semantics == "fcl":
        points = f"{dialect.output_points - 1} intervals of each output"
    if dialect.resolution:
        points = f"{dialect.resolution} intervals of an output that states no number"
    return f"{visible.name}: numbers are those of {title}, which sums over {points}"


def _beyond_words(visible: FuzzySystem) -> Iterator[str]:
    """Yield what becomes of inputs beyond their ranges, unless the file has all of them clipped."""
    clipped = [variable.name for variable in visible.inputs if variable.is_clipped]
    but = f", but {', '.join(clipped)} clipped" if clipped else ""
    if len(clipped) < len(visible.inputs):
        yield f"{visible.name}: inputs beyond their ranges are taken as they are{but}"


def _defaults_words(visible: FuzzySystem) -> Iterator[str]:
    """Yield what each output without a stated default is when no rule fires."""
    for output in visible.outputs:
        if output.default is None and TOOLS[visible.semantics].has_outputs_without_default:
            yield f"{visible.name}: {output.name} is no number (NaN) when no rule fires, as the file says"
        elif output.default is None:
            middle = number(dialects.middle(output.minimum, output.maximum))
            yield f"{visible.name}: {output.name} is {middle} when no rule fires, the middle of its range"


def jumps_between_points(system: FuzzySystem) -> Iterator[str]:
    """Return notes on jumps between two points of an output's universe, where other programs sample."""
    for output in system.outputs:
        for term in output.terms:
            _, jumps = dialects.corners_of(output.minimum, output.maximum, [term.membership])
            between = [x for x in jumps if x not in output.universe]
            if not between:
                continue
            fact = "where it is a slope one step wide"
            if not sample(output, term).any():
                fact = "and is zero on all of them, so that its rules conclude nothing"
            yield (
                f"{system.name}: {output.name} {term.name} jumps at {number(between[0])}, between two points "
                f"of its universe, {fact}; give the output more points"
            )
