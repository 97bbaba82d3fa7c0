"""An output over one input."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from fis_tools.analysis.arrays import evaluate
from fis_tools.model import FuzzySystem
from fis_tools.render.roles import named
from fis_tools.render.surfaces import entitle, held_words
from fis_tools.render.theme import LIGHT, Theme, dress
from fis_tools.typing import Floats
from fis_tools.words.text import with_unit


def output_curve(
    system: FuzzySystem,
    ax: Axes,
    x: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    output: str | None = None,
    num_points: int = 401,
    samples: Floats | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draw an output over one input, with the others fixed.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems.
    ax : Axes
        Where to draw.
    x : str, optional
        The input along the axis; by default the first.
    fixed : mapping, optional
        Values of other inputs; those not given are held in the middle of their universe.
    output : str, optional
        Which output; by default the first.
    num_points : int
        Along the axis.
    samples : (n, num_inputs), optional
        Inputs, such as those of a flight, to mark along the axis.
    theme : Theme
        Colours.

    Raises
    ------
    ValueError
        If a name is unknown.
    """
    along, concluded = named(system, "input", x), named(system, "output", output)
    names = [variable.name for variable in system.inputs]
    held = {v.name: 0.5 * (v.minimum + v.maximum) for v in system.inputs if v.name != along.name}
    held |= {named(system, "input", name).name: value for name, value in (fixed or {}).items()}
    values = np.linspace(along.minimum, along.maximum, num_points)
    columns = [values if name == along.name else np.full(num_points, held[name]) for name in names]
    outputs = evaluate(system, np.stack(columns, axis=1))[:, system.outputs.index(concluded)]
    if concluded.minimum < 0.0 < concluded.maximum:
        ax.axhline(0.0, color=theme.grid, linewidth=1.0)
    ax.plot(values, outputs, color=theme.lines[0], linewidth=1.8)
    if samples is not None:
        flown = np.clip(samples[:, names.index(along.name)], along.minimum, along.maximum)
        heights = np.interp(flown, values, outputs)
        ax.plot(flown, heights, "o", color=theme.ink, mec=theme.paper, mew=0.5, ms=4)
    ax.set(xlim=(along.minimum, along.maximum), xlabel=with_unit(along), ylabel=with_unit(concluded))
    ax.spines[["top", "right"]].set_visible(False)
    entitle(ax, held_words(system, held))
    dress(ax, theme)
    return ax
