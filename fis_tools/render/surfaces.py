"""An output over one input as a curve; over two as a map with contours, and as a surface in space."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from fis_tools.analysis.arrays import Surface, evaluate, output_named, surface
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem, Inferable
from fis_tools.render import lettering
from fis_tools.render.theme import BRIGHTNESS_MAP, LIGHT, MEDIUM, SMALL, Theme, dress, readable_on
from fis_tools.words.text import number, quantity, with_unit

#: Outputs nearer to one another than this part of the universe are the same.
_SAME = 1e-9


def held_words(system: Inferable, fixed: Mapping[str, float]) -> str:
    """Format the inputs held, with units: ``distance = 80 m, eta_u = 0 rad``."""
    return ", ".join(f"{name} = {quantity(system.variable(name), value)}" for name, value in fixed.items())


def over_axes(system: Inferable, result: Surface, samples: Floats | None) -> Floats | None:
    """Project samples, if any, onto the two inputs of a surface, clipped to their universes, (n, 2).

    Raises
    ------
    ValueError
        If the samples have another number of inputs than the system.
    """
    if samples is None:
        return None
    if samples.ndim != 2 or samples.shape[1] != len(system.inputs):
        raise ValueError(
            f"samples have shape {samples.shape}; system {system.name!r} has {len(system.inputs)} inputs, "
            "pass a row a sample with one number for each"
        )
    names = [variable.name for variable in system.inputs]
    columns = [
        np.clip(samples[:, names.index(variable.name)], variable.minimum, variable.maximum)
        for variable in (result.x_variable, result.y_variable)
    ]
    return np.stack(columns, axis=1)


def finite_ends(values: Floats) -> tuple[float, float]:
    """Return the least and the greatest finite value; infinity and its negative where there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))


def value_limits(results: Sequence[Surface]) -> tuple[float, float]:
    """Return the range of some surfaces; the universe's ends where all values are equal, or there is none.

    A formula has no value at some places, which are left out.
    """
    lows, highs = zip(*(finite_ends(result.values) for result in results), strict=True)
    low, high = min(lows), max(highs)
    output = results[0].output
    is_flat = high - low < _SAME * output.span
    return (output.minimum, output.maximum) if is_flat else (low, high)


def round_levels(result: Surface, limits: tuple[float, float]) -> Floats:
    """Return round levels between two outputs, zero left out."""
    low, high = limits
    levels = np.asarray(MaxNLocator(7).tick_values(low, high), dtype=np.float64)
    least, greatest = finite_ends(result.values)
    is_between = (levels > least) & (levels < greatest)
    return np.asarray(levels[is_between & (np.abs(levels) > _SAME * (high - low))])


def signed(result: Surface, limits: tuple[float, float]) -> Floats | None:
    """Return outputs whose zeros are exact, for the contour of zero; None where they are all of one sign.

    Where rules cancel, the output is zero but for the last digits, and its contour would follow these.
    """
    least = _SAME * (limits[1] - limits[0])
    values = np.where(np.abs(result.values) > least, result.values, 0.0)
    low, high = finite_ends(values)
    return values if low < 0.0 < high else None


def entitle(ax: Any, words: str) -> None:
    """Set a title, wrapped to the width of the axes."""
    if words:
        ax.set_title(lettering.broken(words, lettering.inches(ax)[0], MEDIUM))


