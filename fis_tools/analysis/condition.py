"""Conditions on variables as a person writes them, and the region of inputs that they define."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Booleans, Floats
from fis_tools.errors import require_known
from fis_tools.model import TOOLS, Inferable
from fis_tools.words.text import number, quantity

GRAMMAR = "write conditions as NAME > NUMBER, 2 NAME - OTHER <= NUMBER or NAME in [NUMBER, NUMBER]"
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
SEPARATORS = (",", "and")
#: of conditions that are read
MOST_CHARACTERS = 10_000


@dataclass(frozen=True)
class Condition:
    """``least <= sum(coefficient * variable) <= greatest``; a strict bound is stored as the next double.

    Parameters
    ----------
    text : str
        As it was written.
    coefficients : dict
        By the variable's name.
    least, greatest : float
        Infinite where there is no such limit.
    """

    text: str
    coefficients: dict[str, float]
    least: float
    greatest: float

    @property
    def is_plain(self) -> bool:
        """Whether the condition bounds a single variable with coefficient one."""
        return list(self.coefficients.values()) == [1.0]

    def holds(self, values: Mapping[str, float]) -> bool:
        """Return whether values, given by the names of the variables, meet the condition."""
        total = sum(coefficient * values[name] for name, coefficient in self.coefficients.items())
        return self.least <= total <= self.greatest


@dataclass(frozen=True)
class Region:
    """A region of inputs: a box, and linear conditions on several inputs together.

    Parameters
    ----------
    conditions : tuple of Condition
        As they were asked for.
    low, high : (num_inputs,)
        The box, inside the universes.
    asked_low, asked_high : (num_inputs,)
        The box as it was asked for; inputs beyond their universe are taken as its end. Those that stand in
        the other conditions stay inside: there it matters how far beyond they are.
    coefficients : (m, num_inputs)
        Of the other conditions, ``least <= coefficients @ inputs <= greatest``.
    least, greatest : (m,)
    notes : tuple of str
        Which inputs are asked for beyond their universes, and what they count as.
    """

    conditions: tuple[Condition, ...]
    low: Floats
    high: Floats
    asked_low: Floats
    asked_high: Floats
    coefficients: Floats
    least: Floats
    greatest: Floats
    notes: tuple[str, ...]

    @property
    def text(self) -> str:
        """The conditions as they were written."""
        return ", ".join(condition.text for condition in self.conditions)

    def may_meet(self, low: Floats, high: Floats) -> Booleans:
        """Return which boxes, given by their corners (n, num_inputs), may hold an input of the region."""
        lowest, highest = linear_bounds(self.coefficients, low, high)
        size = np.maximum(np.abs(low), np.abs(high)) @ np.abs(self.coefficients).T
        slack = 4 * float(np.finfo(np.float64).eps) * (low.shape[1] + 2) * size
        is_met = (highest + slack >= self.least) & (lowest - slack <= self.greatest)
        return np.asarray(is_met.all(axis=1))

    def holds(self, inputs: Floats) -> Booleans:
        """Return which inputs of the box, (n, num_inputs), lie in the region."""
        values = inputs @ self.coefficients.T
        return np.asarray(((values >= self.least) & (values <= self.greatest)).all(axis=1))


def linear_bounds(coefficients: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Bound linear forms, (m, k), over boxes given by their corners, (n, k); return both bounds, (n, m)."""
    positive, negative = np.maximum(coefficients, 0.0).T, np.minimum(coefficients, 0.0).T
    return low @ positive + high @ negative, high @ positive + low @ negative


