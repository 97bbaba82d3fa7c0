"""How evidence is coloured, and a drawing of how the margins of many flights are spread."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from fis_tools.document.html import element

#: ways of verification, as columns are headed
METHODS = {"cases": "cases", "search": "search", "bounds": "bounds", "safety_layer": "safety layer"}


def css_of(found: Mapping[str, Any]) -> str:
    """Return how an outcome is drawn; a failure that a search finds refutes no share of the cases."""
    return {"failure found": "not-shown", "none found": "neutral", "does not apply": "neutral"}.get(
        found["word"], css(found["verdict"])
    )


def css(verdict: str) -> str:
    """Return the class of what is drawn in a verdict's colour."""
    return verdict.replace(" ", "-")


BARS_WIDTH, BARS_HEIGHT, BASE, LEFT = 640, 150, 112, 10
#: a number nearer to the zero than this would stand on it
ROOM = 40.0


def draw_margins(histogram: Mapping[str, Any], unit: str, name: str) -> Markup:
    """Draw a histogram of margins as an SVG element.

    Parameters
    ----------
    histogram : mapping
        ``edges``, one more than ``counts``; zero is an edge where margins of both signs are.
    unit : str
        Of the margins.
    name : str
        Of the requirement, for whom does not see the picture.
    """
    edges, counts = histogram["edges"], histogram["counts"]
    span = edges[-1] - edges[0]
    most = max(counts)

    def place(value: float) -> float:
        return float(LEFT + (BARS_WIDTH - 2 * LEFT) * (value - edges[0]) / span)

    bars = []
    for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True):
        if count:
            # the square root, so that few failures among thousands are seen
            height = max(2.0, 100.0 * (count / most) ** 0.5)
            x, width = place(low), max(1.0, place(high) - place(low) - 1.0)
            kind = "refuted" if high <= 0.0 else "shown"
            words = f"{count:,} from {low:.4g} to {high:.4g} {unit}".strip()
            box = {"x": x, "y": BASE - height, "width": width, "height": height}
            bars.append(
                element(
                    "rect",
                    element("title", words),
                    class_=f"bar {kind}",
                    **{side: f"{size:.1f}" for side, size in box.items()},
                )
            )
    marks = [(edges[0], "start"), (edges[-1], "end")]
    if edges[0] < 0.0 < edges[-1]:
        marks.append((0.0, "middle"))
    lines = [element("path", class_="line", d=f"M{LEFT} {BASE}H{BARS_WIDTH - LEFT}")]
    if len(marks) == 3:
        lines.append(element("path", class_="zero", d=f"M{place(0.0):.1f} 4V{BASE}"))
    texts = [
        element("text", number(value), class_=anchor, x=f"{place(value):.1f}", y=BASE + 18)
        for value, anchor in marks
        if anchor == "middle" or len(marks) < 3 or abs(place(value) - place(0.0)) > ROOM
    ]
    caption = f"margin{f' ({unit})' if unit else ''}; heights are square roots of counts"
    return element(
        "svg",
        *(*bars, *lines, *texts),
        element("text", caption, class_="middle", x=BARS_WIDTH / 2, y=BASE + 34),
        class_="margins",
        viewBox=f"0 0 {BARS_WIDTH} {BARS_HEIGHT}",
        role="img",
        aria_label=f"Margins of the cases of {name}: from {edges[0]:.4g} to {edges[-1]:.4g} {unit}",
    )


def number(value: float) -> str:
    """Write a number with a true minus sign."""
    return f"{value:.4g}".replace("-", "−")
