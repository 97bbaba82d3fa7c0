"""Mamdani inference transcribed step by step into compiled code, for the readable reference flight.

The steps are those of scikit-fuzzy 0.5's ``ControlSystemSimulation.compute()``: interpolate sampled
memberships, take the minimum over each rule and the maximum over each output term's rules, insert the points
where a cut crosses its own membership function, and divide moment by area, segment by segment.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.model import FuzzySystem, rule_table
from fis_tools.model.membership import sample_terms

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SMALLEST_AREA = float(np.finfo(np.float64).eps)


class PackedSystems(NamedTuple):
    """F fuzzy systems as arrays, padded to I inputs, T terms, N points and R rules.

    Parameters
    ----------
    num_inputs : array of int, shape (F,)
    input_terms, input_points : array of int, shape (F, I)
        Terms and points of each input.
    input_grid : array, shape (F, I, N)
        Universes.
    input_memberships : array, shape (F, I, T, N)
        Sampled on them.
    output_terms, output_points : array of int, shape (F,)
    output_grid : array, shape (F, N)
    output_memberships : array, shape (F, T, N)
    rules : array of int, shape (F, R)
        Output term of each cell of the rule table, the last input changing fastest.
    default : array, shape (F,)
        Output where no rule fires.
    """

    num_inputs: Integers
    input_terms: Integers
    input_points: Integers
    input_grid: Floats
    input_memberships: Floats
    output_terms: Integers
    output_points: Integers
    output_grid: Floats
    output_memberships: Floats
    rules: Integers
    default: Floats


def pack(systems: Sequence[FuzzySystem]) -> PackedSystems:
    """Pack valid systems that have one output and a full rule table of minima, and take the centroid.

    Raises
    ------
    ValueError
        If a system is of another kind.
    """
    tables = [_table(system) for system in systems]
    variables = [v for system in systems for v in (*system.inputs, *system.outputs)]
    num_systems = len(systems)
    num_inputs = max((len(s.inputs) for s in systems), default=0)
    num_terms = max((len(v.terms) for v in variables), default=0)
    num_points = max((len(v.universe) for v in variables), default=0)
    packed = PackedSystems(
        num_inputs=np.array([len(s.inputs) for s in systems], dtype=np.int64),
        input_terms=np.zeros((num_systems, num_inputs), dtype=np.int64),
        input_points=np.zeros((num_systems, num_inputs), dtype=np.int64),
        input_grid=np.zeros((num_systems, num_inputs, num_points)),
        input_memberships=np.zeros((num_systems, num_inputs, num_terms, num_points)),
        output_terms=np.array([len(s.outputs[0].terms) for s in systems], dtype=np.int64),
        output_points=np.array([len(s.outputs[0].universe) for s in systems], dtype=np.int64),
        output_grid=np.zeros((num_systems, num_points)),
        output_memberships=np.zeros((num_systems, num_terms, num_points)),
        rules=np.zeros((num_systems, max((len(t) for t in tables), default=0)), dtype=np.int64),
        default=np.array([s.outputs[0].default or 0.0 for s in systems], dtype=np.float64),
    )
    for f, (system, table) in enumerate(zip(systems, tables, strict=True)):
        for i, variable in enumerate(system.inputs):
            memberships = sample_terms(variable)
            packed.input_terms[f, i], packed.input_points[f, i] = memberships.shape
            packed.input_grid[f, i, : memberships.shape[1]] = variable.universe
            packed.input_memberships[f, i, : memberships.shape[0], : memberships.shape[1]] = memberships
        memberships = sample_terms(system.outputs[0])
        packed.output_grid[f, : memberships.shape[1]] = system.outputs[0].universe
        packed.output_memberships[f, : memberships.shape[0], : memberships.shape[1]] = memberships
        packed.rules[f, : len(table)] = table
    return packed


def _table(system: FuzzySystem) -> Integers:
    table, output = rule_table(system), system.outputs[0]
    methods = (system.and_operator, output.accumulation, system.defuzzifier_of(output))
    if table is None or methods != ("min", "max", "centroid"):
        raise ValueError(
            f"system {system.name!r} is not a full rule table with minimum and centroid, which is all the "
            "reference flight evaluates; fly it with another engine"
        )
    return table


@compiled
def _fuzzify(systems: PackedSystems, f: int, inputs: Floats) -> Floats:
    """Return how far each input belongs to each of its terms, shape (I, T)."""
    memberships = np.zeros(systems.input_memberships.shape[1:3])
    for i in range(systems.num_inputs[f]):
        grid = systems.input_grid[f, i, : systems.input_points[f, i]]
        x = min(max(inputs[i], grid[0]), grid[-1])
        left = min(max(np.searchsorted(grid, x, side="right") - 1, 0), len(grid) - 2)
        share = (x - grid[left]) / (grid[left + 1] - grid[left])
        for t in range(systems.input_terms[f, i]):
            sampled = systems.input_memberships[f, i, t]
            memberships[i, t] = sampled[left] + share * (sampled[left + 1] - sampled[left])
    return memberships


@compiled
def _fire(systems: PackedSystems, f: int, memberships: Floats) -> Floats:
    """Return the height each output term is cut at, negative where no rule concludes on it, shape (T,)."""
    cuts = np.full(systems.output_memberships.shape[1], -1.0)
    num_rules = 1
    for i in range(systems.num_inputs[f]):
        num_rules *= systems.input_terms[f, i]
    for rule in range(num_rules):
        strength = 1.0
        place = rule
        for i in range(systems.num_inputs[f] - 1, -1, -1):
            strength = min(strength, memberships[i, place % systems.input_terms[f, i]])
            place //= systems.input_terms[f, i]
        term = systems.rules[f, rule]
        cuts[term] = max(cuts[term], strength)
    return cuts


@compiled
def _crossings(grid: Floats, memberships: Floats, cuts: Floats, num_terms: int) -> Floats:
    """Return where cuts cross their own membership functions, ascending."""
    crossings = np.empty(num_terms * len(grid))
    num_crossings = 0
    for t in range(num_terms):
        cut = cuts[t]
        if cut < 0.0:
            continue
        sampled = memberships[t]
        threshold = max(cut, 1e-300)  # scikit-fuzzy asks for more than zero where the cut is zero
        reaches = sampled[0] >= threshold
        for i in range(len(grid) - 1):
            reached = reaches
            reaches = sampled[i + 1] >= threshold
            if reaches != reached:
                step = (grid[i + 1] - grid[i]) / (sampled[i + 1] - sampled[i])
                crossings[num_crossings] = grid[i] + (cut - sampled[i]) * step
                num_crossings += 1
    return np.sort(crossings[:num_crossings])


@compiled
def _aggregate(
    grid: Floats, memberships: Floats, cuts: Floats, num_terms: int, crossings: Floats
) -> tuple[Floats, Floats]:
    """Return the grid with the crossings among it, and the highest of the cut terms there."""
    num_points = len(grid) + len(crossings)
    x = np.empty(num_points)
    y = np.zeros(num_points)
    i = 0
    c = 0
    for place in range(num_points):
        is_crossing = i == len(grid) or (c < len(crossings) and crossings[c] < grid[i])
        x[place] = crossings[c] if is_crossing else grid[i]
        for t in range(num_terms):
            if cuts[t] < 0.0:
                continue
            sampled = memberships[t]
            if is_crossing:
                slope = (sampled[i] - sampled[i - 1]) / (grid[i] - grid[i - 1])
                height = sampled[i - 1] + slope * (crossings[c] - grid[i - 1])
            else:
                height = sampled[i]
            y[place] = max(y[place], min(cuts[t], height))
        if is_crossing:
            c += 1
        else:
            i += 1
    return x, y


@compiled
def _centroid(x: Floats, y: Floats) -> float:
    """Return the centre of area of a polygon, summed segment by segment."""
    total_moment = 0.0
    total_area = 0.0
    for i in range(len(x) - 1):
        x1, x2, y1, y2 = x[i], x[i + 1], y[i], y[i + 1]
        width = x2 - x1
        if width == 0.0 or (y1 == 0.0 and y2 == 0.0):
            continue
        if y1 == y2:
            centre = 0.5 * (x1 + x2)
            area = width * y1
        else:
            centre = (2.0 / 3.0 * width * (y2 + 0.5 * y1)) / (y1 + y2) + x1
            area = 0.5 * width * (y1 + y2)
        total_moment += centre * area
        total_area += area
    return total_moment / max(total_area, SMALLEST_AREA)


@compiled
def infer(systems: PackedSystems, system_index: int, inputs: Floats) -> float:
    """Infer one system's output.

    Parameters
    ----------
    systems : PackedSystems
    system_index : int
        Which of them.
    inputs : array, shape (number of its inputs or more,)
        In the order of its inputs; clipped to the universes.

    Returns
    -------
    float
        The centroid, or the default where nothing fires.
    """
    f = system_index
    grid = systems.output_grid[f, : systems.output_points[f]]
    memberships = systems.output_memberships[f]
    num_terms = systems.output_terms[f]
    cuts = _fire(systems, f, _fuzzify(systems, f, inputs))
    crossings = _crossings(grid, memberships, cuts, num_terms)
    x, y = _aggregate(grid, memberships, cuts, num_terms, crossings)
    if y.sum() == 0.0:
        return float(systems.default[f])
    return _centroid(x, y)