def read_region(system: Inferable, text: str) -> Region:
    """Read conditions on the inputs of a system.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Whose inputs they are about.
    text : str
        As ``distance > 150, velocity_body_x - 0.001 distance <= 0.1``; empty for all that the universes hold.

    Raises
    ------
    ValueError
        If a condition cannot be read, none of the box's inputs can meet it, or values beyond the universe are
        asked for of an input that stands in a condition on several.
    """
    names = [variable.name for variable in system.inputs]
    conditions = read_conditions(text, names) if text.strip() else ()
    asked_low, asked_high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for condition in conditions:
        if condition.is_plain:
            index = names.index(next(iter(condition.coefficients)))
            asked_low[index] = max(asked_low[index], condition.least)
            asked_high[index] = min(asked_high[index], condition.greatest)
    for name, least, greatest in zip(names, asked_low, asked_high, strict=True):
        if not least <= greatest:
            raise ValueError(f"no {name!r} meets all conditions of {text!r}; relax one of them")
    joint = [condition for condition in conditions if not condition.is_plain]
    rows = [[condition.coefficients.get(name, 0.0) for name in names] for condition in joint]
    universes = [(variable.minimum, variable.maximum) for variable in system.inputs]
    for index, (minimum, maximum) in enumerate(universes):
        if any(row[index] for row in rows):
            asked_low[index] = max(asked_low[index], minimum)
            asked_high[index] = min(asked_high[index], maximum)
            if asked_low[index] > asked_high[index]:
                raise ValueError(
                    f"{names[index]!r} is asked to lie beyond its range of {minimum:g} to {maximum:g} in "
                    f"{text!r}, where conditions on several inputs do not reach; leave out one of them"
                )
    notes = _notes(system, asked_low, asked_high)
    low, high = _box(system, asked_low, asked_high)
    coefficients = np.array(rows).reshape(len(joint), len(names))
    limits = np.array([(condition.least, condition.greatest) for condition in joint]).reshape(-1, 2).T
    region = Region(conditions, low, high, asked_low, asked_high, coefficients, limits[0], limits[1], notes)
    if not region.may_meet(region.low[np.newaxis], region.high[np.newaxis])[0]:
        raise ValueError(f"no inputs of the universes meet all conditions of {text!r}; relax one of them")
    return region


def _notes(system: Inferable, asked_low: Floats, asked_high: Floats) -> tuple[str, ...]:
    """Return notes on a region: whose inference counts, and what values beyond a range count as."""
    tool = (f"numbers are those of {TOOLS[system.semantics].title}",) if system.is_sampled else ()
    beyond = [
        variable
        for variable, *limits_given in zip(system.inputs, asked_low, asked_high, strict=True)
        if any(np.isfinite(end) and not variable.minimum <= end <= variable.maximum for end in limits_given)
    ]
    return (
        tool
        + _ranges_taken(system, asked_low, asked_high)
        + tuple(
            f"{variable.name} beyond its range of {number(variable.minimum)} to "
            f"{quantity(variable, variable.maximum)} "
            + (
                "counts as the end of it"
                if np.isfinite(system.limits_of(variable)).all()
                else "is taken as it is"
            )
            for variable in beyond
        )
    )


def _ranges_taken(system: Inferable, asked_low: Floats, asked_high: Floats) -> tuple[str, ...]:
    """Say where inputs that are not clipped are taken to end, as nobody asked for another end."""
    words = []
    for variable, *limits_given in zip(system.inputs, asked_low, asked_high, strict=True):
        if np.isinf(system.limits_of(variable)).any() and np.isinf(limits_given).any():
            ends = zip(limits_given, (variable.minimum, variable.maximum), strict=True)
            low, high = (float(end if np.isfinite(end) else limit) for end, limit in ends)
            words.append(f"{variable.name} from {number(low)} to {quantity(variable, high)}")
    return (f"nothing is said beyond {', '.join(words)}",) if words else ()


def _box(system: Inferable, asked_low: Floats, asked_high: Floats) -> tuple[Floats, Floats]:
    """Return the box in which to search: an open side ends with the range; inputs are clipped as usual."""
    ranges = np.array([(variable.minimum, variable.maximum) for variable in system.inputs])
    limits = np.array([system.limits_of(variable) for variable in system.inputs])
    low = np.clip(np.where(np.isfinite(asked_low), asked_low, ranges[:, 0]), limits[:, 0], limits[:, 1])
    high = np.clip(np.where(np.isfinite(asked_high), asked_high, ranges[:, 1]), limits[:, 0], limits[:, 1])
    for variable, least, greatest in zip(system.inputs, low, high, strict=True):
        if least > greatest:
            raise ValueError(
                f"{variable.name!r} is asked to lie beyond its range of {variable.minimum:g} to "
                f"{variable.maximum:g}, where {TOOLS[system.semantics].title} does not clip it; give both "
                f"ends, {variable.name} in [NUMBER, NUMBER]"
            )
    return low, high


