"""The comment by which a foreign file carries what its format has no place for, and how it is read back.

The comment is one line: a mark with a version, then the whole controller as JSON, as
`fis_tools.formats.mapping` describes it. It counts only as far as the file still shows what the
controller looks like in this format. Where a person has changed the file, what can be seen counts, and the
comment gives only what the change did not touch. Reading it executes nothing.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from fis_tools.errors import ControllerFileError
from fis_tools.formats import notation, serialize
from fis_tools.formats.exchange.antecedents import ANY, NotExpressible, Statement, any_term, mentions, renamed
from fis_tools.formats.exchange.dialect import (
    INPUT_POINTS,
    OUTPUT_POINTS,
    Dialect,
    Expressed,
    corners_of,
    express,
    middle,
    refuse_joined,
)
from fis_tools.formats.mapping import from_mapping, refuse_problems, to_mapping
from fis_tools.formats.notation import Unreadable
from fis_tools.formats.serialize import Reading
from fis_tools.model import FuzzyController, FuzzySystem, Rule, Sampled, Term, Variable
from fis_tools.model.systems import reach
from fis_tools.model.variables import sample
from fis_tools.words.text import number

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
    """Complete what a file shows with what its comment carries, or with assumptions.

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
    visible, found = _with_what_is_missing(visible)
    outputs = (
        replace(v, default=middle(v.minimum, v.maximum)) if v.default is None else v for v in visible.outputs
    )
    complete = replace(visible, outputs=tuple(outputs))
    refuse_problems(FuzzyController(visible.name, (complete,)))
    try:
        refuse_joined(complete)
    except NotExpressible as error:
        raise ControllerFileError(str(error)) from error
    if carried is None:
        return Reading(FuzzyController(visible.name, (complete,)), (*_assumptions(visible, dialect), *found))
    try:
        expressed = express(carried.systems[0], dialect)
    except NotExpressible as error:
        raise ControllerFileError(
            f"the comment '{_ANY_MARK}…' is not of this file ({error}); delete it to read what the file shows"
        ) from error
    if expressed.system == complete:
        return Reading(carried, ())
    adopted = FuzzyController(
        carried.name,
        (_adopt(complete, carried.systems[0], expressed),),
        carried.attributes,
        tuple(sorted({**dict(carried.provenance), **dict([EDITED])}.items())),
    )
    refuse_problems(adopted)
    return Reading(
        adopted,
        ("the file was changed after it was written: what it shows counts, its comment gives only the rest",),
    )


def _find(comments: Iterable[tuple[int, str]]) -> FuzzyController | None:
    found = [(line, text.strip()) for line, text in comments if text.strip().startswith(_ANY_MARK)]
    if not found:
        return None
    line, text = found[0]
    cure = "get a whole copy, or delete this comment to read what the file shows"
    if len(found) > 1:
        raise ControllerFileError(f"line {found[1][0]}: a second comment '{_ANY_MARK}…'; keep one of them")
    if not text.startswith(MARK):
        raise ControllerFileError(
            f"line {line}: the comment is not of version {MARK.strip(' :')!r}; read the file with the "
            "program that wrote it, or delete this comment to read what the file shows"
        )
    try:
        controller = from_mapping(notation.read_json(text.removeprefix(MARK)))
    except (Unreadable, ControllerFileError) as error:
        raise ControllerFileError(f"line {line}: the comment is damaged ({error}); {cure}") from error
    if len(controller.systems) != 1:
        raise ControllerFileError(f"line {line}: the comment carries several systems; {cure}")
    return controller


def _with_what_is_missing(visible: FuzzySystem) -> tuple[FuzzySystem, list[str]]:
    """Complete a system with outputs that are weighed as other programs do; tell of what was done.

    Numbers linear in an input need no terms of it, and outputs that are weighed no range.
    """
    inputs, outputs, notes = list(visible.inputs), list(visible.outputs), []
    for place, variable in enumerate(inputs if visible.weighed else ()):
        if not variable.terms:
            inputs[place] = replace(variable, terms=(any_term(variable),))
            notes.append(
                f"{visible.name}: {variable.name} has no terms, and gets {ANY!r}, which all belong to"
            )
    for place, output in enumerate(outputs):
        if visible.weighs(output) and output.minimum == output.maximum:
            low, high = reach(output, inputs)
            outputs[place] = replace(output, minimum=low, maximum=high)
            notes.append(
                f"{visible.name}: the range of {output.name} is empty, and becomes what its terms reach, "
                f"{number(low)} to {number(high)}"
            )
    return replace(visible, inputs=tuple(inputs), outputs=tuple(outputs)), notes


