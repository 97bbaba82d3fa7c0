"""The columns of a table: what they are called, and over which ranges they are learned."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fis_tools.learning.partition import range_of
from fis_tools.typing import Floats

#: A name with its unit, such as ``petal length (cm)``.
WITH_UNIT = re.compile(r"(.*\S)\s*[(\[]([^()\[\]]+)[)\]]")


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    name, unit : str
    low, high : float
        The range that is learned; values beyond it count as its ends.
    """

    name: str
    unit: str
    low: float
    high: float


def columns_over(rows: Floats, labels: Sequence[str]) -> list[Column]:
    """Return the columns of a table, (n, num_columns), over the ranges of its rows."""
    found = []
    for label, values in zip(labels, rows.T, strict=True):
        name, unit = name_and_unit(label)
        found.append(Column(name, unit, *range_of(values)))
    names = distinct(column.name for column in found)
    return [replace(column, name=name) for column, name in zip(found, names, strict=True)]


def columns_within(ranges: Mapping[str, tuple[float, float]]) -> list[Column]:
    """Return columns over given ranges, by their names.

    Raises
    ------
    ValueError
        If a range is empty or not finite.
    """
    for name, (low, high) in ranges.items():
        if not -np.inf < low < high < np.inf:
            raise ValueError(f"the range of {name!r} is ({low}, {high}); give two finite numbers that ascend")
    return [Column(*name_and_unit(name), float(low), float(high)) for name, (low, high) in ranges.items()]


def name_and_unit(label: str) -> tuple[str, str]:
    """Split ``petal length (cm)`` into ``petal_length`` and ``cm``."""
    printable = "".join(letter if letter.isprintable() else " " for letter in label).strip()
    match = WITH_UNIT.fullmatch(printable)
    name, unit = match.groups() if match else (printable, "")
    return "_".join(name.split()) or "unnamed", unit.strip()


def distinct(names: Iterable[str]) -> list[str]:
    """Return names of which no two are equal: later ones get a number."""
    found: list[str] = []
    for name in names:
        candidate, count = name, 1
        while candidate in found:
            count += 1
            candidate = f"{name}_{count}"
        found.append(candidate)
    return found
