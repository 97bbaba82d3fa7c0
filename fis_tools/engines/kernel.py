"""Compiled Mamdani inference with scikit-fuzzy's exact meaning, over flat arrays.

`pack` turns a `FuzzySystem` into numbers, `evaluate` infers a batch. What is compiled: one output, Gaussian
or other unimodal terms on evenly spaced universes, rules that are conjunctions of at most one term of each
input, minimum and maximum, centroid. Anything else is refused with a sentence.

The method is division-free: the aggregated output is linear between the points on which scikit-fuzzy samples
it, so its area and moment are weighted sums over the base grid, and each further point that scikit-fuzzy
inserts (where a cut crosses its own membership function) adds one triangle. Crossings of two different
clipped terms are not inserted, as scikit-fuzzy does not insert them either.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.model import FuzzySystem, Variable, conjunctions
from fis_tools.model.membership import is_unimodal, sample_terms
from fis_tools.model.validate import validate

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]

#: scikit-fuzzy divides by the larger of the area and this
SMALLEST_AREA = float(np.finfo(np.float64).eps)

MAX_INPUTS = 3
MAX_TERMS = 16
VECTOR = 8

#: samples that are inferred side by side: a constant, so that the compiler does so
LANES = 16

# Sections of the working space: memberships of all inputs and cuts of all lanes (lanes fastest), then for the
# lane at hand its cuts, (segment, x, y) of each crossing, heights.
# A membership of one, for inputs that a rule does not ask for, comes after those of the inputs.
ANY = MAX_INPUTS * MAX_TERMS
LANE_CUTS = (ANY + 1) * LANES
CUTS = LANE_CUTS + MAX_TERMS * LANES
CROSSINGS = CUTS + MAX_TERMS
HEIGHTS = CROSSINGS + 3 * 2 * MAX_TERMS

# One row of `Packed.layout` describes one system: how many inputs, then (terms, points, offset) for each
# possible input, then (terms, points, offset) of the output, then the offset of its rules.
NUM_INPUTS, INPUT_0, OUTPUT, RULES, LAYOUT_WIDTH = 0, 1, 10, 13, 14

# A row of `rules` holds for each system the index of each output term's peak, the bounds of each output
# term's rules, then the rules. Inside `values`: an input starts with (minimum, maximum, step, 1/step) and
# goes on with its memberships, grid point by grid point. The output starts with (first point, step, centre,
# default) and goes on with the centred grid, the memberships term by term (these rows padded with zeros), and
# the memberships point by point.
HEADER = 4


@dataclass(frozen=True)
class Packed:
    """Fuzzy systems of one controller, or of many controllers of one structure, as arrays.

    Parameters
    ----------
    layout : (F, LAYOUT_WIDTH) int
        Where the numbers of each of F systems lie.
    values : (n, V) float
        A row a controller: universes and sampled memberships.
    rules : (n, R) int
        A row a controller: for each system the peak of each output term as an index of the universe, the
        bounds of each output term's rules, then the rules sorted by output term, each as the positions of
        its memberships in the concatenated input terms.
    cells : tuple of (rules, inputs) int arrays
        For each system, in the order of its rules, the term that a rule asks for of each input, -1 for none.
    """

    layout: Indices
    values: Floats
    rules: Indices
    cells: tuple[NDArray[np.int64], ...]


class NotCompilable(ValueError):  # noqa: N818
    """A system that the compiled kernel does not cover; the text says why."""


def padded(points: int) -> int:
    """Return the length of a row of grid values: a whole number of vectors, zero beyond the points."""
    return (points + VECTOR - 1) // VECTOR * VECTOR


def layout_of(systems: tuple[FuzzySystem, ...]) -> tuple[Indices, int, int]:
    """Lay out the numbers of some systems one after the other.

    Returns
    -------
    layout : (F, LAYOUT_WIDTH) int
    num_values, num_rule_entries : int
        Lengths of a row of `values` and of `rules`.

    Raises
    ------
    NotCompilable
        If a system is of a kind that the kernel does not cover.
    """
    layout = np.zeros((len(systems), LAYOUT_WIDTH), dtype=np.uint64)
    value, entry = 0, 0
    for row, system in zip(layout, systems, strict=True):
        _require_compilable(system)
        row[NUM_INPUTS] = len(system.inputs)
        for place, variable in enumerate(system.inputs):
            terms, points = len(variable.terms), variable.num_points
            row[INPUT_0 + 3 * place : INPUT_0 + 3 * place + 3] = terms, points, value
            value += HEADER + terms * points
        output = system.outputs[0]
        terms, points = len(output.terms), output.num_points
        row[OUTPUT : OUTPUT + 3] = terms, points, value
        value += HEADER + padded(points) * (1 + terms) + points * terms
        row[RULES] = entry
        entry += 2 * terms + 1 + len(system.rules) * len(system.inputs)
    return layout, value, entry


def _require_compilable(system: FuzzySystem) -> None:
    def refuse(fact: str) -> None:
        raise NotCompilable(
            f"system {system.name!r} cannot be compiled: {fact}; evaluate it with fis_tools.engines.inference"
        )

    if not 1 <= len(system.inputs) <= MAX_INPUTS:
        refuse(f"it has {len(system.inputs)} inputs, 1 to {MAX_INPUTS} are covered")
    if conjunctions(system) is None:
        refuse(
            "its rules are not plain conjunctions that conclude one term of one output with weight 1, "
            "without operators of their own"
        )
    output = system.outputs[0]
    methods = (system.and_operator, system.or_operator, output.accumulation, system.defuzzifier_of(output))
    if methods != ("min", "max", "max", "centroid"):
        refuse("only minimum, maximum and centroid are covered")
    for variable in (*system.inputs, *system.outputs):
        if len(variable.terms) > MAX_TERMS:
            refuse(f"{variable.name!r} has {len(variable.terms)} terms, at most {MAX_TERMS} are covered")
        if variable.points is not None:
            refuse(f"the universe of {variable.name!r} is not evenly spaced")


def pack(*systems: FuzzySystem) -> Packed:
    """Turn systems into the arrays that the kernel reads, as one controller.

    Raises
    ------
    fis_tools.model.validate.InvalidSystem
        If a system is wrong in itself.
    NotCompilable
        If the kernel does not cover it.
    """
    for system in systems:
        validate(system)
    layout, num_values, num_entries = layout_of(systems)
    values = np.zeros((1, num_values))
    rules = np.zeros((1, num_entries), dtype=np.uint64)
    cells: list[NDArray[np.int64]] = []
    for row, system in zip(layout, systems, strict=True):
        for place, variable in enumerate(system.inputs):
            fill_input(values, row, place, *_ends(variable), sample_terms(variable)[np.newaxis])
        output = system.outputs[0]
        memberships = sample_terms(output)
        for term, sampled in zip(output.terms, memberships, strict=True):
            if not is_unimodal(sampled):
                raise NotCompilable(
                    f"system {system.name!r} cannot be compiled: output term {term.name!r} has more than "
                    "one peak; evaluate it with fis_tools.engines.inference"
                )
        default = 0.0 if output.default is None else output.default
        fill_output(values, rules, row, *_ends(output), np.array([default]), memberships[np.newaxis])
        rule_base = conjunctions(system)
        assert rule_base is not None  # noqa: S101 - any other has been refused by layout_of
        cells.append(rule_base[0])
        fill_rules(rules, row, rule_base[0], rule_base[1][np.newaxis])
    return Packed(layout, values, rules, tuple(cells))


def _ends(variable: Variable) -> tuple[Floats, Floats]:
    return np.array([variable.minimum]), np.array([variable.maximum])


def fill_input(values: Floats, row: Indices, place: int, low: Floats, high: Floats, terms: Floats) -> None:
    """Write one input of n controllers: ends of shape (n,), memberships of shape (n, terms, points)."""
    num_terms, num_points, at = map(int, row[INPUT_0 + 3 * place : INPUT_0 + 3 * place + 3])
    step = (high - low) / (num_points - 1)
    values[:, at : at + HEADER] = np.stack([low, high, step, 1.0 / step], axis=-1)
    by_point = terms.transpose(0, 2, 1).reshape(len(terms), -1)
    values[:, at + HEADER : at + HEADER + num_terms * num_points] = by_point


def fill_output(
    values: Floats, rules: Indices, row: Indices, low: Floats, high: Floats, default: Floats, terms: Floats
) -> None:
    """Write the output of n controllers: ends and default of shape (n,), memberships (n, terms, points)."""
    num_terms, num_points, at = map(int, row[OUTPUT : OUTPUT + 3])
    peaks = int(row[RULES])
    rules[:, peaks : peaks + num_terms] = terms.argmax(axis=2)
    step = (high - low) / (num_points - 1)
    centre = 0.5 * (low + high)
    values[:, at : at + HEADER] = np.stack([low, step, centre, default], axis=-1)
    grid = at + HEADER
    by_term = grid + padded(num_points)
    by_point = by_term + num_terms * padded(num_points)
    values[:, grid : grid + num_points] = np.linspace(low, high, num_points, axis=-1) - centre[:, np.newaxis]
    rows = values[:, by_term:by_point].reshape(len(values), num_terms, -1)
    rows[:, :, :num_points] = terms
    values[:, by_term:by_point] = rows.reshape(len(values), -1)
    values[:, by_point : by_point + num_terms * num_points] = terms.transpose(0, 2, 1).reshape(len(terms), -1)


def fill_rules(
    rules: Indices, row: Indices, cells: NDArray[np.int64], consequents: NDArray[np.int64]
) -> None:
    """Write the rules of n controllers: cells (rules, inputs) that all share, consequents (n, rules)."""
    num_inputs, num_terms = int(row[NUM_INPUTS]), int(row[OUTPUT])
    at = int(row[RULES]) + num_terms
    counts = [int(row[INPUT_0 + 3 * place]) for place in range(num_inputs)]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    slots = np.where(cells < 0, ANY, cells + starts)
    order = np.argsort(consequents, axis=1, kind="stable")
    bounds = [(consequents < term).sum(axis=1) for term in range(num_terms + 1)]
    rules[:, at : at + num_terms + 1] = np.stack(bounds, axis=1)
    sorted_slots = slots[order].reshape(len(consequents), -1)
    rules[:, at + num_terms + 1 : at + num_terms + 1 + sorted_slots.shape[1]] = sorted_slots


# Indices inside the kernels are unsigned: a signed one costs numba a test for counting from the end at every
# access. Mixed arithmetic of signed and unsigned would be floating point, hence these constants.
U0, U1, U2, U3, U4, U5 = map(np.uint64, range(6))
U_INPUT_0, U_OUTPUT, U_RULES, U_HEADER = map(np.uint64, (INPUT_0, OUTPUT, RULES, HEADER))
U_LAYOUT_WIDTH = np.uint64(LAYOUT_WIDTH)
U_LANE_CUTS, U_CUTS, U_CROSSINGS, U_HEIGHTS = map(np.uint64, (LANE_CUTS, CUTS, CROSSINGS, HEIGHTS))
U_LANES = np.uint64(LANES)
U_VECTOR = np.uint64(VECTOR)


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def fuzzify(
    values: Floats,
    layout: Indices,
    system: np.uint64,
    place: np.uint64,
    inputs: Floats,
    scratch: Floats,
    start: np.uint64,
) -> np.uint64:
    """Write the memberships of all lanes in all terms of one input, linear between points of its universe.

    Returns the number of terms after the last one written.
    """
    terms = layout[system + U_INPUT_0 + U3 * place]
    points = layout[system + U_INPUT_0 + U3 * place + U1]
    at = layout[system + U_INPUT_0 + U3 * place + U2]
    minimum, maximum, step, inverse_step = values[at], values[at + U1], values[at + U2], values[at + U3]
    for lane in range(U_LANES):
        x = inputs[place * U_LANES + lane]
        x = x if x > minimum else minimum
        x = x if x < maximum else maximum
        left = np.uint64(np.int64((x - minimum) * inverse_step))
        left = left if left < points - U2 else points - U2
        fraction = (x - (minimum + np.int64(left) * step)) * inverse_step
        here = at + U_HEADER + left * terms
        for term in range(terms):
            mu = values[here + term]
            scratch[(start + term) * U_LANES + lane] = mu + fraction * (values[here + terms + term] - mu)
    end: np.uint64 = start + terms
    return end


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def cut_terms(rules: Indices, layout: Indices, system: np.uint64, scratch: Floats) -> None:
    """Write the height at which each output term is cut in each lane: the strongest of its rules."""
    inputs = layout[system]
    terms = layout[system + U_OUTPUT]
    bounds = layout[system + U_RULES] + terms
    cells = bounds + terms + U1
    for term in range(terms):
        cut = U_LANE_CUTS + term * U_LANES
        for lane in range(U_LANES):
            scratch[cut + lane] = 0.0
        for rule in range(rules[bounds + term], rules[bounds + term + U1]):
            cell = cells + inputs * rule
            first = rules[cell] * U_LANES
            second = rules[cell + U1] * U_LANES if inputs > U1 else first
            third = rules[cell + U2] * U_LANES if inputs > U2 else second
            for lane in range(U_LANES):
                strength = scratch[first + lane]
                other = scratch[second + lane]
                strength = other if other < strength else strength
                other = scratch[third + lane]
                strength = other if other < strength else strength
                highest = scratch[cut + lane]
                scratch[cut + lane] = strength if strength > highest else highest


# The sums may be taken in any order: that is what lets them run on vector units.
@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def grid_sums(
    values: Floats, grid: np.uint64, width: np.uint64, terms: np.uint64, scratch: Floats
) -> tuple[float, float]:
    """Aggregate the cut terms on the base grid.

    Writes the aggregated heights and returns their sum and the sum of heights times centred positions.
    """
    total, moment = 0.0, 0.0
    m0 = grid + width
    if terms == U5:
        c0, c1, c2 = scratch[U_CUTS], scratch[U_CUTS + U1], scratch[U_CUTS + U2]
        c3, c4 = scratch[U_CUTS + U3], scratch[U_CUTS + U4]
        m1, m2, m3, m4 = m0 + width, m0 + U2 * width, m0 + U3 * width, m0 + U4 * width
        for j in range(width):
            y = values[m0 + j] if values[m0 + j] < c0 else c0
            z = values[m1 + j] if values[m1 + j] < c1 else c1
            y = z if z > y else y
            z = values[m2 + j] if values[m2 + j] < c2 else c2
            y = z if z > y else y
            z = values[m3 + j] if values[m3 + j] < c3 else c3
            y = z if z > y else y
            z = values[m4 + j] if values[m4 + j] < c4 else c4
            y = z if z > y else y
            scratch[U_HEIGHTS + j] = y
            total += y
            moment += y * values[grid + j]
        return total, moment
    for j in range(width):
        scratch[U_HEIGHTS + j] = 0.0
    for term in range(terms):
        cut = scratch[U_CUTS + term]
        here = m0 + term * width
        for j in range(width):
            z = values[here + j] if values[here + j] < cut else cut
            y = scratch[U_HEIGHTS + j]
            scratch[U_HEIGHTS + j] = z if z > y else y
    for j in range(width):
        total += scratch[U_HEIGHTS + j]
        moment += scratch[U_HEIGHTS + j] * values[grid + j]
    return total, moment


@compiled(error_model="numpy", fastmath={"contract"})
def infer(
    values: Floats,
    rules: Indices,
    layout: Indices,
    index: np.uint64,
    inputs: Floats,
    scratch: Floats,
    num_lanes: np.uint64,
    outputs: Floats,
) -> None:
    """Infer the outputs of one system for up to `LANES` samples side by side.

    Parameters
    ----------
    values, rules : rows of `Packed.values` and `Packed.rules`
    layout : `Packed.layout`, flat
    index : which of the systems
    inputs : (MAX_INPUTS * LANES,) float
        Lanes fastest; finite, in unused lanes too; clipped to the universes here.
    scratch : (HEIGHTS + padded points of the output,) float
        Working space of `scratch_for`.
    num_lanes : lanes that count
    outputs : (LANES,) float
        Written: the centroid, or the system's default where no rule fires.
    """
    system = index * U_LAYOUT_WIDTH
    start = U0
    for place in range(layout[system]):
        start = fuzzify(values, layout, system, np.uint64(place), inputs, scratch, start)
    cut_terms(rules, layout, system, scratch)
    for lane in range(num_lanes):
        for term in range(layout[system + U_OUTPUT]):
            scratch[U_CUTS + term] = scratch[U_LANE_CUTS + term * U_LANES + lane]
        outputs[lane] = centroid(values, rules, layout, system, scratch)


@compiled(error_model="numpy", fastmath={"contract"})
def centroid(values: Floats, rules: Indices, layout: Indices, system: np.uint64, scratch: Floats) -> float:
    """Return the centroid of the output's cut terms together, or the default where all cuts are zero."""
    terms = layout[system + U_OUTPUT]
    points = layout[system + U_OUTPUT + U1]
    at = layout[system + U_OUTPUT + U2]
    step: float = values[at + U1]
    centre: float = values[at + U2]
    grid = at + U_HEADER
    width = (points + U_VECTOR - U1) // U_VECTOR * U_VECTOR
    total, moment = grid_sums(values, grid, width, terms, scratch)
    if total == 0.0:
        default: float = values[at + U3]
        return default
    first, last = scratch[U_HEIGHTS], scratch[U_HEIGHTS + points - U1]
    area: float = step * (total - 0.5 * (first + last))
    ends = 0.5 * (first * values[grid] + last * values[grid + points - U1])
    moment = step * (moment - ends + step * (first - last) / 6.0)
    more_area, more_moment = crossing_triangles(
        values, rules, grid, layout[system + U_RULES], points, width, terms, scratch
    )
    area += more_area
    moment += more_moment
    output: float = (
        (moment + centre * area) / SMALLEST_AREA if area < SMALLEST_AREA else centre + moment / area
    )
    return output


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def crossing_triangles(
    values: Floats,
    rules: Indices,
    grid: np.uint64,
    peaks: np.uint64,
    points: np.uint64,
    width: np.uint64,
    terms: np.uint64,
    scratch: Floats,
) -> tuple[float, float]:
    """Return the area and moment that the points inserted at cut crossings add to the base grid's."""
    area, moment = 0.0, 0.0
    by_point = grid + width + terms * width
    count = U0
    top = U1
    while top + top < points:
        top += top
    for side in range(U2 * terms):
        term = side >> U1
        cut = scratch[U_CUTS + term]
        here = grid + width + term * width
        peak = rules[peaks + term]
        if cut == 0.0 or values[here + peak] < cut:
            continue
        if side & U1 == U0:
            below = rising(values, here, peak, top, cut)
            if below == U0:
                continue
            left = below - U1
        else:
            left = falling(values, here, peak, points, top, cut)
            if left + U1 == points:
                continue
        fraction = (cut - values[here + left]) / (values[here + left + U1] - values[here + left])
        xl, yl = values[grid + left], scratch[U_HEIGHTS + left]
        xr, yr = values[grid + left + U1], scratch[U_HEIGHTS + left + U1]
        x = xl + fraction * (xr - xl)
        y = height_between(values, by_point + left * terms, fraction, terms, scratch)
        segment = np.float64(np.int64(left))
        for crossing in range(count):
            at = U_CROSSINGS + U3 * crossing
            if scratch[at] == segment:
                xk = scratch[at + U1]
                if xl < xk <= x:
                    xl, yl = xk, scratch[at + U2]
                elif x < xk < xr:
                    xr, yr = xk, scratch[at + U2]
        at = U_CROSSINGS + U3 * count
        scratch[at] = segment
        scratch[at + U1] = x
        scratch[at + U2] = y
        count += U1
        triangle = 0.5 * ((xr - xl) * (y - yl) - (x - xl) * (yr - yl))
        area += triangle
        moment += triangle * (xl + x + xr) / 3.0
    return area, moment


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def clipped(values: Floats, at: np.uint64, terms: np.uint64, fraction: float, cut: float) -> float:
    """Return one cut term between two points of the universe."""
    mu = values[at]
    mu += fraction * (values[at + terms] - mu)
    return mu if mu < cut else cut


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def height_between(
    values: Floats, row: np.uint64, fraction: float, terms: np.uint64, scratch: Floats
) -> float:
    """Return the aggregated height between two points of the universe."""
    y = 0.0
    if terms == U5:  # a constant, so that the loop is unrolled
        for term in range(U5):
            z = clipped(values, row + term, U5, fraction, scratch[U_CUTS + term])
            y = z if z > y else y
        return y
    for term in range(terms):
        z = clipped(values, row + term, terms, fraction, scratch[U_CUTS + term])
        y = z if z > y else y
    return y


