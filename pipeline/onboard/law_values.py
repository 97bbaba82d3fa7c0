"""The values of a law on board: changeable constants in the state, all others in one table."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fis_tools.compiled.vectors import ROW
from fis_tools.engines import packing
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Law
from pipeline.flight.state.signals import CONSTANTS
from pipeline.onboard.allowed import TranslationError
from pipeline.onboard.arrays import Array
from pipeline.onboard.translator import Translator
from pipeline.onboard.values import Expression

#: constants of a controller that are read from the state and can be changed in flight, unless they are zero:
#: lengths, speeds, forces and angles, and all of a tour. Other times and counts decide how long loops are
CHANGEABLE = tuple(
    name
    for name, constant in CONSTANTS.items()
    if constant.is_tuned and (name.endswith(("_m", "_m_s", "_n", "_rad")) or name.startswith("tour_"))
)


class Values:
    """A controller's values as the flight indexes them.

    Its changeable constants are read from the state. The terms of outputs stand among the values twice, term
    by term and point by point; on board they do once, point by point. Flanks are read by whole rows, which
    may begin before the first point of a term and end after its last one: there a small table is prolonged.
    """

    ndim = 1

    def __init__(self, values: Floats, law: Law, choices: Sequence[Floats]) -> None:
        self._values, self._first, self._choices = values, law.constants, choices
        self.used: list[str] = []
        self._rows: list[_Row] = []
        tables = list(_tables(law))
        before, after = _room(tables)
        parts: list[Floats] = [np.zeros(before)]
        for first, end, by_points in tables:
            start = sum(map(len, parts))
            if by_points is None:
                self._rows.append(_Row(first, end, start, 1))
                parts.append(values[first:end])
            else:  # the terms of an output, whose table point by point is the part that was added last
                terms = (end - first) // by_points
                for term in range(terms):
                    row = first + term * by_points
                    self._rows.append(_Row(row, row + by_points, start - (end - first) + term, terms))
        self._table = np.concatenate([*parts, np.zeros(after)])

    def known(self, index: int) -> float:
        """Return the number at an index as the controller was designed."""
        return float(self._values[index])

    def at(self, translator: Translator, index: Any) -> Any:
        """Return the value at an index."""
        if isinstance(index, Expression):
            for row in self._rows:
                if row.first <= index.offset < row.end:
                    table = Array("values", self._table.shape, data=self._table)
                    return translator.element(table, (index - row.first) * row.step + row.start)
            raise TranslationError(f"an index of values that is in none of its tables: {index.text}")
        value = self.known(index)
        if not 0 <= self._first <= index:
            return value
        number = index - self._first
        name = list(CONSTANTS)[number]
        if name not in CHANGEABLE or not any(constants[number] for constants in self._choices):
            return value
        if name not in self.used:
            self.used.append(name)
        return Expression(f"state->parameters.{name}")


class _Row(NamedTuple):
    """Consecutive values, and where on board the first stands and how far apart they are."""

    first: int
    end: int
    start: int
    step: int


def _tables(law: Law) -> Iterator[tuple[int, int, int | None]]:
    """Return where a law's tables stand among its values: first index, the one after, points of a term.

    Where there are points, the table stands term by term; the one before holds the same point by point.
    """
    for system in law.layout:
        for column in range(system.num_inputs):
            first = int(system.input_values[column]) + packing.HEADER
            yield first, first + int(system.input_terms[column] * system.input_points[column]), None
        terms, points = int(system.output_terms), int(system.output_points)
        first = int(system.output_values) + packing.HEADER
        yield first + terms * points, first + 2 * terms * points, None
        yield first, first + terms * points, points
        yield int(system.pieces), int(system.pieces) + 2 * terms * packing.num_pieces(points), None


def _room(tables: Sequence[tuple[int, int, int | None]]) -> tuple[int, int]:
    """Return how many values stand before and after a law's tables, so that rows end inside them."""
    before, after, start = 0, ROW, 0
    whole = sum(end - first for first, end, by_points in tables if by_points is None)
    for first, end, by_points in tables:
        if by_points is None:
            start += end - first
        else:  # of the part that was added last
            beyond = (ROW - 1) * ((end - first) // by_points)
            before = max(before, beyond - (start - (end - first)))
            after = max(after, beyond - (whole - start))
    return before, after
