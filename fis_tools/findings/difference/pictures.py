"""Pictures of a difference for pages: the terms of a variable superimposed, and outputs side by side."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from markupsafe import Markup

from fis_tools import render
from fis_tools.analysis.arrays import Surface, surface
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.difference.comparison import SystemDifference, VariableChange, over_both_ranges
from fis_tools.model import FuzzySystem
from fis_tools.model.intervals import sampled_bounds
from fis_tools.render import Figure, Theme
from fis_tools.render.surfaces import finite_ends
from plain_files.document.html import element, png_address, void

#: Points along each axis of a surface.
NUM_POINTS = 61
_DARK = "(prefers-color-scheme: dark)"


def draw_terms(change: VariableChange) -> Markup:
    """Draw the terms of a variable after, and those that changed as they were before (dotted)."""
    old, new = change.before, change.after
    assert old is not None  # noqa: S101 - of a variable that came or went no terms changed
    assert new is not None  # noqa: S101

    def drawn(theme: Theme) -> Figure:
        figure = Figure(figsize=(7.2, 2.6), layout="constrained")
        ax = render.memberships(new, figure.subplots(), theme=theme)
        figure.set_facecolor(theme.paper)
        for term in change.terms:
            if term.before is not None:
                for bound in dict.fromkeys(map(tuple, sampled_bounds(old, term.before))):
                    ax.plot(old.universe, bound, ":", color=theme.ink, linewidth=1.4)
        ax.set_xlim(min(old.minimum, new.minimum), max(old.maximum, new.maximum))
        return figure

    return _picture(f"terms of {new.name}, before and after", drawn)


def draw_surfaces(system: SystemDifference) -> list[Markup]:
    """Draw each output that moved, over the last two inputs, the others in the middle of their ranges.

    Nothing is drawn if the inputs changed, or are fewer than two.
    """
    before, after = system.before, system.after
    if before is None or after is None or len(after.inputs) < 2:
        return []
    moved = [change.output.name for change in system.outputs if change.largest > 0.0]
    pictures = []
    for name in dict.fromkeys(moved):
        surfaces = changed_surfaces(before, after, name)
        held = render.held_words(after, surfaces[0].fixed)
        caption = f"{name}, before, after and the difference" + (f", where {held}" if held else "")
        pictures.append(_picture(caption, partial(_figure, surfaces)))
    return pictures


def changed_surfaces(
    before: FuzzySystem, after: FuzzySystem, output: str
) -> tuple[Surface, Surface, Surface]:
    """Evaluate an output of two systems over the ranges of both: as it was, as it is, and what it changed by.

    Parameters
    ----------
    before, after : FuzzySystem
        Of inputs of the same names, two or more, and with this output.
    output : str
        Which output.
    """
    y, x = (variable.name for variable in after.inputs[-2:])
    grid = surface(over_both_ranges(before, after), x, y, output=output, num_points=NUM_POINTS)
    across, along = np.meshgrid(grid.x, grid.y)
    inputs = {name: np.full(across.size, value) for name, value in grid.fixed.items()}
    inputs |= {x: across.ravel(), y: along.ravel()}
    old, new = (
        np.asarray(compiled(system)(inputs)[output]).reshape(grid.values.shape) for system in (before, after)
    )
    old, new = (np.where(np.isfinite(values), values, np.nan) for values in (old, new))
    change = replace(grid.output, name=f"change of {output}")
    moved = replace(grid, values=new - old, output=change)
    return replace(grid, values=old), replace(grid, values=new), moved


def _figure(surfaces: tuple[Surface, Surface, Surface], theme: Theme) -> Figure:
    """Draw both with one scale, and the change with one whose middle is zero."""
    low, high = finite_ends(np.stack([grid.values for grid in surfaces[:2]]))
    figure = Figure(figsize=(12.6, 3.7), layout="constrained")
    *axes, last = figure.subplots(1, 3)
    for grid, words, ax in zip(surfaces[:2], ("before", "after"), axes, strict=True):
        render.draw_surface(grid, ax, (low, high) if low < high else None, title=words, theme=theme)
    render.draw_surface(surfaces[2], last, title="after less before", is_change=True, theme=theme)
    return figure


def _picture(caption: str, drawn: Callable[[Theme], Figure]) -> Markup:
    """Return a figure as an element of a page, drawn for light and for dark screens."""
    light, dark = (
        png_address(render.encode(drawn(theme), "png", 100)) for theme in (render.LIGHT, render.DARK)
    )
    source, image = void("source", media=_DARK, srcset=dark), void("img", alt=caption, src=light)
    return element("figure", element("picture", source, image), element("figcaption", caption))