# Both searches halve a step without a branch that depends on values, which a processor could not foresee.
@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def rising(values: Floats, here: np.uint64, peak: np.uint64, top: np.uint64, cut: float) -> np.uint64:
    """Return how many points before the peak lie below the cut."""
    count = U0
    step = top
    while step > U0:
        is_below = (count + step <= peak) & (values[here + count + step - U1] < cut)
        count += step * np.uint64(is_below)
        step >>= U1
    return count


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def falling(
    values: Floats, here: np.uint64, peak: np.uint64, points: np.uint64, top: np.uint64, cut: float
) -> np.uint64:
    """Return the last point that reaches the cut; the peak does."""
    last = peak
    step = top
    while step > U0:
        reaches = (last + step < points) & (values[here + last + step] >= cut)
        last += step * np.uint64(reaches)
        step >>= U1
    return last


@compiled(nogil=True, error_model="numpy", fastmath={"contract"})
def _evaluate(
    values: Floats,
    rules: Indices,
    layout: Indices,
    index: np.uint64,
    inputs: Floats,
    scratch: Floats,
    out: Floats,
) -> None:
    side_by_side = np.zeros(MAX_INPUTS * LANES)
    outputs = np.zeros(LANES)
    for first in range(0, len(inputs), LANES):
        num_lanes = min(LANES, len(inputs) - first)
        for lane in range(num_lanes):
            for place in range(inputs.shape[1]):
                side_by_side[place * LANES + lane] = inputs[first + lane, place]
        infer(values, rules, layout, index, side_by_side, scratch, np.uint64(num_lanes), outputs)
        for lane in range(num_lanes):
            out[first + lane] = outputs[lane]


