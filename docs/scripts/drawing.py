"""Drawings in SVG that follow the reader's light or dark scheme."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

Pair = tuple[float, float]
STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")


def _written(value: Any) -> Markup:
    return escape(f"{value:.1f}" if isinstance(value, float) else value)


class Drawing:
    """Elements of SVG over a plane in metres, or in any unit, of which up is up."""

    def __init__(self, width: int, height: int, title: str, origin: Pair, scale: Pair | float) -> None:
        self.size, self.title, self.origin = (width, height), title, origin
        self.scale = scale if isinstance(scale, tuple) else (scale, scale)
        self.elements: list[Markup] = []

    def at(self, point: Sequence[float]) -> Pair:
        """Return where a point is on the picture, px."""
        return self.origin[0] + self.scale[0] * point[0], self.origin[1] - self.scale[1] * point[1]

    def add(self, tag: str, inside: str = "", **attributes: Any) -> None:
        """Add an element; underscores in names stand for hyphens, one at the end for nothing."""
        words = " ".join(
            f'{name.rstrip("_").replace("_", "-")}="{_written(value)}"' for name, value in attributes.items()
        )
        self.elements.append(Markup(f"<{tag} {words}>{escape(inside)}</{tag}>"))  # noqa: S704 - escaped

    def line(self, points: Iterable[Sequence[float]], kind: str = "") -> None:
        """Draw a line through points."""
        text = " ".join("{:.1f},{:.1f}".format(*self.at(point)) for point in points)
        self.add("polyline", points=text, class_=kind)

    def dot(self, point: Sequence[float], radius: float = 4.0, kind: str = "dot") -> None:
        """Draw a disc whose radius is in px."""
        x, y = self.at(point)
        self.add("circle", cx=x, cy=y, r=radius, class_=kind)

    def arrow(self, start: Sequence[float], end: Sequence[float], kind: str = "muted") -> None:
        """Draw an arrow with its head at the end."""
        (x, y), (a, b) = self.at(start), self.at(end)
        angle = math.atan2(b - y, a - x)
        sides = [(a + 9 * math.cos(angle + turn), b + 9 * math.sin(angle + turn)) for turn in (2.7, -2.7)]
        first, tip, second = ("{:.1f},{:.1f}".format(*corner) for corner in (sides[0], (a, b), sides[1]))
        self.add("path", d=f"M{x:.1f},{y:.1f}L{tip}M{first}L{tip}L{second}", class_=kind)

    def word(
        self,
        text: str,
        point: Sequence[float],
        kind: str = "",
        dx: float = 0.0,
        dy: float = 0.0,
        anchor: str = "start",
    ) -> None:
        """Write lines of text beside a point; offsets are in px, down."""
        x, y = self.at(point)
        for row, words in enumerate(text.split("\n")):
            self.add("text", words, x=x + dx, y=y + dy + 17.0 * row, class_=kind, text_anchor=anchor)

    def text(self) -> str:
        """Return the drawing as a file."""
        width, height = self.size
        box = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
        head = f'<svg xmlns="http://www.w3.org/2000/svg" {box} role="img">'
        ground = f'<rect class="paper" width="{width}" height="{height}" rx="8"/>'
        inside = f"<title>{escape(self.title)}</title><style>{STYLE}</style>{ground}{''.join(self.elements)}"
        return f"{head}{inside}</svg>\n"
