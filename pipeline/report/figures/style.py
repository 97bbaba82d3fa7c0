"""How all pictures look, and how a figure becomes files."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

__all__ = ["STYLE", "Figure", "Picture", "grid", "save", "style"]

#: colours with a part to play; a page may put others in their places
INK, MUTED, GRID, PAPER = "#1b1f24", "#5b6571", "#d4d9df", "#fffffe"
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#AA4499"
ORANGE, SKY, OLIVE = "#E69F00", "#56B4E9", "#7A7A29"
#: of what is drawn side by side, in this order
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, OLIVE, INK)

#: of lines that are a limit or a border
DOTS = (0, (2, 2))

#: of PNG files, from 0 to 9: the usual 6 takes half as long again and makes them a tenth smaller at most
COMPRESSION = 3

#: up to so many flights each value is drawn, beyond only the crowd
MOST_POINTS = 40

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titley": 1.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    # a name with a dollar sign is a name
    "text.parse_math": False,
    # fitting letters to pixels takes long, gains nothing so fine, and bends those that stand upright
    "text.hinting": "none",
    "axes.formatter.use_mathtext": False,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
}


@dataclass(frozen=True)
class Picture:
    """A figure as files."""

    png: bytes
    svg: str


def grid(
    figure: Figure,
    rows: int,
    columns: int,
    margins: Sequence[float],
    between: Sequence[float],
    **ratios: Any,
) -> GridSpec:
    """Part a figure into places for axes, for labels of a known size: to measure them takes long.

    Parameters
    ----------
    figure : Figure
    rows, columns : int
    margins : sequence of four float
        Left, right, bottom and top, in inches.
    between : sequence of two float
        Between columns and between rows, in inches.
    **ratios
        Of widths and heights, see `matplotlib.gridspec.GridSpec`.
    """
    width, height = figure.get_size_inches()
    left, right, bottom, top = margins
    across, down = between
    return figure.add_gridspec(
        rows,
        columns,
        left=left / width,
        right=1.0 - right / width,
        bottom=bottom / height,
        top=1.0 - top / height,
        wspace=across * columns / (width - left - right - across * (columns - 1)),
        hspace=down * rows / (height - bottom - top - down * (rows - 1)),
        **ratios,
    )


@contextmanager
def style() -> Iterator[None]:
    """Draw in the report's style."""
    with mpl.rc_context(STYLE):
        yield


def save(figure: Figure, name: str, dots_per_inch: int) -> Picture:
    """Turn a figure into files: a PNG on white and an SVG without background.

    Parameters
    ----------
    figure : Figure
    name : str
        Keeps the ids of one SVG apart from those of another.
    dots_per_inch : int
        Of the PNG, and of what is rasterised in the SVG.
    """
    png, svg = io.BytesIO(), io.StringIO()
    figure.set_dpi(dots_per_inch)
    engine = figure.get_layout_engine()
    if engine is not None:
        # once: with an engine, saving lays out and draws before it draws
        engine.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(
        png, format="png", dpi=dots_per_inch, facecolor="white", pil_kwargs={"compress_level": COMPRESSION}
    )
    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(svg, format="svg", dpi=dots_per_inch, transparent=True, metadata={"Date": None})
    return Picture(png.getvalue(), svg.getvalue())
