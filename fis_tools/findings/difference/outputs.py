"""How far outputs changed: two systems evaluated over the same inputs."""

import base64
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fis_tools.analysis.arrays import Surface, spread_inputs, surface
from fis_tools.array_types import Floats
from fis_tools.document.html import element, void
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.difference.change import OutputChange, SystemDifference
from fis_tools.model import FuzzySystem, Variable

#: Inputs spread over the ranges.
NUM_SPREAD = 4096


def compare_outputs(
    before: FuzzySystem, after: FuzzySystem, samples: Floats | None = None
) -> tuple[OutputChange, ...]:
    """Compare the common outputs of two systems, over the input ranges and over samples.

    Parameters
    ----------
    before, after : FuzzySystem
        Of inputs of the same names, in any order; without these nothing is compared.
    samples : (n, num_inputs), optional
        Inputs in the order of `after`.
    """
    names = [variable.name for variable in after.inputs]
    if sorted(names) != sorted(variable.name for variable in before.inputs):
        return ()
    spread = spread_inputs(over_both_ranges(before, after), NUM_SPREAD)
    columns = [names.index(variable.name) for variable in before.inputs]
    common = [output for output in after.outputs if output.name in {v.name for v in before.outputs}]
    changes = []
    for where, inputs in (("the ranges", spread), ("the flights", samples)):
        if inputs is not None and len(inputs):
            old = compiled(before)(np.ascontiguousarray(inputs[:, columns]))
            new = compiled(after)(inputs)
            for output in common:
                old_place = [variable.name for variable in before.outputs].index(output.name)
                pair = np.array((old[:, old_place], new[:, after.outputs.index(output)]))
                has_value = np.isfinite(pair).all(axis=0)  # a formula may have none
                rows, pair = inputs[has_value], pair[:, has_value]
                if len(rows):
                    changes.append(_change(before.outputs[old_place], output, where, names, rows, pair))
    return tuple(changes)


def over_both_ranges(before: FuzzySystem, after: FuzzySystem) -> FuzzySystem:
    """Return a system whose inputs have ranges as wide as in both; for their ranges only."""
    wider = []
    for variable in after.inputs:
        old = before.variable(variable.name)
        low, high = min(old.minimum, variable.minimum), max(old.maximum, variable.maximum)
        wider.append(replace(variable, minimum=low, maximum=high))
    return replace(after, inputs=tuple(wider))


def _change(
    before: Variable,
    output: Variable,
    where: str,
    names: list[str],
    inputs: Floats,
    values: Floats,
) -> OutputChange:
    sizes = np.abs(values[1] - values[0])
    worst = int(np.argmax(sizes))
    width = max(variable.maximum - variable.minimum for variable in (before, output))
    mean, largest = float(sizes.mean()), float(sizes[worst])
    return OutputChange(
        output=output,
        where=where,
        num_samples=len(inputs),
        mean=mean,
        largest=largest,
        mean_share=mean / width,
        largest_share=largest / width,
        inputs={name: float(value) for name, value in zip(names, inputs[worst], strict=True)},
        before=float(values[0][worst]),
        after=float(values[1][worst]),
    )


if TYPE_CHECKING:
    from fis_tools.render import Figure, Theme


#: Points along each axis.
NUM_POINTS = 61
_DARK = "(prefers-color-scheme: dark)"


def draw(system: SystemDifference) -> list[str]:
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
