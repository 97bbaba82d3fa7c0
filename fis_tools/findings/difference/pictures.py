"""Pictures of a difference for pages: the terms of a variable superimposed, and outputs side by side."""

import base64
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from fis_tools.analysis.arrays import Surface, surface
from fis_tools.document.html import element, void
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.difference.comparison import SystemDifference, VariableChange, over_both_ranges
from fis_tools.model import FuzzySystem, Term, Variable
from fis_tools.model.variables import sample
from fis_tools.words.text import number, with_unit

if TYPE_CHECKING:
    from fis_tools.render import Figure, Theme

WIDTH, SIDE, LINE, CURVES, BELOW = 720.0, 34.0, 17.0, 130.0, 40.0
CHARACTER = 7.2
NUM_COLOURS = 7
#: Points along each axis of a surface.
NUM_POINTS = 61
_DARK = "(prefers-color-scheme: dark)"


def draw_terms(change: VariableChange) -> Markup:
    """Draw the terms of a variable before (dashed) and after (solid).

    Terms that did not change are thin.
    """
    variables = [v for v in (change.before, change.after) if v is not None]
    low, high = min(v.minimum for v in variables), max(v.maximum for v in variables)
    curves, labels = _curves(change)
    levels = _levels([(name, _across(peak, low, high)) for name, peak, _ in labels])
    top = LINE * (max(levels, default=0) + 1) + 9.0
    parts = _axes(change.present, low, high, top)
    for variable, term, style in curves:
        points = " ".join(
            f"{_across(x, low, high):.1f},{top + CURVES * (1.0 - y):.1f}"
            for x, y in zip(variable.universe, sample(variable, term), strict=True)
        )
        parts.append(element("polyline", class_=style, points=points))
    for (name, peak, style), level in zip(labels, levels, strict=True):
        anchor, x = _anchor(name, _across(peak, low, high))
        parts.append(_label(name, anchor, x, top - 9.0 - LINE * level, style))
    return element(
        "svg",
        *parts,
        class_="terms",
        viewBox=f"0 0 {WIDTH:g} {top + CURVES + BELOW:g}",
        role="img",
        aria_label=f"terms of {change.present.name}, before and after",
    )


def _label(words: object, anchor: str, x: float, y: float, style: str = "tick") -> Markup:
    return element("text", words, class_=style, text_anchor=anchor, x=f"{x:.1f}", y=f"{y:g}")


def _line(x: float, y: float, to_x: float, to_y: float) -> Markup:
    return element("line", class_="axis", x1=f"{x:.1f}", x2=f"{to_x:.1f}", y1=f"{y:g}", y2=f"{to_y:g}")


def _curves(change: VariableChange) -> tuple[list[tuple[Variable, Term, str]], list[tuple[str, float, str]]]:
    """Return what to draw, unchanged terms first, and where which name belongs."""
    curves: list[tuple[Variable, Term, str]] = []
    labels = []
    assert change.before is not None  # noqa: S101 - see `draw_terms`
    assert change.after is not None  # noqa: S101
    changed = {term.after.name: term for term in change.terms if term.after is not None}
    for place, term in enumerate(change.after.terms):
        colour = f"term-{place % NUM_COLOURS}"
        one = changed.get(term.name)
        if one is None:
            curves.insert(0, (change.after, term, f"same {colour}"))
        else:
            if one.before is not None:
                curves.append((change.before, one.before, f"before {colour}"))
            curves.append((change.after, term, f"after {colour}"))
        labels.append((term.name, _peak(change.after, term), f"{'after' if one else 'same'} {colour}"))
    for one in change.terms:
        if one.after is None and one.before is not None:
            curves.append((change.before, one.before, "before gone"))
            labels.append((one.before.name, _peak(change.before, one.before), "before gone"))
    return curves, labels


def _peak(variable: Variable, term: Term) -> float:
    values = sample(variable, term)
    return float(np.mean(variable.universe[values == values.max()]))


def _across(x: float, low: float, high: float) -> float:
    return SIDE + (WIDTH - 2.0 * SIDE) * (x - low) / (high - low)


