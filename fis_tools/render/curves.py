"""Membership functions of a variable, and an output over one input."""

from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from fis_tools.analysis.arrays import evaluate
from fis_tools.array_types import Floats
from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.validate import nearest
from fis_tools.model.variables import sample_terms
from fis_tools.render import lettering
from fis_tools.render.theme import LIGHT, MEDIUM, SMALL, Theme, dress
from fis_tools.words.text import SHOWN_FROM, number, quantity, with_unit

#: Names of terms may take this share of the height of axes.
_MOST_ROOM = 0.55
_GAP = 0.08


def memberships(variable: Variable, ax: Axes, value: float | None = None, *, theme: Theme = LIGHT) -> Axes:
    """Draw the membership functions of a variable, each named over its peak.

    Parameters
    ----------
    variable : Variable
        A variable without problems.
    ax : Axes
        Where to draw.
    value : float, optional
        A value of the variable, to be marked: what belongs to its terms how far is marked on the curves and
        written above. It is clipped to the universe.
    theme : Theme
        Colours.
    """
    functions = sample_terms(variable)
    for place, function in enumerate(functions):
        ax.plot(variable.universe, function, linewidth=1.8, clip_on=False, **theme.line(place))
    room = _name(variable, functions, ax, theme)
    ax.set(xlim=(variable.minimum, variable.maximum), ylim=(0.0, 1.0 / (1.0 - room)))
    ax.set(xlabel=with_unit(variable), ylabel="membership", yticks=(0.0, 0.5, 1.0))
    lettering.few_ticks(ax)
    if value is not None:
        _mark(variable, functions, value, ax, theme)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines["left"].set_bounds(0.0, 1.0)
    dress(ax, theme)
    return ax


def peak(universe: Floats, function: Floats) -> float:
    """Return the middle of where a sampled membership function is highest."""
    place = float(np.mean(universe[function == function.max()]))
    return 0.0 if abs(place) < 1e-9 * (universe[-1] - universe[0]) else place


def _name(variable: Variable, functions: Floats, ax: Axes, theme: Theme) -> float:
    """Write each term's name over its peak, one line above the other; return the share of height taken."""
    across, down = lettering.inches(ax)
    span = variable.maximum - variable.minimum
    peaks = [across * (peak(variable.universe, row) - variable.minimum) / span for row in functions]
    most_lines = max(1, int((_MOST_ROOM * down - 0.05) / lettering.height("", SMALL)))
    names = [term.name for term in variable.terms]
    widths = [1.0, 0.6, 0.45, 0.3, 0.2, 0.15, 0.1]
    for share in widths:
        texts = [lettering.shortened(name, share * across, SMALL) for name in names]
        centres, levels = _lines(texts, peaks, across)
        if max(levels) < most_lines:
            break
    for place, (text, centre, level) in enumerate(zip(texts, centres, levels, strict=True)):
        ax.annotate(
            text,
            (centre / across, 1.0),
            xycoords=("axes fraction", "data"),
            xytext=(0, 2 + lettering.LINE_SPACING * SMALL * level),
            textcoords="offset points",
            ha="center",
            va="bottom",
            color=theme.line(place)["color"],
            fontsize=SMALL,
        )
    return min(0.7, (lettering.height("\n" * max(levels), SMALL) + 0.05) / down)


def _lines(texts: list[str], peaks: list[float], across: float) -> tuple[list[float], list[int]]:
    """Give each name its centre, inside the axes, and the lowest line on which it runs into no other."""
    centres, levels = [0.0] * len(texts), [0] * len(texts)
    ends: list[float] = []
    for place in np.argsort(peaks, kind="stable"):
        length = lettering.width(texts[place], SMALL)
        centre = float(np.clip(peaks[place], 0.5 * length, max(0.5 * length, across - 0.5 * length)))
        start = centre - 0.5 * length
        level = next((level for level, end in enumerate(ends) if end + _GAP <= start), len(ends))
        ends[level : level + 1] = [start + length]
        centres[place], levels[place] = centre, level
    return centres, levels


def _mark(variable: Variable, functions: Floats, value: float, ax: Axes, theme: Theme) -> None:
    clipped = float(np.clip(value, variable.minimum, variable.maximum))
    ax.plot([clipped, clipped], [0.0, 1.0], color=theme.ink, linewidth=1.2, zorder=3)
    belongs = []
    for place, (term, function) in enumerate(zip(variable.terms, functions, strict=True)):
        membership = float(np.interp(clipped, variable.universe, function))
        if membership >= SHOWN_FROM:
            belongs.append((membership, f"{term.name}\u00a0{membership:.2f}"))
            colour = theme.line(place)["color"]
            ax.plot(clipped, membership, "o", color=colour, mec=theme.paper, ms=6, zorder=4, clip_on=False)
    terms = ", ".join(words for _, words in sorted(belongs, key=lambda pair: -pair[0])) or "none of its terms"
    note = f" (taken as {number(clipped)})" if clipped != value else ""
    across, _ = lettering.inches(ax)
    words = f"{variable.name} = {quantity(variable, value)}{note}: {terms}"
    ax.set_title(lettering.broken(words, across, MEDIUM), loc="left")


def output_curve(
    system: FuzzySystem,
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
    (along,), concluded = system.inputs, named(system, "output", output)
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


def named(system: FuzzySystem, role: Literal["input", "output"], name: str | None) -> Variable:
    """Return the input or the output of a name, without one the first.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    variables = system.inputs if role == "input" else system.outputs
    names = [variable.name for variable in variables]
    if name is not None and name not in names:
        raise ValueError(f"system {system.name!r} has no {role} {name!r}; {nearest(name, names)}")
    return variables[0 if name is None else names.index(name)]
