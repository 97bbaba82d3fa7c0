"""The constants among a controller's attributes: value, unit, meaning, and how many digits matter."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

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
MOST_DIGITS = 15


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
        Of the flights on which it is counted how many digits of a dead band matter.
    meanings : mapping of str to str
        What the attributes mean, with or without a unit after a comma, by their names.
    """
    found = []
    for name, text in controller.attributes:
        try:
            value = float(text)
        except ValueError:
            continue
        unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
        meaning = meanings.get(name, "").removesuffix(f", {unit}")
        found.append(Constant(name, f"{value:.4g}", text, unit, meaning, _digits(name, value, went)))
    return found


def _digits(name: str, value: float, went: Sequence[Outcome]) -> str:
    """Say with how many digits of a dead band every output of the flights is judged as it was."""
    outputs = [
        np.abs(asked)
        for one in went
        for system, asked in one.asked.items()
        if name.startswith(f"{DEAD_BAND}{system}")
    ]
    asked = np.concatenate([np.empty(0), *outputs])
    if not len(asked):
        return ""
    fired = asked >= value
    same = (n for n in range(1, MOST_DIGITS) if np.array_equal(asked >= float(f"{value:.{n}g}"), fired))
    count = next(same, MOST_DIGITS)
    return f"{count} ({float(f'{value:.{count}g}'):g}) on these flights"