def output_curve(
    system: Inferable,
    ax: Axes,
    *,
    output: str | None = None,
    samples: Floats | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw an output of a system with one input over this input.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems.
    ax : Axes
        Where to draw.
    output : str, optional
        Which output; by default the first.
    samples : (n, 1), optional
        Inputs, such as those of a flight, to mark along the axis.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If the output is unknown, or there are several inputs.
    """
    (along,), concluded = system.inputs, output_named(system, output)
    values = np.linspace(along.minimum, along.maximum, 401)
    outputs = evaluate(system, values[:, np.newaxis])[:, system.outputs.index(concluded)]
    if concluded.minimum < 0.0 < concluded.maximum:
        ax.axhline(0.0, color=theme.grid, linewidth=1.0)
    ax.plot(values, outputs, color=theme.lines[0], linewidth=1.8)
    if samples is not None:
        flown = np.clip(samples[:, 0], along.minimum, along.maximum)
        heights = np.interp(flown, values, outputs)
        ax.plot(flown, heights, "o", color=theme.ink, mec=theme.paper, mew=0.5, ms=4)
    ax.set(xlim=(along.minimum, along.maximum), xlabel=with_unit(along), ylabel=with_unit(concluded))
    ax.spines[["top", "right"]].set_visible(False)
    dress(ax, theme)
    return ax


#: Labels nearer to the edge than this part of the axes would be cut.
_EDGE = 0.07


def surface_map(
    system: FuzzySystem, ax: Axes, *, samples: Floats | None = None, theme: Theme = LIGHT
) -> Axes:
    """Evaluate the first output over the last two inputs and draw it as a map, see `draw_surface`.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems, with two inputs or more; the last lies along x, as in `rule_matrix`.
    ax : Axes
        Where to draw.
    samples : (n, num_inputs), optional
        Inputs, such as those of a flight, to lay over the map, whatever their other inputs are.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If there is one input, or the samples have another number of inputs.
    """
    result = surface(system, *(variable.name for variable in system.inputs[:-3:-1]), num_points=81)
    points = over_axes(system, result, samples)
    return draw_surface(result, ax, points=points, title=held_words(system, result.fixed), theme=theme)


def draw_surface(
    result: Surface,
    ax: Axes,
    limits: tuple[float, float] | None = None,
    *,
    points: Floats | None = None,
    title: str = "",
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
    title : str
        Such as what is held.
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
    entitle(ax, title)
    ax.grid(visible=False)
    dress(ax, theme)
    if has_colour_bar:
        colour_bar([ax], image, with_unit(result.output), theme)
    return ax


def colour_bar(axes: Sequence[Axes], image: Any, label: str, theme: Theme) -> None:
    """Draw an image's colour bar beside axes."""
    many = len(axes) > 1
    sizes: Any = {"fraction": 0.05 if many else 0.1, "pad": 0.02 if many else 0.04}
    scale = lettering.figure_of(axes[0]).colorbar(image, ax=axes, label=label, **sizes)
    scale.outline.set_edgecolor(theme.muted)
    dress(scale.ax, theme)


def _contours(result: Surface, ax: Axes, limits: tuple[float, float], ink: str | None = None) -> None:
    """Draw labelled contours at round levels, and a thick one at zero."""
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


def _label(ax: Axes, lines: QuadContourSet, size: float, positions: Any = False) -> None:
    """Label contours with their levels, except where the edge of the axes would cut a label."""
    for label in ax.clabel(lines, fmt=number, fontsize=size, inline=False, manual=positions):
        rim = readable_on(to_rgb(label.get_color()))
        label.set_path_effects([withStroke(linewidth=2.0, foreground=rim)])
        x, y = ax.transAxes.inverted().transform(ax.transData.transform(label.get_position()))
        if not (_EDGE <= x <= 1 - _EDGE and _EDGE <= y <= 1 - _EDGE):
            label.remove()


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
    title: str = "",
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
    title : str
        Such as what is held.
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
    entitle(ax, title)
    dress(ax, theme)
    ax.zaxis.label.set(color=theme.ink, size=MEDIUM)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color(theme.paper)
        axis.line.set_color(theme.muted)
        axis.pane.set_edgecolor(theme.grid)
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
        colours = {"cmap": BRIGHTNESS_MAP, "vmin": limits[0], "vmax": limits[1]}
        ax.contour(result.x, result.y, result.values, levels, linewidths=1.0, **colours, **options)
    values = signed(result, limits)
    if values is not None:
        ax.contour(result.x, result.y, values, [0.0], colors=theme.ink, linewidths=2.2, **options)