def _assumptions(visible: FuzzySystem, dialect: Dialect) -> tuple[str, ...]:
    points = f"{INPUT_POINTS} points for each input and "
    if dialect.resolution:
        points += f"{dialect.resolution + 1} for an output that states none, as fuzzylite takes"
    else:
        points += f"{OUTPUT_POINTS} for each output, as MATLAB takes"
    found = [f"{visible.name}: universes of {points}, more where corners or a table of points need them"]
    found += (f"{visible.name}: {sentence}" for sentence in _jumps_between_points(visible))
    found += (
        f"{visible.name}: {output.name} is {number(middle(output.minimum, output.maximum))} when no rule "
        "fires, the middle of its range"
        for output in visible.outputs
        if output.default is None
    )
    return tuple(found)


def _jumps_between_points(visible: FuzzySystem) -> Iterator[str]:
    """Tell of jumps between two points of an output's universe, on which other programs sample, too."""
    for output in visible.outputs:
        for term in output.terms:
            _, jumps = corners_of(output.minimum, output.maximum, [term.membership])
            between = [x for x in jumps if x not in output.universe]
            if not between:
                continue
            fact = "where it is a slope one step wide"
            if not sample(output, term).any():
                fact = "and is zero on all of them, so that its rules conclude nothing"
            yield (
                f"{output.name} {term.name} jumps at {number(between[0])}, between two points of its "
                f"universe, {fact}; give the output more points"
            )


# Adopting: what of the original still looks as it did when it was written.


def _adopt(visible: FuzzySystem, original: FuzzySystem, expressed: Expressed) -> FuzzySystem:
    """Take from the original every piece that the file still shows as it was written."""
    pairs = {
        shown.name: (source, shown)
        for source, shown in zip(
            (*original.inputs, *original.outputs),
            (*expressed.system.inputs, *expressed.system.outputs),
            strict=True,
        )
    }

    def adopted(variables: Sequence[Variable]) -> tuple[Variable, ...]:
        return tuple(_adopt_variable(v, *pairs[v.name]) if v.name in pairs else v for v in variables)

    inputs, outputs = adopted(visible.inputs), adopted(visible.outputs)
    everything = zip((*visible.inputs, *visible.outputs), (*inputs, *outputs), strict=True)
    names = {
        (shown.name, term.name): (known.name, other.name)
        for shown, known in everything
        for term, other in zip(shown.terms, known.terms, strict=True)
    }
    return replace(
        visible,
        name=original.name if visible.name == expressed.system.name else visible.name,
        inputs=inputs,
        outputs=outputs,
        rules=_adopt_rules(visible, original, expressed, names),
    )


def _adopt_variable(visible: Variable, original: Variable, expressed: Variable) -> Variable:
    terms = {
        shown.name: (source, shown) for source, shown in zip(original.terms, expressed.terms, strict=False)
    }
    is_same = {term.name: term.name in terms and term == terms[term.name][1] for term in visible.terms}
    extent = ("minimum", "maximum", "num_points", "points")
    keeps_universe = all(getattr(visible, key) == getattr(expressed, key) for key in extent) and all(
        is_same[term.name] for term in visible.terms if isinstance(term.membership, Sampled)
    )

    def adopted(term: Term) -> Term:
        if term.name not in terms:
            return term
        source = terms[term.name][0]
        takes_all = is_same[term.name] and (keeps_universe or not isinstance(source.membership, Sampled))
        return source if takes_all else Term(source.name, term.membership)

    keys = ("name", "unit", "default", "description", *(extent if keeps_universe else ()))
    kept = {key: getattr(original, key) for key in keys if getattr(visible, key) == getattr(expressed, key)}
    return replace(visible, terms=tuple(adopted(term) for term in visible.terms), **kept)


def _adopt_rules(
    visible: FuzzySystem, original: FuzzySystem, expressed: Expressed, names: Mapping[Statement, Statement]
) -> tuple[Rule, ...]:
    """Take each rule of the original whose wording still stands in one piece; name the others as it does."""
    waiting = dict(zip(expressed.rules, original.rules, strict=True))
    longest = max(map(len, waiting), default=1)
    is_same_system = all(
        getattr(visible, kind) == getattr(expressed.system, kind) for kind in ("and_operator", "or_operator")
    )
    known = set(names.values())  # of what rules of the original speak, what is still there
    rules: list[Rule] = []
    place = 0
    while place < len(visible.rules):
        for length in range(longest, 0, -1):
            group = visible.rules[place : place + length]
            if is_same_system and group in waiting and known.issuperset(mentions(waiting[group])):
                rules.append(_explicit(waiting.pop(group), original, visible))
                break
        else:
            length = 1
            rules.append(renamed(visible.rules[place], names))
        place += length
    return tuple(rules)


def _explicit(rule: Rule, original: FuzzySystem, visible: FuzzySystem) -> Rule:
    """Give a rule of the original its operators where those of the system are not the same any more."""
    if visible.and_operator != original.and_operator:
        rule = replace(rule, and_operator=original.and_operator_of(rule))
    if visible.or_operator != original.or_operator:
        rule = replace(rule, or_operator=original.or_operator_of(rule))
    return rule
