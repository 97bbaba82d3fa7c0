"""Which points the inputs of a flight come from, and what would stay unseen, in words and as plain data."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fis_tools.analysis.flights import Points
from fis_tools.array_types import Floats
from fis_tools.document import Block, Document, Paragraph, Table
from fis_tools.model import FuzzySystem
from fis_tools.words.text import NEGLIGIBLE, amount, listed, signed

#: beyond so many points, only what the others add together is told
MOST_POINTS = 5
#: beyond so many, a sentence only says how many
FEW_POINTS = 3


def made_of(
    points: Points, system: FuzzySystem, inputs: Sequence[float], everything: bool = False
) -> Iterator[Block]:
    """Tell which points each input comes from, those that add most first; `everything` for all of them."""
    for variable, value in zip(system.inputs, inputs, strict=True):
        if variable.name not in points.parts:
            continue
        parts = points.parts[variable.name]
        order = _largest_first(parts)
        shown = order if everything else order[:MOST_POINTS]
        rest = float(parts[order[len(shown) :]].sum())
        others = float(value - parts.sum())
        rows = [[signed(variable, float(parts[place])), *_where(points, place)] for place in shown]
        if len(order) > len(shown):
            rows.append([signed(variable, rest), f"{len(order) - len(shown)} more", "", "", ""])
        if not order or abs(others) > NEGLIGIBLE * variable.span:
            rows.append([signed(variable, others), "none", "", "", ""])
        yield Paragraph(f"{variable.name} = {amount(variable, value)}, the sum of what points add:")
        yield Table(["part", "point", "latitude", "longitude", "dark in"], rows, numbers=(0, 1, 2, 3, 4))


def in_short(points: Points | None, system: FuzzySystem, inputs: Sequence[float]) -> str:
    """Tell in a sentence which points add most to each input; empty where nobody knows."""
    sentences = []
    for variable, value in zip(system.inputs, inputs, strict=True):
        if points is None or variable.name not in points.parts:
            continue
        parts = points.parts[variable.name]
        order = _largest_first(parts)
        words = []
        for place in order[:FEW_POINTS]:
            number, *at, left = _where(points, place)
            words.append(
                f"point {number} ({' '.join(at)}, dark in {left}) {signed(variable, float(parts[place]))}"
            )
        if len(order) > FEW_POINTS:
            words.append(f"{len(order) - FEW_POINTS} more")
        sentences.append(f"{variable.name} = {amount(variable, value)}: {', '.join(words) or 'no point'}")
    return "; ".join(sentences)


def plain_parts(points: Points, system: FuzzySystem) -> dict[str, Any]:
    """Return what each point adds to the inputs as plain data, by the input's name, the largest first."""
    keys = ("latitude_deg", "longitude_deg", "dark_in_s")
    about = {key: getattr(points, key).tolist() for key in keys}
    found: dict[str, Any] = {}
    for name, parts in points.parts.items():
        if name in [variable.name for variable in system.inputs]:
            found[name] = [
                {"point": place, "part": float(parts[place])} | {key: about[key][place] for key in keys}
                for place in _largest_first(parts)
            ]
    return found


def missed_words(points: Points) -> str:
    """Say which points would stay unseen if nothing were fired any more; nothing where nobody asked."""
    if points.is_missed is None:
        return ""
    places = np.flatnonzero(points.is_missed).tolist()
    if not places:
        return "firing nothing any more would leave no point unseen"
    named = [f"{place} at {' '.join(_where(points, place)[1:3])}" for place in places]
    noun = "point" if len(places) == 1 else "points"
    return f"firing nothing any more would leave {len(places)} {noun} unseen: {listed(named, MOST_POINTS)}"


def rehearsed(what: str, ways: Sequence[tuple[float, str]], everything: bool = False) -> Document:
    """Tell what each way that was flown ahead would have cost, the cheapest first."""
    shown = ways if everything else ways[:MOST_POINTS]
    cheapest = ways[0][0]
    rows = [[f"{cost:.4f} m/s", f"+{cost - cheapest:.4f} m/s", name] for cost, name in shown]
    if len(ways) > len(shown):
        most = f"{ways[len(shown)][0]:.4f} to {ways[-1][0]:.4f} m/s"
        rows.append(["", "", f"{len(ways) - len(shown)} more, of {most}"])
    words = f"{what}: of {len(ways)} flown ahead the cheapest was taken:"
    return Document([Paragraph(words), Table(["cost", "more", what], rows, numbers=(0, 1))])


def _largest_first(parts: Floats) -> list[int]:
    order = np.argsort(-np.abs(parts), kind="stable").tolist()
    return [place for place in order if parts[place] != 0.0]


def _where(points: Points, place: int) -> list[str]:
    """Return a point's number, its latitude and longitude, and how long it will be lit."""
    left = float(points.dark_in_s[place]) / 60.0
    latitude, longitude = float(points.latitude_deg[place]), float(points.longitude_deg[place])
    return [
        str(place),
        f"{abs(latitude):.0f}° {'N' if latitude >= 0.0 else 'S'}",
        f"{abs(longitude):.0f}° {'E' if longitude >= 0.0 else 'W'}",
        f"{max(left, 0.0):.1f} min",
    ]
