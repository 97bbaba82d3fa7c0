"""The size of words, and words wrapped or shortened to fit; lengths in inches."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath
from matplotlib.ticker import MaxNLocator

POINTS_AN_INCH = 72.0
#: From one line of letters to the next, in sizes of the letters.
LINE_SPACING = 1.2

#: What ticks and the name of an axis take beside the words at the ticks.
_BESIDE = 0.42
#: What a number under a tick takes.
_A_NUMBER = 0.55

#: Pictures of pixels set letters on whole ones, which makes small letters a little wider.
_HINTED = 1.05

_PIECE = re.compile(r"[^_\-/]*[_\-/]+|[^_\-/]+")
_TO_PATH = TextToPath()


@dataclass(frozen=True)
class FittedText:
    """Words fitted to boxes, all with letters of one size."""

    texts: tuple[str, ...]
    size: float
    rotation: float = 0.0


def width(words: str, size: float) -> float:
    """Return the width of words in letters of a size in points; of several lines, the longest."""
    # the family is part of what the lengths are remembered by
    return max(_line_width(line, size, str(mpl.rcParams["font.family"])) for line in words.split("\n"))


@lru_cache(maxsize=4096)
def _line_width(line: str, size: float, family: str) -> float:
    points, _, _ = _TO_PATH.get_text_width_height_descent(line, FontProperties(size=size), ismath=False)
    return _HINTED * float(points) / POINTS_AN_INCH


def height(words: str, size: float) -> float:
    """Return the height of lines of words in letters of a size in points."""
    return (words.count("\n") + 1) * LINE_SPACING * size / POINTS_AN_INCH


def broken(words: str, room: float, size: float) -> str:
    """Break words into lines no wider than the room, at spaces.

    A word that is wider by itself is broken after its underscores, hyphens and strokes; what cannot be broken
    stays too wide.
    """
    lines = [""]
    for word in filter(None, words.split(" ")):
        pieces = [word] if width(word, size) <= room else _PIECE.findall(word)
        for index, piece in enumerate(pieces):
            glue = " " if index == 0 and lines[-1] else ""
            if lines[-1] and width(lines[-1] + glue + piece, size) > room:
                lines.append(piece)
            else:
                lines[-1] += glue + piece
    return "\n".join(lines)


def shortened(words: str, room: float, size: float) -> str:
    """Shorten each line of words to a width, with an ellipsis where something is cut."""
    return "\n".join(_cut(line, room, size) for line in words.split("\n"))


def _cut(line: str, room: float, size: float) -> str:
    """Return a line shortened by an ellipsis to a width, inches."""
    if width(line, size) <= room:
        return line
    kept = next(
        (count for count in range(len(line) - 1, 0, -1) if width(line[:count] + "…", size) <= room), 0
    )
    return line[:kept].rstrip(" _") + "…"


def fit(
    words: Sequence[str], room: tuple[float, float], sizes: tuple[float, float], *, may_stand: bool = True
) -> FittedText:
    """Fit words into boxes of equal size, shortened as a last resort.

    Parameters
    ----------
    words : sequence of str
        One box each.
    room : (float, float)
        Width and height of a box.
    sizes : (float, float)
        The smallest and the largest letters, in points.
    may_stand : bool
        Whether words may be turned upright where they do not fit otherwise.
    """
    across, down = room
    for rotation, box in ((0.0, (across, down)), (90.0, (down, across)))[: 1 + may_stand]:
        for size in np.arange(sizes[1], sizes[0] - 0.01, -0.5):
            texts = tuple(broken(word, box[0], size) for word in words)
            if all(width(text, size) <= box[0] and height(text, size) <= box[1] for text in texts):
                return FittedText(texts, float(size), rotation)
    is_upright = may_stand and down > across
    box = (down, across) if is_upright else (across, down)
    size = sizes[0]
    most = max(1, int(box[1] / height("", size)))
    return FittedText(
        tuple(_crammed(word, box[0], size, most) for word in words), size, 90.0 if is_upright else 0.0
    )


def _crammed(words: str, room: float, size: float, most_lines: int) -> str:
    lines = broken(words, room, size).split("\n")
    lines[most_lines - 1 :] = [" ".join(lines[most_lines - 1 :])]
    return shortened("\n".join(lines).rstrip(), room, size)


def few_ticks(ax: Axes) -> None:
    """Keep no more tick labels under axes than fit."""
    across, _ = inches(ax)
    ax.xaxis.set_major_locator(MaxNLocator(int(np.clip(across / _A_NUMBER, 3, 8)), steps=[1, 2, 2.5, 5, 10]))


def inches(ax: Axes) -> tuple[float, float]:
    """Return the approximate size of axes; a layout still to come makes them smaller."""
    figure = figure_of(ax)
    spare = 1.0 if figure.get_layout_engine() is None else 0.92
    across, down = (spare * float(length) / figure.dpi for length in ax.bbox.size)
    return across, down


def figure_of(ax: Axes) -> Figure:
    """Return the top-level figure of axes."""
    figure = ax.get_figure(root=True)
    assert figure is not None  # noqa: S101 - axes are drawn in one
    return figure


def make_room(ax: Axes, left: float = 0.0, below: float = 0.0) -> tuple[float, float]:
    """Return the room left of and below axes, at most what is wanted.

    Where no layout will make room, the axes give up as much of their own width and height as it takes, up to
    a half of the figure.
    """
    figure = figure_of(ax)
    if figure.get_layout_engine() is not None:
        return left, below
    across, down = (float(length) for length in figure.get_size_inches())
    box = ax.get_position()
    x = max(box.x0, min((left + _BESIDE) / across, 0.5)) if left else box.x0
    y = max(box.y0, min((below + _BESIDE) / down, 0.5)) if below else box.y0
    ax.set_position((x, y, box.x1 - x, box.y1 - y))
    return min(left, x * across - _BESIDE), min(below, y * down - _BESIDE)
