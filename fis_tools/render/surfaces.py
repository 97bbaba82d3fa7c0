"""What pictures of surfaces share: evaluating, which values are held, which levels are drawn."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from fis_tools.analysis.arrays import Surface, surface
from fis_tools.model import FuzzySystem
from fis_tools.render import lettering
from fis_tools.render.theme import MEDIUM
from fis_tools.typing import Floats
from fis_tools.words.text import number, quantity

#: Outputs nearer to one another than this part of the universe are the same.
_SAME = 1e-9


def evaluated(
    system: FuzzySystem,
    x: str | None = None,
    y: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    output: str | None = None,
    num_points: int = 81,
) -> Surface:
    """Evaluate as `analysis.arrays.surface`, by default over the last two free inputs, the last as x."""
    if x is None and y is None:
        free = [variable.name for variable in system.inputs if variable.name not in (fixed or {})]
        x, y = (free[-1], free[-2]) if len(free) > 1 else (None, None)
    return surface(system, x, y, fixed=fixed, output=output, num_points=num_points)


def held_words(system: FuzzySystem, fixed: Mapping[str, float]) -> str:
    """Say what is held, with units: ``distance = 80 m, eta_u = 0 rad``."""
    return ", ".join(f"{name} = {quantity(system.variable(name), value)}" for name, value in fixed.items())


def over_axes(system: FuzzySystem, result: Surface, samples: Floats) -> Floats:
    """Return where samples lie over the two inputs of a surface, clipped to their universes, (n, 2).

    Raises
    ------
    ValueError
        If the samples have another number of inputs than the system.
    """
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


def held_without_units(result: Surface) -> str:
    """Say what is held: ``distance = 80``."""
    return ", ".join(f"{name} = {number(value)}" for name, value in result.fixed.items())


def value_limits(results: Sequence[Surface]) -> tuple[float, float]:
    """Return the least and the greatest output of some surfaces; the universe's ends where all are one.

    A formula has no value at some places, which are left out.
    """
    low = min(float(np.nanmin(result.values)) for result in results)
    high = max(float(np.nanmax(result.values)) for result in results)
    output = results[0].output
    is_flat = high - low < _SAME * (output.maximum - output.minimum)
    return (output.minimum, output.maximum) if is_flat else (low, high)


def round_levels(result: Surface, limits: tuple[float, float]) -> Floats:
    """Return round outputs between the least and the greatest, zero left out."""
    low, high = limits
    levels = np.asarray(MaxNLocator(7).tick_values(low, high), dtype=np.float64)
    is_between = (levels > np.nanmin(result.values)) & (levels < np.nanmax(result.values))
    return np.asarray(levels[is_between & (np.abs(levels) > _SAME * (high - low))])


def signed(result: Surface, limits: tuple[float, float]) -> Floats | None:
    """Return outputs whose zeros are exact, for the contour of zero; None where they are all of one sign.

    Where rules cancel, the output is zero but for the last digits, and its contour would follow these.
    """
    least = _SAME * (limits[1] - limits[0])
    values = np.where(np.abs(result.values) > least, result.values, 0.0)
    return values if np.nanmin(values) < 0.0 < np.nanmax(values) else None


def entitle(ax: Any, words: str) -> None:
    """Write a title in as many lines as it takes."""
    if words:
        ax.set_title(lettering.broken(words, lettering.inches(ax)[0], MEDIUM))
