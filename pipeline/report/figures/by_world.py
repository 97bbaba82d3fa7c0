"""Controllers in several worlds: a grid of what they reach, and where they break."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.report.figures.style import BLUE, INK, PAPER, VERMILION

#: from no success to all
SHADES = LinearSegmentedColormap.from_list("success", [PAPER, BLUE])
#: from this share of success on words are written in the paper's colour
DARK = 0.6


@dataclass(frozen=True)
class Square:
    """A controller in a world: share of successful flights, mean delta-v (m/s), and whether it breaks."""

    controller: str
    world: str
    success: float
    delta_v: float
    is_broken: bool


def by_world(panels: Sequence[tuple[str, Sequence[Square]]]) -> Figure:
    """Draw a grid for each Sun setting and safety layer.

    Parameters
    ----------
    panels : sequence of (title, squares)
        Worlds and controllers in the order in which they come.
    """
    names = list(dict.fromkeys(square.controller for _, squares in panels for square in squares))
    worlds = list(dict.fromkeys(square.world for _, squares in panels for square in squares))
    height = 1.1 + 0.42 * len(worlds)
    figure = Figure(figsize=(9.6, 0.4 + height * len(panels)), layout="constrained")
    for ax, (title, squares) in zip(
        figure.subplots(len(panels), 1, squeeze=False)[:, 0], panels, strict=True
    ):
        _draw(ax, squares, names, worlds)
        ax.set_title(title)
    return figure


def _draw(ax: Axes, squares: Sequence[Square], names: Sequence[str], worlds: Sequence[str]) -> None:
    for square in squares:
        x, y = names.index(square.controller), worlds.index(square.world)
        edge, width = (VERMILION, 1.8) if square.is_broken else (PAPER, 1.0)
        shade, place = SHADES(square.success), (x - 0.47, y - 0.45)
        ax.add_patch(Rectangle(place, 0.94, 0.9, facecolor=shade, edgecolor=edge, linewidth=width))
        ax.text(
            x,
            y,
            f"{100 * square.success:.0f} %, {square.delta_v:.2f}",
            color=PAPER if square.success >= DARK else INK,
            ha="center",
            va="center",
            fontsize=8.0,
        )
    ax.set_xlim(-0.5, len(names) - 0.5)
    ax.set_ylim(len(worlds) - 0.5, -0.5)
    ax.set_xticks(range(len(names)), names, fontsize=7.5)
    ax.set_yticks(range(len(worlds)), worlds)
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
