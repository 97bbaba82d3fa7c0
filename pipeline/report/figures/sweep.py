"""A sweep in pictures: each run a line over all settings and outcomes, and each a point against the front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.report.figures.style import BLUE, GRID, INK, MUTED

#: up to so many values of a setting are named on its axis
MOST_NAMED = 12
#: names of points stand no nearer to each other than this share of the picture's width and height
NAMES_APART = 0.06


@dataclass(frozen=True)
class Line:
    """A run: its name, values by setting and by outcome, and whether it is on the front."""

    name: str
    settings: Mapping[str, str]
    outcomes: Mapping[str, float]
    is_on_front: bool


def parallel_coordinates(lines: Sequence[Line]) -> Figure:
    """Draw an axis for each setting and outcome, and each run as a line through its values."""
    settings, outcomes = list(lines[0].settings), list(lines[0].outcomes)
    count = len(settings) + len(outcomes)
    figure = Figure(figsize=(max(6.4, 1.6 * count), 4.6), layout="constrained")
    ax = figure.subplots()
    places = np.zeros((len(lines), count))
    for column, key in enumerate(settings):
        values = [line.settings[key] for line in lines]
        ticks = _levels(values)
        places[:, column] = [ticks[value] for value in values]
        for value, height in ticks.items() if len(ticks) <= MOST_NAMED else ():
            ax.text(column - 0.03, height, value, ha="right", va="center", fontsize=7.5, color=INK)
    for column, key in enumerate(outcomes, len(settings)):
        amounts = np.array([line.outcomes[key] for line in lines])
        low, high = float(amounts.min()), float(amounts.max())
        places[:, column] = (amounts - low) / (high - low) if high > low else 0.5
        for amount, height in ((low, 0.0), (high, 1.0)) if high > low else ((low, 0.5),):
            ax.text(column + 0.03, height, f"{amount:.4g}", ha="left", va="center", fontsize=7.5, color=INK)
    for column in range(count):
        ax.axvline(column, color=GRID, linewidth=1.2, zorder=0.5)
    for row, line in sorted(enumerate(lines), key=lambda item: item[1].is_on_front):
        colour, width = (BLUE, 1.6) if line.is_on_front else (MUTED, 0.7)
        ax.plot(range(count), places[row], color=colour, linewidth=width, alpha=0.85)
    ax.plot([], [], color=BLUE, linewidth=1.6, label="on the front")
    ax.plot([], [], color=MUTED, linewidth=0.7, label="surpassed by another run")
    ax.set_xticks(range(count), [label.replace(" (", "\n(") for label in (*settings, *outcomes)])
    ax.set_yticks([])
    ax.set_xlim(-0.5, count - 0.5)
    ax.set_ylim(-0.06, 1.06)
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _levels(values: Sequence[str]) -> dict[str, float]:
    """Place the values of a setting from 0 to 1: numbers where they lie, words evenly."""
    distinct = list(dict.fromkeys(values))
    try:
        numbers = np.array([float(value) for value in distinct])
    except ValueError:
        numbers = np.arange(len(distinct), dtype=np.float64)
    low, high = float(numbers.min()), float(numbers.max())
    if not (np.isfinite(numbers).all() and high > low):
        return dict.fromkeys(distinct, 0.5)
    return dict(zip(distinct, ((numbers - low) / (high - low)).tolist(), strict=True))


@dataclass(frozen=True)
class Point:
    """A run: mean and interval of delta-v (m/s) and of the rate (%), and whether it is on the front."""

    name: str
    delta_v: tuple[float, float, float]
    rate: tuple[float, float, float]
    is_on_front: bool


def front_of_runs(points: Sequence[Point]) -> Figure:
    """Draw mean inspection rate over mean delta-v with their intervals, a point a run, and the front."""
    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    ax = figure.subplots()
    for kind, colour, label in ((False, MUTED, "surpassed by another run"), (True, BLUE, "on the front")):
        chosen = sorted((point for point in points if point.is_on_front is kind), key=lambda p: p.delta_v)
        if not chosen:
            continue
        spent, rate = np.array([p.delta_v for p in chosen]), np.array([p.rate for p in chosen])
        ax.errorbar(
            spent[:, 0],
            rate[:, 0],
            xerr=np.abs(spent[:, 1:] - spent[:, :1]).T,
            yerr=np.abs(rate[:, 1:] - rate[:, :1]).T,
            color=colour,
            marker="o",
            markersize=5.5,
            elinewidth=0.8,
            linestyle="-" if kind else "none",
            linewidth=0.8,
            label=label,
        )
    ax.set(xlabel="mean Δv (m/s)", ylabel="mean inspection rate (%)")
    ax.margins(x=0.08, y=0.12)
    _name_front(ax, [point for point in points if point.is_on_front])
    ax.grid()
    ax.legend(loc="lower right")
    return figure


def _name_front(ax: Axes, points: Sequence[Point]) -> None:
    """Write the names of points at their places, as many as can be read."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    named: list[NDArray[np.float64]] = []
    for point in points:
        place = np.array(
            [(point.delta_v[0] - left) / (right - left), (point.rate[0] - bottom) / (top - bottom)]
        )
        if all(np.max(np.abs(place - other)) >= NAMES_APART for other in named):
            named.append(place)
            at = (point.delta_v[0], point.rate[0])
            ax.annotate(point.name, at, (5, 5), textcoords="offset points", fontsize=7.5, color=INK)