@compiled(error_model="numpy", fastmath={"contract"})
def _strengths(
    values: Floats,
    layout: Indices,
    index: np.uint64,
    cells: NDArray[np.int64],
    inputs: Floats,
    scratch: Floats,
    out: Floats,
) -> None:
    system = index * U_LAYOUT_WIDTH
    row = np.zeros(MAX_INPUTS * LANES)
    starts = np.zeros(MAX_INPUTS, dtype=np.int64)
    for sample in range(len(inputs)):
        start = U0
        for place in range(layout[system]):
            starts[place] = np.int64(start)
            row[place * U_LANES] = inputs[sample, place]
            start = fuzzify(values, layout, system, np.uint64(place), row, scratch, start)
        for rule in range(len(cells)):
            strength = 1.0
            for place in range(cells.shape[1]):
                if cells[rule, place] >= 0:
                    strength = min(strength, scratch[(starts[place] + cells[rule, place]) * LANES])
            out[sample, rule] = strength


def scratch_for(packed: Packed) -> Floats:
    """Allocate the working space that `infer` needs for any system of a controller."""
    scratch = np.zeros(HEIGHTS + padded(int(packed.layout[:, OUTPUT + 1].max())))
    scratch[ANY * LANES : LANE_CUTS] = 1.0
    return scratch


