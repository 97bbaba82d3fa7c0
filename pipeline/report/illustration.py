"""A picture of a report with its words, and how one is drawn."""

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.report.figures.style import Figure, save, style
from pipeline.report.svg import inline


@dataclass(frozen=True)
class Illustration:
    """A picture with its words.

    Parameters
    ----------
    name : str
        Of its file, without the ending.
    caption : str
        Plain text.
    png : bytes
    element : str
        The same picture as HTML.
    """

    name: str
    caption: str
    png: bytes
    element: str


@dataclass(frozen=True)
class Sketch:
    """A picture that is not yet drawn: a function at module level with its arguments draws its figure."""

    name: str
    caption: str
    figure: Callable[[], Figure]


def illustrate(sketch: Sketch, dots_per_inch: int) -> Illustration:
    """Draw a picture, in the report's style."""
    with style():
        picture = save(sketch.figure(), sketch.name, dots_per_inch)
    element = inline(picture.svg, sketch.name, sketch.caption)
    return Illustration(sketch.name, sketch.caption, picture.png, element)
