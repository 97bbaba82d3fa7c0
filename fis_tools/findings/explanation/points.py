"""Which points the inputs of a flight come from, and what would stay unseen, in words and as plain data."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fis_tools.analysis.flight_data import Points
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem
from fis_tools.words.text import NEGLIGIBLE, amount, listed, signed
from plain_files.document import Block, Code, Document, Paragraph, Table

#: beyond so many points, only what the others add together is told
MOST_POINTS = 5
#: beyond so many, a sentence only says how many, and a map shows where
FEW_POINTS = 3
#: of the map: rows and columns, and what each holds of latitude and longitude
NUM_ROWS, NUM_COLUMNS = 9, 24
ROW_DEG, COLUMN_DEG = 180.0 / NUM_ROWS, 360.0 / NUM_COLUMNS


def made_of(
    points: Points, system: FuzzySystem, inputs: Sequence[float], everything: bool = False
) -> Iterator[Block]:
    """Yield which points each input comes from, those that add most first; all of them if `everything`."""
    for variable, value in zip(system.inputs, inputs, strict=True):
        if variable.name not in points.parts:
            continue
        parts = points.parts[variable.name]
        order = _largest_first(parts)
        shown = order if everything else order[:MOST_POINTS]
        rest = float(parts[order[len(shown) :]].sum())
        others = float(value - parts.sum())
        rows = [[signed(variable, float(parts[index])), *_where(points, index)] for index in shown]
        if len(order) > len(shown):
            rows.append([signed(variable, rest), f"{len(order) - len(shown)} more", "", "", ""])
        if not order or abs(others) > NEGLIGIBLE * variable.span:
            rows.append([signed(variable, others), "none", "", "", ""])
        yield Paragraph(f"{variable.name} = {amount(variable, value)}, the sum of what points add:")
        yield Table(["part", "point", "latitude", "longitude", "dark in"], rows, numbers=(0, 1, 2, 3, 4))


def in_short(points: Points | None, system: FuzzySystem, inputs: Sequence[float]) -> str:
    """Return which points add most to each input, in a sentence; empty if unknown."""
    sentences = []
    for variable, value in zip(system.inputs, inputs, strict=True):
        if points is None or variable.name not in points.parts:
            continue
        parts = points.parts[variable.name]
        order = _largest_first(parts)
        words = []
        for index in order[:FEW_POINTS]:
            number, *at, left = _where(points, index)
            words.append(
                f"point {number} ({' '.join(at)}, dark in {left}) {signed(variable, float(parts[index]))}"
            )
        if len(order) > FEW_POINTS:
            words.append(f"{len(order) - FEW_POINTS} more")
        sentences.append(f"{variable.name} = {amount(variable, value)}: {', '.join(words) or 'no point'}")
    return "; ".join(sentences)


def plain_parts(points: Points, system: FuzzySystem) -> dict[str, Any]:
    """Return each point's part in the inputs as plain data, by input, the largest first."""
    keys = ("latitude_deg", "longitude_deg", "dark_in_s")
    about = {key: getattr(points, key).tolist() for key in keys}
    parts_of_inputs: dict[str, Any] = {}
    for name, parts in points.parts.items():
        if name in [variable.name for variable in system.inputs]:
            parts_of_inputs[name] = [
                {"point": index, "part": float(parts[index])} | {key: about[key][index] for key in keys}
                for index in _largest_first(parts)
            ]
    return parts_of_inputs


def missed(points: Points) -> Document | None:
    """Describe which points would stay unseen if nothing more were fired: a few by number, many on a map.

    Return None if that is unknown.
    """
    if points.is_missed is None:
        return None
    indices = np.flatnonzero(points.is_missed).tolist()
    noun = f"{len(indices)} of {len(points.is_missed)} points" if indices else "no point"
    words = f"firing nothing any more would leave {noun} unseen"
    if points.is_shared:
        some = f"not see {noun}" if indices else "see all points"
        words = f"firing nothing any more, this vehicle would {some} that it looks for"
    if len(indices) > FEW_POINTS:
        return Document([Paragraph(f"{words}, marked o among the others:"), Code(_map_of(points))])
    named = [f"{index} at {' '.join(_where(points, index)[1:3])}" for index in indices]
    return Document([Paragraph(f"{words}: {listed(named, MOST_POINTS)}" if named else words)])


def _map_of(points: Points) -> str:
    """Draw the points over latitude and longitude as text: o for one that is missed, else a dot."""
    assert points.is_missed is not None  # noqa: S101 - none is drawn where it is unknown
    rows = np.clip((90.0 - points.latitude_deg) // ROW_DEG, 0, NUM_ROWS - 1).astype(int)
    east = (points.longitude_deg + 180.0) % 360.0
    columns = np.clip(east // COLUMN_DEG, 0, NUM_COLUMNS - 1).astype(int)
    cells = np.full((NUM_ROWS, NUM_COLUMNS), " ")
    cells[rows, columns] = "."
    cells[rows[points.is_missed], columns[points.is_missed]] = "o"
    middles = 90.0 - ROW_DEG * (np.arange(NUM_ROWS) + 0.5)
    lines = [f"{_latitude(middle):>5}  {' '.join(row)}" for middle, row in zip(middles, cells, strict=True)]
    width = 2 * NUM_COLUMNS - 1
    scale = "180° W" + "0°".center(width - 12) + "180° E"
    return "\n".join([*(line.rstrip() for line in lines), f"{'':7}{scale}"])


def _latitude(degrees: float) -> str:
    return f"{abs(degrees):.0f}° {'N' if degrees >= 0.0 else 'S'}"


def rehearsed(what: str, alternatives: Sequence[tuple[float, str]], everything: bool = False) -> Document:
    """Report what each alternative that was flown ahead would have cost, the cheapest first."""
    shown = alternatives if everything else alternatives[:MOST_POINTS]
    cheapest = alternatives[0][0]
    rows = [[f"{cost:.4f} m/s", f"+{cost - cheapest:.4f} m/s", name] for cost, name in shown]
    if len(alternatives) > len(shown):
        most = f"{alternatives[len(shown)][0]:.4f} to {alternatives[-1][0]:.4f} m/s"
        rows.append(["", "", f"{len(alternatives) - len(shown)} more, of {most}"])
    words = f"{what}: of {len(alternatives)} compared the cheapest was taken:"
    return Document([Paragraph(words), Table(["cost", "more", what], rows, numbers=(0, 1))])


def _largest_first(parts: Floats) -> list[int]:
    """Return the indices of the parts that are not zero, the largest first."""
    order = np.argsort(-np.abs(parts), kind="stable").tolist()
    return [index for index in order if parts[index] != 0.0]


def _where(points: Points, index: int) -> list[str]:
    """Return a point's number, its latitude and longitude, and how long it will be lit."""
    left = float(points.dark_in_s[index]) / 60.0
    latitude, longitude = float(points.latitude_deg[index]), float(points.longitude_deg[index])
    return [
        str(index),
        _latitude(latitude),
        f"{abs(longitude):.0f}° {'E' if longitude >= 0.0 else 'W'}",
        f"{max(left, 0.0):.1f} min",
    ]
