"""An output over two inputs as a map with contours."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.patheffects import withStroke

from fis_tools.analysis.arrays import Surface
from fis_tools.model import FuzzySystem
from fis_tools.render.surfaces import (
    entitle,
    evaluated,
    held_without_units,
    held_words,
    over_axes,
    round_levels,
    signed,
    value_limits,
)
from fis_tools.render.theme import BRIGHTNESS_MAP, LIGHT, MEDIUM, SMALL, Theme, dress, readable_on
from fis_tools.typing import Floats
from fis_tools.words.text import number, with_unit

#: Labels nearer to the edge than this part of the axes would be cut.
_EDGE = 0.07


def surface_map(
    system: FuzzySystem,
    ax: Axes,
    x: str | None = None,
    y: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    output: str | None = None,
    num_points: int = 81,
    samples: Floats | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Evaluate an output over two inputs and draw it as a map, see `draw_surface`.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems, with two inputs or more.
    ax : Axes
        Where to draw.
    x, y : str, optional
        The inputs along the axes; by default the last free one and the one before it, as in `rule_matrix`.
    fixed, output, num_points
        As in `fis_tools.analysis.arrays.surface`; what is held is told in the title.
    samples : (n, num_inputs), optional
        Inputs, such as those of a flight, to lay over the map, whatever their other inputs are.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        As `fis_tools.analysis.arrays.surface` does, or if the samples have another number of inputs.
    """
    result = evaluated(system, x, y, fixed=fixed, output=output, num_points=num_points)
    points = None if samples is None else over_axes(system, result, samples)
    return draw_surface(result, ax, points=points, title=held_words(system, result.fixed), theme=theme)


def draw_surface(
    result: Surface,
    ax: Axes,
    limits: tuple[float, float] | None = None,
    *,
    points: Floats | None = None,
    title: str | None = None,
    has_colour_bar: bool = True,
    is_change: bool = False,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw an output over two inputs, as brightness with contours; where its sign changes, a thick one.

    Parameters
    ----------
    result : Surface
        What `fis_tools.analysis.arrays.surface` returns.
    ax : Axes
        Where to draw.
    limits : (float, float), optional
        Outputs drawn darkest and brightest; by default the least and the greatest there is.
    points : (n, 2), optional
        Values of the two inputs to mark.
    title : str, optional
        By default the values that are held.
    has_colour_bar : bool
        Whether to put a colour bar beside the axes.
    is_change : bool
        Whether it is a difference, which a scale of two colours shows whose middle is zero.
    theme : Theme
        Colours.
    """
    low, high = limits or value_limits([result])
    if is_change:
        high = max(abs(low), abs(high))
        low = -high
    half_x, half_y = 0.5 * (result.x[1] - result.x[0]), 0.5 * (result.y[1] - result.y[0])
    image = ax.imshow(
        result.values,
        origin="lower",
        aspect="auto",
        # a pixel's middle is where its value belongs
        extent=(result.x[0] - half_x, result.x[-1] + half_x, result.y[0] - half_y, result.y[-1] + half_y),
        cmap=theme.change_map if is_change else BRIGHTNESS_MAP,
        vmin=low,
        vmax=high,
        interpolation="bilinear",
    )
    ax.set(xlim=(result.x[0], result.x[-1]), ylim=(result.y[0], result.y[-1]))
    _contours(result, ax, (low, high), theme.ink if is_change else None)
    if points is not None:
        ax.plot(*points.T, "o", color="white", mec="black", mew=0.5, ms=3, clip_on=False)
    ax.set(xlabel=with_unit(result.x_variable), ylabel=with_unit(result.y_variable))
    entitle(ax, held_without_units(result) if title is None else title)
    ax.grid(visible=False)
    dress(ax, theme)
    if has_colour_bar:
        colour_bar([ax], image, result, theme)
    return ax


def colour_bar(axes: Sequence[Axes], image: Any, result: Surface, theme: Theme) -> None:
    """Put the scale of the output beside axes."""
    figure = axes[0].get_figure()
    if figure is not None:
        many = len(axes) > 1
        scale = figure.colorbar(image, ax=axes, fraction=0.05 if many else 0.1, pad=0.02 if many else 0.04)
        scale.set_label(with_unit(result.output))
        scale.outline.set_edgecolor(theme.muted)
        dress(scale.ax, theme)


def _contours(result: Surface, ax: Axes, limits: tuple[float, float], ink: str | None = None) -> None:
    middle, levels = 0.5 * (limits[0] + limits[1]), round_levels(result, limits)
    if len(levels):
        colours = [ink or ("white" if level < middle else "black") for level in levels]
        lines = ax.contour(
            result.x, result.y, result.values, levels, colors=colours, linewidths=0.8, linestyles="solid"
        )
        _label(ax, lines, SMALL - 0.5)
    values = signed(result, limits)
    if values is not None:
        zero = ax.contour(result.x, result.y, values, [0.0], colors=ink or "black", linewidths=2.2)
        zero.set_path_effects([withStroke(linewidth=4.0, foreground=readable_on(to_rgb(ink or "black")))])
        vertices = np.concatenate([path.vertices for path in zero.get_paths()])
        off_middle = ax.transAxes.inverted().transform(ax.transData.transform(vertices)) - 0.5
        _label(ax, zero, MEDIUM, [vertices[np.argmin(np.abs(off_middle).max(axis=1))]])


def _label(ax: Axes, lines: QuadContourSet, size: float, places: Any = False) -> None:
    """Write levels on contours, each with a rim, but for those that the edge of the axes would cut."""
    for label in ax.clabel(lines, fmt=number, fontsize=size, inline=False, manual=places):
        rim = readable_on(to_rgb(label.get_color()))
        label.set_path_effects([withStroke(linewidth=2.0, foreground=rim)])
        x, y = ax.transAxes.inverted().transform(ax.transData.transform(label.get_position()))
        if not (_EDGE <= x <= 1 - _EDGE and _EDGE <= y <= 1 - _EDGE):
            label.remove()