def _anchor(name: str, x: float) -> tuple[str, float]:
    half = 0.5 * CHARACTER * len(name)
    if x - half < 0.0:
        return "start", max(x, 2.0)
    return ("end", min(x, WIDTH - 2.0)) if x + half > WIDTH else ("middle", x)


def _levels(labels: list[tuple[str, float]]) -> list[int]:
    """Give each label the lowest line on which it does not run into another."""
    taken: list[float] = []
    levels = [0] * len(labels)
    for place in np.argsort([x for _, x in labels], kind="stable"):
        name, x = labels[place]
        length = CHARACTER * len(name)
        anchor, x = _anchor(name, x)
        start = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * length
        level = next((level for level, end in enumerate(taken) if end <= start), len(taken))
        taken[level : level + 1] = [start + length + CHARACTER]
        levels[place] = level
    return levels


def _axes(variable: Variable, low: float, high: float, top: float) -> list[Markup]:
    bottom = top + CURVES
    parts = [_line(SIDE, y, WIDTH - SIDE, y) for y in (top, bottom)]
    parts += [_label(value, "end", SIDE - 6.0, y + 4.0) for value, y in ((1, top), (0, bottom))]
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        value = low + share * (high - low)
        x = _across(value, low, high)
        anchor = "middle" if 0.0 < share < 1.0 else "start" if share == 0.0 else "end"
        parts += [
            _line(x, bottom, x, bottom + 5.0),
            _label(number(round(value, 12)), anchor, x, bottom + 18.0),
        ]
    return [*parts, _label(with_unit(variable), "middle", WIDTH / 2.0, bottom + 35.0)]


def draw_surfaces(system: SystemDifference) -> list[str]:
    """Draw each output that moved, over the last two inputs, the others in the middle of their ranges.

    Nothing is drawn if the inputs changed, or are fewer than two.
    """
    if system.before is None or system.after is None or len(system.after.inputs) < 2:
        return []
    moved = {change.output.name for change in system.outputs if change.largest > 0.0}
    return [
        _picture(system.before, system.after, output)
        for output in system.after.outputs
        if output.name in moved
    ]


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
        np.asarray(compiled(one)(inputs)[output]).reshape(grid.values.shape) for one in (before, after)
    )
    old, new = (np.where(np.isfinite(values), values, np.nan) for values in (old, new))
    change = replace(grid.output, name=f"change of {output}")
    return (
        replace(grid, values=old),
        replace(grid, values=new),
        replace(grid, values=new - old, output=change),
    )


def _figure(surfaces: tuple[Surface, Surface, Surface], theme: "Theme") -> "Figure":
    """Draw both with one scale, and the change with one whose middle is zero."""
    from fis_tools import render  # noqa: PLC0415 - differences are told without matplotlib

    shown = np.concatenate([one.values.ravel() for one in surfaces[:2]])
    limits = (float(np.nanmin(shown)), float(np.nanmax(shown)))
    figure = render.Figure(figsize=(12.6, 3.7), layout="constrained")
    *axes, last = figure.subplots(1, 3)
    for one, words, ax in zip(surfaces[:2], ("before", "after"), axes, strict=True):
        render.draw_surface(one, ax, None if limits[0] == limits[1] else limits, title=words, theme=theme)
    render.draw_surface(surfaces[2], last, title="after less before", is_change=True, theme=theme)
    return figure


def _picture(before: FuzzySystem, after: FuzzySystem, output: Variable) -> str:
    from fis_tools import render  # noqa: PLC0415 - differences are told without matplotlib

    surfaces = changed_surfaces(before, after, output.name)
    light, dark = (
        base64.b64encode(render.encode(_figure(surfaces, theme), "png", 100)).decode("ascii")
        for theme in (render.LIGHT, render.DARK)
    )
    held = render.held_words(after, surfaces[0].fixed)
    caption = f"{output.name}, before, after and the difference" + (f", where {held}" if held else "")
    source, image = f"data:image/png;base64,{dark}", f"data:image/png;base64,{light}"
    picture = element(
        "picture", void("source", media=_DARK, srcset=source), void("img", alt=caption, src=image)
    )
    return element("figure", picture, element("figcaption", caption))
