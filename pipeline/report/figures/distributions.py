"""How delta-v, inspection rate and mean distance spread over flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.array_types import Floats
from pipeline.report.figures.style import BLUE, INK, MOST_POINTS, MUTED, VERMILION, grid

METRICS = {
    "delta_v_m_s": "Δv (m/s)",
    "inspection_rate_percent": "inspection rate (%)",
    "mean_distance_m": "mean distance (m)",
}


@dataclass(frozen=True)
class Sample:
    """Values of flights of one kind: ``values`` maps the name of a metric to an array of shape (n,)."""

    label: str
    values: Mapping[str, Floats]
    paper_means: Mapping[str, float]


def distributions(samples: Sequence[Sample], num_points: int) -> Figure:
    """Draw how delta-v, inspection rate and mean distance spread: a row a sample, a column a metric.

    Small samples are drawn value by value, large ones as histograms.

    Parameters
    ----------
    samples : sequence of Sample
        At least one.
    num_points : int
        Inspection points: rates are multiples of 100/num_points.
    """
    heights = [1.1 if len(sample.values["delta_v_m_s"]) <= MOST_POINTS else 2.0 for sample in samples]
    figure = Figure(figsize=(9.6, sum(heights) + 0.65 * len(samples) + 0.3))
    margins, between = (0.58, 0.1, 0.44, 0.4), (0.4, 0.65)
    places = grid(figure, len(samples), len(METRICS), margins, between, height_ratios=heights)
    rows = np.asarray(places.subplots(squeeze=False, sharex="col"))
    for column, (metric, label) in enumerate(METRICS.items()):
        step = 100.0 / num_points if metric == "inspection_rate_percent" else None
        edges = _bin_edges([sample.values[metric] for sample in samples], step)
        for sample, ax in zip(samples, rows[:, column], strict=True):
            values = sample.values[metric]
            if len(values) <= MOST_POINTS:
                _draw_values(ax, values)
            else:
                _draw_histogram(ax, values, edges)
            _mark_means(ax, float(values.mean()), sample.paper_means.get(metric), edges)
        rows[-1, column].set_xlabel(label)
    for sample, ax in zip(samples, rows[:, 0], strict=True):
        ax.set_title(sample.label, pad=18)
        if len(sample.values["delta_v_m_s"]) > MOST_POINTS:
            ax.set_ylabel("flights")
    return figure


def _bin_edges(samples: Sequence[Floats], step: float | None) -> Floats:
    """Return the edges of bins over all samples, but not over what stands far apart in large ones.

    Parameters
    ----------
    samples : sequence of (n,) arrays
    step : float, optional
        What values are multiples of; each multiple then has a bin of its own.
    """
    ends = np.array([_ends(values) for values in samples])
    low, high = float(ends[:, 0].min()), float(ends[:, 1].max())
    if step is not None:
        return np.asarray((np.arange(np.floor(low / step + 1e-6) - 1, round(high / step) + 2) - 0.5) * step)
    width = max(high - low, 0.02 * max(abs(high), 1.0))
    num_bins = min(45, round(2.0 * np.sqrt(max(len(values) for values in samples))))
    return np.linspace(low - 0.05 * width, high + 0.05 * width, num_bins + 1)


def _ends(values: Floats) -> tuple[float, float]:
    """Return the least and the greatest value; of large samples, at most a width of their bulk beyond it."""
    low, high = float(values.min()), float(values.max())
    if len(values) > MOST_POINTS:
        first, last = np.percentile(values, (1.0, 99.0))
        low, high = max(low, first - (last - first)), min(high, last + (last - first))
    return low, high


def _draw_values(ax: Axes, values: Floats) -> None:
    """Draw a box from quartile to quartile, its whiskers to the ends, and above it every value."""
    ax.boxplot(
        values,
        orientation="horizontal",
        positions=[0.0],
        widths=0.28,
        whis=(0, 100),
        showfliers=False,
        manage_ticks=False,
        boxprops={"color": MUTED},
        whiskerprops={"color": MUTED},
        capprops={"color": MUTED},
        medianprops={"color": MUTED, "linewidth": 1.6},
    )
    # equal values stand on one another
    heights = [0.32 + 0.11 * int(np.sum(np.isclose(values[:i], value))) for i, value in enumerate(values)]
    ax.plot(values, heights, "o", color=BLUE, markersize=4.5, alpha=0.85)
    ax.set(ylim=(-0.3, max(1.3, max(heights) + 0.2)), yticks=[])
    ax.spines["left"].set_visible(False)


def _draw_histogram(ax: Axes, values: Floats, edges: Floats) -> None:
    ax.hist(values, bins=edges.tolist(), color=BLUE, alpha=0.75)
    ax.grid(axis="y")
    ax.set_axisbelow(True)
    beyond = int(np.sum(values < edges[0])), int(np.sum(values > edges[-1]))
    words: dict[str, Any] = {"transform": ax.transAxes, "va": "top", "fontsize": 8, "color": MUTED}
    if beyond[0]:
        ax.text(0.01, 0.97, f"← {beyond[0]} more", **words)
    if beyond[1]:
        ax.text(0.99, 0.97, f"{beyond[1]} more →", ha="right", **words)


def _mark_means(ax: Axes, mean: float, paper: float | None, edges: Floats) -> None:
    """Mark our mean, and the paper's where it is known: by a line, or an arrow where it is off the scale."""
    low, high = float(edges[0]), float(edges[-1])
    ax.set_xlim(low, high)
    ax.axvline(mean, color=INK, linewidth=1.6)
    words: dict[str, Any] = {"transform": ax.transAxes, "va": "bottom", "fontsize": 8}
    ax.text(0.0, 1.02, f"— mean {mean:.4g}", color=INK, **words)
    if paper is None:
        return
    arrow = (" →", "← ")[paper < low] if not low <= paper <= high else ""
    text = f"{arrow}paper {paper:g}" if paper < low else f"paper {paper:g}{arrow}"
    if not arrow:
        ax.axvline(paper, color=VERMILION, linewidth=1.4, linestyle=(0, (4, 2)))
        text = f"- - {text}"
    ax.text(1.0, 1.02, text, color=VERMILION, ha="right", **words)