def read_conditions(text: str, names: Sequence[str]) -> tuple[Condition, ...]:
    """Read conditions on variables.

    Parameters
    ----------
    text : str
        One condition, or several with commas between.
    names : sequence of str
        The variables that it can be about.

    Raises
    ------
    ValueError
        If it cannot be read; the message says where, and how conditions are written.
    """
    if len(text) > MOST_CHARACTERS:
        raise ValueError(
            f"the conditions have {len(text)} characters, and at most {MOST_CHARACTERS} are read"
        )
    words = _words(text, names)
    conditions = [_condition(words, names, text)]
    while words:
        if words.pop(0) not in SEPARATORS:
            raise ValueError(f"after {conditions[-1].text!r} in {text!r} a comma is missing; {GRAMMAR}")
        conditions.append(_condition(words, names, text))
    return tuple(conditions)


def _words(text: str, names: Sequence[str]) -> list[str]:
    """Split a text into names, numbers and signs."""
    known = "|".join(re.escape(name) + r"(?!\w)" for name in sorted(names, key=len, reverse=True))
    pattern = re.compile(rf"\s*({known}|{NUMBER}|<=|>=|≤|≥|[<>=+*,\[\]-]|\w+|\S)")
    return [match.group(1) for match in pattern.finditer(text)]


def _condition(words: list[str], names: Sequence[str], text: str) -> Condition:
    """Parse one condition from the front of the words."""
    before = list(words)
    coefficients = _linear_form(words, names, text)
    relation = words.pop(0) if words else ""
    match relation:
        case ">":
            least, greatest = float(np.nextafter(_number(words, text), np.inf)), np.inf
        case "<":
            least, greatest = -np.inf, float(np.nextafter(_number(words, text), -np.inf))
        case ">=" | "≥":
            least, greatest = _number(words, text), np.inf
        case "<=" | "≤":
            least, greatest = -np.inf, _number(words, text)
        case "=":
            least = greatest = _number(words, text)
        case "in":
            least, greatest = _interval(words, text)
        case _:
            raise ValueError(f"{relation or 'the end'!r} in {text!r} is not <, <=, >, >=, = or in; {GRAMMAR}")
    wording = " ".join(before[: len(before) - len(words)])
    wording = re.sub(r"(?<=\[) | (?=[],])", "", wording)
    wording = re.sub(r"([<>=≤≥,[] ?[+-]) ", r"\1", wording)
    return Condition(wording, coefficients, least, greatest)


def _linear_form(words: list[str], names: Sequence[str], text: str) -> dict[str, float]:
    """Parse a linear form, such as ``2 * x - y``; return the coefficient of each variable."""
    coefficients: dict[str, float] = {}
    while True:
        sign = _sign(words)
        if words and words[0] not in names and re.fullmatch(NUMBER, words[0]):
            sign *= float(words.pop(0))
            if words and words[0] == "*":
                words.pop(0)
        name = words.pop(0) if words else ""
        if not re.match(r"\w", name) and name not in names:
            raise ValueError(f"{name or 'the end'!r} in {text!r} stands where a variable should; {GRAMMAR}")
        require_known([name], names, f"in {text!r} there is no variable", ValueError)
        coefficients[name] = coefficients.get(name, 0.0) + sign
        if not words or words[0] not in {"+", "-"}:
            break
    if not any(coefficients.values()):
        raise ValueError(f"{text!r} has a sum of 0 whatever the variables are; {GRAMMAR}")
    return coefficients


def _sign(words: list[str]) -> float:
    """Parse signs; return their product, 1 or -1."""
    sign = 1.0
    while words and words[0] in {"+", "-"}:
        sign *= -1.0 if words.pop(0) == "-" else 1.0
    return sign


def _number(words: list[str], text: str) -> float:
    """Parse a finite number with its signs."""
    sign = _sign(words)
    word = words.pop(0) if words else ""
    if not re.fullmatch(NUMBER, word) or not np.isfinite(float(word)):
        raise ValueError(f"{word or 'the end'!r} in {text!r} stands where a number should; {GRAMMAR}")
    return sign * float(word)


def _interval(words: list[str], text: str) -> tuple[float, float]:
    """Parse ``[low, high]``; return both ends."""
    ends = []
    for sign in ("[", ","):
        if not words or words.pop(0) != sign:
            raise ValueError(f"the interval in {text!r} cannot be read; {GRAMMAR}")
        ends.append(_number(words, text))
    if not words or words.pop(0) != "]":
        raise ValueError(f"the interval in {text!r} does not end in ]; {GRAMMAR}")
    if not ends[0] <= ends[1]:
        raise ValueError(f"the interval in {text!r} is empty; give the lower end first")
    return ends[0], ends[1]
