"""An output over two inputs as a surface in three dimensions."""

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from fis_tools.analysis.arrays import Surface
from fis_tools.render import lettering
from fis_tools.render.surfaces import entitle, held_without_units, round_levels, signed, value_limits
from fis_tools.render.theme import BRIGHTNESS_MAP, LIGHT, MEDIUM, SMALL, Theme, dress
from fis_tools.typing import Floats
from fis_tools.words.text import number, with_unit

#: Lines of the net, along each input.
_NET = 41
#: How far the floor lies below the surface, in heights of it.
_UNDER = 0.4
_ZOOM = 0.85


def surface_space(
    result: Surface,
    ax: Any,
    limits: tuple[float, float] | None = None,
    *,
    points: Floats | None = None,
    title: str | None = None,
    theme: Theme = LIGHT,
) -> Any:
    """Draw an output over two inputs in three dimensions, coloured as the map is, over a floor with contours.

    On the floor the contour where the sign changes is thick, and nothing is hidden behind the surface.

    Parameters
    ----------
    result : Surface
        What `fis_tools.analysis.arrays.surface` returns.
    ax : Axes3D
        Axes with ``projection="3d"``.
    limits : (float, float), optional
        As in `draw_surface`.
    points : (n, 2), optional
        Values of the two inputs, to mark on the floor.
    title : str, optional
        By default the values that are held.
    theme : Theme
        Colours.
    """
    low, high = limits or value_limits([result])
    x, y = np.meshgrid(result.x, result.y)
    floor = low - _UNDER * (high - low)
    options = {"rcount": _NET, "ccount": _NET, "cmap": BRIGHTNESS_MAP, "vmin": low, "vmax": high}
    ax.plot_surface(x, y, result.values, linewidth=0.2, edgecolor=theme.paper, antialiased=True, **options)
    _contours_below(result, ax, (low, high), floor, theme)
    if points is not None:
        ax.plot(*points.T, floor, "o", color=theme.lines[1], mec=theme.paper, mew=0.3, ms=3)
    ax.set(xlim=(result.x[0], result.x[-1]), ylim=(result.y[0], result.y[-1]), zlim=(floor, high))
    ax.set(xlabel=with_unit(result.x_variable), ylabel=with_unit(result.y_variable))
    ax.set_zlabel(with_unit(result.output))
    entitle(ax, held_without_units(result) if title is None else title)
    dress(ax, theme)
    ax.zaxis.label.set(color=theme.ink, size=MEDIUM)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color(theme.paper)
        axis.line.set_color(theme.muted)
        axis.pane.set_edgecolor(theme.grid)
        # matplotlib has no public way to colour the grid of axes in space
        axis._axinfo["grid"]["color"] = theme.grid
        axis.set_major_locator(MaxNLocator(5, prune="both"))
        axis.labelpad = 6.0
    heights = np.asarray(MaxNLocator(5).tick_values(low, high))
    heights = heights[(heights >= low) & (heights <= high)]
    words = [number(value) for value in heights]
    ax.set_zticks(heights, words)
    # numbers along z are centred where their ticks end
    longest = lettering.POINTS_AN_INCH * max((lettering.width(word, SMALL) for word in words), default=0.0)
    ax.tick_params(axis="z", labelsize=SMALL, pad=max(3.0, 0.5 * longest - 6.0))
    ax.zaxis.labelpad = longest - 6.0
    # the names of the axes need the room that a smaller box leaves
    ax.set_box_aspect(None, zoom=_ZOOM)
    return ax


def _contours_below(
    result: Surface, ax: Any, limits: tuple[float, float], floor: float, theme: Theme
) -> None:
    """Draw contours on the floor, where none is hidden behind the surface."""
    levels = round_levels(result, limits)
    options = {"zdir": "z", "offset": floor}
    if len(levels):
        low, high = limits
        ax.contour(
            result.x,
            result.y,
            result.values,
            levels,
            cmap=BRIGHTNESS_MAP,
            vmin=low,
            vmax=high,
            linewidths=1.0,
            **options,
        )
    values = signed(result, limits)
    if values is not None:
        ax.contour(result.x, result.y, values, [0.0], colors=theme.ink, linewidths=2.2, **options)
