"""What programs answer that read an exported file: they sample in ways of their own, not scikit-fuzzy's.

They evaluate the formulas of inputs themselves, cut the terms of an output at points of their own, and sum
over these: MATLAB and Octave at the 101 points of `linspace`, fuzzylite in the middles of the intervals
that a file states. Both take a point for as wide as a step; scikit-fuzzy integrates straight lines between
the points of its universe. The difference grows as a universe gets coarser.
"""

from collections.abc import Iterator

import numpy as np

from fis_tools.engines import inference
from fis_tools.formats.exchange.dialect import Said
from fis_tools.model import FuzzySystem, Sampled, Variable
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS
from fis_tools.model.variables import shape_values
from fis_tools.typing import Floats
from fis_tools.words.text import number

#: Inputs at which answers are compared, the most and the fewest; fewer of many points, which take longer.
SAMPLES = 256, 16
POINTS = 20_000
#: The share of an output's range from which on a change is told.
TOLD = 1e-3


def changes(original: FuzzySystem, said: Said, *, takes_middles: bool) -> Iterator[str]:
    """Tell for each output how far the answers of other programs are from those of the original.

    Parameters
    ----------
    original : FuzzySystem
        What was written.
    said : Said
        What a reader of the file sees.
    takes_middles : bool
        Whether the readers sample the middles of intervals, as fuzzylite does.
    """
    low, high = (np.array([getattr(v, end) for v in original.inputs]) for end in ("minimum", "maximum"))
    most, fewest = SAMPLES
    count = min(most, max(fewest, POINTS // max(v.num_points for v in original.outputs)))
    samples = np.random.default_rng(0).random((count, len(low))) * (high - low) + low
    ours = inference.evaluate(original, samples)
    theirs = answers(said.system, samples, takes_middles=takes_middles)
    for output, change in zip(original.outputs, np.abs(ours - theirs).max(axis=0), strict=True):
        share = change / (output.maximum - output.minimum)
        if share >= TOLD:
            amount = number(float(f"{change:.2g}"))
            yield f"{output.name} by up to {amount}, {100 * share:.2g} % of its range"


def answers(system: FuzzySystem, samples: Floats, *, takes_middles: bool) -> Floats:
    """Return the outputs, (n, num_outputs), as sums over points, for samples (n, num_inputs)."""
    firing = inference.firing_strengths(system, samples)
    columns = []
    for place, output in enumerate(system.outputs):
        if system.weighs(output):
            columns.append(inference.evaluate(system, samples)[:, place])
            continue
        points = _points(output, takes_middles=takes_middles)
        heights = _heights(system, output, firing, points)
        columns.append(_defuzzified(system.defuzzifier_of(output), points, heights, output))
    return np.stack(columns, axis=1)


def _points(output: Variable, *, takes_middles: bool) -> Floats:
    if not takes_middles:
        return output.universe
    edges = np.linspace(output.minimum, output.maximum, output.num_points)
    middles: Floats = 0.5 * (edges[1:] + edges[:-1])
    return middles


def _heights(system: FuzzySystem, output: Variable, firing: Floats, points: Floats) -> Floats:
    """Return what the rules conclude together, (n, points)."""
    strengths: dict[str, list[Floats]] = {}
    for strength, rule in zip(firing.T, system.rules, strict=True):
        for consequent in rule.consequents:
            if consequent.variable == output.name:
                strengths.setdefault(consequent.term, []).append(consequent.weight * strength)
    imply, aggregate = AND_OPERATORS[system.implication], AGGREGATIONS[output.aggregation]
    heights = np.zeros((len(firing), len(points)))
    for term, activations in strengths.items():
        shape = output.terms[output.term_index(term)].membership
        if isinstance(shape, Sampled):
            degrees = np.interp(points, output.universe, shape.values)
        else:
            degrees = shape_values(points, shape)
        each = [np.max(activations, axis=0)] if output.counts_strongest else activations
        for activation in each:
            heights = aggregate(heights, imply(activation[:, np.newaxis], degrees[np.newaxis]))
    return heights


def _defuzzified(defuzzifier: str, points: Floats, heights: Floats, output: Variable) -> Floats:
    total = heights.sum(axis=1)
    fires = total > 0.0
    found = np.full(len(heights), output.default, dtype=np.float64)
    top = heights == heights.max(axis=1, keepdims=True)
    match defuzzifier:
        case "centroid":
            values = heights @ points / np.where(fires, total, 1.0)
        case "bisector":
            values = points[np.argmax(np.cumsum(heights, axis=1) >= 0.5 * total[:, np.newaxis], axis=1)]
        case "som":
            values = points[np.argmax(top, axis=1)]
        case "lom":
            values = points[top.shape[1] - 1 - np.argmax(top[:, ::-1], axis=1)]
        case _:
            values = (top @ points) / top.sum(axis=1)
    found[fires] = values[fires]
    return found