def evaluate(packed: Packed, inputs: Floats, system: int = 0) -> Floats:
    """Infer a batch.

    Parameters
    ----------
    packed : Packed
        Its first controller is evaluated.
    inputs : (n, number of inputs)
        Finite; clipped to the universes.
    system : int
        Which of the controller's systems.

    Returns
    -------
    (n,) float

    Raises
    ------
    ValueError
        If the shape is wrong or an input is not finite.
    """
    rows = _checked(packed, inputs, system)
    out = np.empty(len(rows))
    layout, index, scratch = packed.layout.ravel(), np.uint64(system), scratch_for(packed)
    _evaluate(packed.values[0], packed.rules[0], layout, index, rows, scratch, out)
    return out


def firing_strengths(packed: Packed, inputs: Floats, system: int = 0) -> Floats:
    """Return how strongly each rule fires, shape (n, rules), in the order of the rules.

    Takes and raises what `evaluate` does.
    """
    rows = _checked(packed, inputs, system)
    out = np.empty((len(rows), len(packed.cells[system])))
    layout, index, scratch = packed.layout.ravel(), np.uint64(system), scratch_for(packed)
    _strengths(packed.values[0], layout, index, packed.cells[system], rows, scratch, out)
    return out


def _checked(packed: Packed, inputs: Floats, system: int) -> Floats:
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    expected = int(packed.layout[system, NUM_INPUTS])
    if rows.ndim != 2 or rows.shape[1] != expected:
        raise ValueError(f"inputs have shape {rows.shape}; pass (n, {expected}), a row a sample")
    if not np.isfinite(rows).all():
        raise ValueError("inputs hold NaN or infinity; pass finite numbers, out-of-range ones are clipped")
    return rows
