"""Between which numbers the outputs of a system lie, proved, laid out for the page."""

import json
from collections.abc import Iterator
from typing import Any

from fis_tools.analysis import bounds
from fis_tools.engines.interval import NotBounded
from fis_tools.model import FuzzySystem, Variable
from fis_tools.words.text import amount

#: how near proved and attained ends are brought, as a fraction of the output's range
TOLERANCE = 0.01
#: for each end of each output
MOST_BOXES = 5_000


def range_rows(system: FuzzySystem) -> tuple[list[dict[str, Any]], str]:
    """Return a row for each output; none, and why, where they cannot be bounded."""
    try:
        ranges = bounds.output_ranges(system, tolerance=TOLERANCE, max_boxes=MOST_BOXES)
    except NotBounded as error:
        return [], str(error)
    return list(_rows(system, ranges)), ""


def _rows(system: FuzzySystem, ranges: tuple[bounds.Range, ...]) -> Iterator[dict[str, Any]]:
    for found in ranges:
        output = found.output
        yield {
            "output": output.name,
            "declared": _extent(output, output.minimum, output.maximum),
            "proved": _extent(output, found.outer.low, found.outer.high),
            "ends": [
                (_shown(output, value), _inputs(system, point), json.dumps(point))
                for value, point in (
                    (found.inner.low, found.least_at),
                    (found.inner.high, found.greatest_at),
                )
            ],
        }


def _extent(variable: Variable, low: float, high: float) -> str:
    return f"{_shown(variable, low)} to {_shown(variable, high)}"


def _inputs(system: FuzzySystem, point: dict[str, float]) -> str:
    return ", ".join(f"{name} = {_shown(system.variable(name), value)}" for name, value in point.items())


def _shown(variable: Variable, value: float) -> str:
    return amount(variable, value).replace("-", "−", 1)
