"""The constants among a controller's attributes: value, unit, meaning, and how many digits matter."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis.flights import Outcome
from fis_tools.model import FuzzyController

#: ends of names that tell a unit
UNITS = {
    "_m_s": "m/s",
    "_rad_s": "rad/s",
    "_m": "m",
    "_s": "s",
    "_n": "N",
    "_rad": "rad",
    "_deg": "°",
    "_kg": "kg",
}
DEAD_BAND = "dead_band_"
COAST_BELOW, COAST_MARGIN = "coast_below_points", "coast_margin_m"
MOST_DIGITS = 15

#: what constants decide, an entry a decision, and how that follows from the value of one of them
Decided = NDArray[np.bool_]
Decide = Callable[[float], Decided]


class Constant(NamedTuple):
    """A row of the table; texts are empty where nothing is known.

    Attributes
    ----------
    name, value, exact, unit, meaning, digits : str
        The value to four digits and as in the file; in words, with how many digits flights go the same.
    """

    name: str
    value: str
    exact: str
    unit: str
    meaning: str
    digits: str


def constants(
    controller: FuzzyController, went: Sequence[Outcome], meanings: Mapping[str, str]
) -> list[Constant]:
    """Return a row for each attribute that is a number.

    Parameters
    ----------
    controller : FuzzyController
    went : sequence of Outcome
        Of the flights on which it is counted how many digits of each matter.
    meanings : mapping of str to str
        What the attributes mean, with or without a unit after a comma, by their names.
    """
    found, attributes = [], dict(controller.attributes)
    for name, text in attributes.items():
        value = number_of(text)
        if value is None:
            continue
        unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
        meaning = meanings.get(name, "").removesuffix(f", {unit}")
        digits = _digits(name, value, went, attributes)
        found.append(Constant(name, f"{value:.4g}", text, unit, meaning, digits))
    return found


def number_of(text: str) -> float | None:
    """Return the number that an attribute is, if it is one."""
    try:
        return float(text)
    except ValueError:
        return None


def _digits(name: str, value: float, went: Sequence[Outcome], attributes: Mapping[str, str]) -> str:
    """Say with how many digits every decision that a constant makes on the flights is what it was.

    A dead band decides whether an output is fired, a constant of coasting whether nothing is asked for. A
    recording does not hold what the other constants act on, so nothing is said of them.
    """
    if name.startswith(DEAD_BAND):
        decide = _dead_band(name, went)
    elif name in (COAST_BELOW, COAST_MARGIN) and {COAST_BELOW, COAST_MARGIN} <= set(attributes):
        decide = _coasting(name, went, attributes)
    else:
        return ""
    decided = decide(value)
    if not len(decided):
        return ""
    same = (n for n in range(1, MOST_DIGITS) if np.array_equal(decide(float(f"{value:.{n}g}")), decided))
    count = next(same, MOST_DIGITS)
    return f"{count} ({float(f'{value:.{count}g}'):g}) for the same {len(decided):,} decisions"


def _dead_band(name: str, went: Sequence[Outcome]) -> Decide:
    """Return what tells of each output on some flights whether a dead band lets it be fired."""
    outputs = [
        np.abs(asked)
        for one in went
        for system, asked in one.asked.items()
        if name.startswith(f"{DEAD_BAND}{system}")
    ]
    asked = np.concatenate([np.empty(0), *outputs])
    return lambda value: asked >= value


def _coasting(name: str, went: Sequence[Outcome], attributes: Mapping[str, str]) -> Decide:
    """Return what tells of each decision on coasting on some flights whether nothing is asked for."""
    held = {key: float(attributes[key]) for key in (COAST_BELOW, COAST_MARGIN)}
    rows = [
        np.column_stack(
            [one.foreseen, np.tile(np.array(one.limits_m, dtype=np.float64), (len(one.foreseen), 1))]
        )
        for one in went
        if None not in one.limits_m
    ]
    missed, nearest, farthest, least, greatest = np.concatenate([np.empty((0, 5)), *rows]).T

    def decide(value: float) -> Decided:
        below, margin = ({**held, name: value}[key] for key in (COAST_BELOW, COAST_MARGIN))
        coasts: Decided = (missed < below) & (nearest >= least + margin) & (farthest <= greatest - margin)
        return coasts

    return decide
