"""The comment by which a foreign file carries what its format has no place for, and how it is read back.

The comment is one line: a mark with a version, then the whole controller as JSON, as
`fis_tools.formats.mapping` describes it. It counts only as far as the file still shows what the
controller looks like in this format. Where a person has changed the file, what can be seen counts alone.
Reading it executes nothing.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace

from fis_tools.errors import ControllerFileError
from fis_tools.formats import notation, serialize
from fis_tools.formats.exchange.antecedents import ANY, NotExpressible, any_term
from fis_tools.formats.exchange.dialect import (
    INPUT_POINTS,
    OUTPUT_POINTS,
    Dialect,
    corners_of,
    express,
    middle,
    refuse_joined,
)
from fis_tools.formats.mapping import from_mapping, refuse_problems, to_mapping
from fis_tools.formats.notation import Unreadable
from fis_tools.formats.serialize import Reading
from fis_tools.model import FuzzyController, FuzzySystem
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
    note = "the file was changed after it was written: what it shows counts, and its comment is left out"
    return Reading(
        FuzzyController(visible.name, (complete,), provenance=(EDITED,)),
        (note, *_assumptions(visible, dialect), *found),
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
