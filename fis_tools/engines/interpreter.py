"""The compiled functions that run a `Program`: any fuzzy system, exactly, step by step.

`fis_tools.engines.inference` defines the computation; this is the same arithmetic in the same order for many
samples, with every operator, weight, universe, output and defuzzifier of the model.
`fis_tools.engines.kernel` is faster still and supports fewer systems.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import isfinite, isnan

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed, gather, least, load, most, select, some, splat, store
from fis_tools.engines import codes
from fis_tools.engines.defuzzifier import conclude_by_rule, conclude_by_term, weigh, weigh_rows
from fis_tools.engines.intervals import conclude_interval, weigh_interval
from fis_tools.engines.lanes import LANES, combine_lanes, write_degrees
from fis_tools.engines.program import Antecedents, Conclusion, IntervalOutput, Program, Summation, Weighing
from fis_tools.engines.sampled_lanes import conclude_lanes, conclude_sampled, make_room

#: firing strengths per block between evaluating rules and outputs: so many stay in the processor's cache
BLOCK = 65_536


def fire(program: Program, inputs: Floats) -> Floats:
    """Return the firing strengths, before weights, (n, num_rules), for inputs (n, num_inputs)."""
    firing = np.empty((len(inputs), program.num_rules))
    fire_rows(program.antecedents, inputs, firing)
    return firing


def conclude(program: Program, firing: Floats, inputs: Floats | None = None) -> Floats:
    """Return the outputs, (n, num_outputs), for firing strengths (n, num_rules) of inputs (n, num_inputs).

    Inputs are needed only for rules that conclude numbers linear in them.

    Raises
    ------
    ValueError
        If inputs are needed and not given.
    """
    if inputs is None:
        if program.asks_for_inputs:
            raise ValueError("rules conclude numbers that depend on the inputs; pass these, (n, num_inputs)")
        inputs = np.zeros((len(firing), len(program.antecedents.inputs)))
    columns = np.empty((len(program.conclusions), len(firing)))
    for step in _concluding(program, firing, inputs, columns):
        step()
    return columns.T


def evaluate(program: Program, inputs: Floats) -> Floats:
    """Return the outputs, (n, num_outputs), for inputs (n, num_inputs)."""
    columns = np.empty((len(program.conclusions), len(inputs)))
    if (numbers := weighed_numbers(program)) is not None:
        average_rows(program.antecedents, numbers, inputs, columns[0])
        return columns.T
    if program.only_summation is not None:
        sum_rows(program.antecedents, program.only_summation, inputs, columns[0])
        return columns.T
    size = max(LANES, min(BLOCK // program.num_rules, len(inputs)))
    firing = np.empty((size, program.num_rules))
    for first in range(0, len(inputs), size):
        rows = inputs[first : first + size]
        fire_rows(program.antecedents, rows, firing[: len(rows)])
        for step in _concluding(program, firing[: len(rows)], rows, columns[:, first : first + size]):
            step()
    return columns.T


def weighed_numbers(program: Program) -> Weighing | None:
    """Return the only output, if it is of weighted numbers: `average_rows` infers it in one pass."""
    first, *others = program.conclusions
    if others or not isinstance(first, Weighing) or (first.kinds != codes.NUMBER).any():
        return None
    if first.accumulation != codes.UNBOUNDED_SUM:
        return None
    return first


def prepare(program: Program) -> Callable[..., list[float]]:
    """Return a function from the inputs of one sample to its outputs; see `CompiledSystem.prepare`.

    Its arrays are reused.
    """
    limits = program.limits.tolist()
    row = np.zeros((1, len(limits)))
    outputs = np.empty(len(program.conclusions))
    run = _prepared(program, row, outputs)
    run()  # compiles, or loads compiled code
    flat = row[0]

    def infer(*values: float) -> list[float]:
        if len(values) != len(limits):
            raise ValueError(f"{len(values)} inputs are given; pass {len(limits)} numbers, in their order")
        if not isfinite(sum(values)):
            values = tuple(map(_finite, values, limits))
        for index, value in enumerate(values):
            flat[index] = value
        run()
        return outputs.tolist()

    return infer


def _finite(value: float, ends: tuple[float, float]) -> float:
    """Return a number, with an infinite one replaced by the end of its range."""
    if isnan(value):
        raise ValueError("an input is NaN; pass numbers, those out of range are clipped")
    return value if isfinite(value) else ends[value > 0.0]


def _prepared(program: Program, row: Floats, outputs: Floats) -> Callable[[], None]:
    """Return a function that infers from a row, (1, num_inputs), and writes the outputs, (num_outputs,)."""
    if (numbers := weighed_numbers(program)) is not None:
        return _direct(partial(average_rows, program.antecedents, numbers, row, outputs))
    if program.only_summation is not None:
        return _direct(partial(sum_rows, program.antecedents, program.only_summation, row, outputs))
    firing, columns = np.empty((1, program.num_rules)), outputs[:, np.newaxis]
    fire = partial(fire_rows, program.antecedents, row, firing)
    steps = list(map(_direct, (fire, *_concluding(program, firing, row, columns))))

    def run() -> None:
        for step in steps:
            step()

    return run


def _direct(step: partial[None]) -> Callable[[], None]:
    """Bind a compiled function to its arguments, so that calls look at none of them."""
    bound: Callable[..., Callable[[], None]] | None = getattr(step.func, "bound", None)
    return step if bound is None else bound(*step.args)


def _concluding(program: Program, firing: Floats, inputs: Floats, columns: Floats) -> Iterator[partial[None]]:
    """Yield functions that write the outputs, (num_outputs, n), one after the other.

    They read firing strengths (n, num_rules) of inputs (n, num_inputs), and the outputs before their own.
    """
    for index, conclusion in enumerate(program.conclusions):
        out = columns[index]
        if isinstance(conclusion, IntervalOutput):
            yield _reducing(conclusion, firing, inputs, program.limits, out)
        elif isinstance(conclusion, Weighing) and conclusion.formulas:
            yield partial(weigh, conclusion, firing, inputs, program.limits, columns[:index], out)
        elif isinstance(conclusion, Weighing):
            none = np.empty((len(inputs), 0))
            yield partial(weigh_rows, conclusion, none, firing, inputs, program.limits, out)
        elif (summation := program.summations[index]) is not None:
            yield partial(conclude_sampled, summation, firing, out)
        elif conclusion.cuts:
            yield partial(conclude_by_term, conclusion, firing, out)
        else:
            yield partial(conclude_by_rule, conclusion, firing, out)


def _reducing(
    pair: IntervalOutput, firing: Floats, inputs: Floats, limits: Floats, out: Floats
) -> partial[None]:
    """Return a function that writes an interval type-2 output."""
    lower, upper = pair.lower, pair.upper
    if isinstance(lower, Weighing) and isinstance(upper, Weighing):
        lower, upper = (part._replace(formulas=(), names=()) for part in (lower, upper))
        return partial(weigh_interval, lower, upper, pair.is_mean, firing, inputs, limits, out)
    assert isinstance(lower, Conclusion) and isinstance(upper, Conclusion)  # noqa: S101, PT018 - of one kind
    return partial(conclude_interval, lower, upper, pair.is_mean, firing, out)


@compiled(error_model="numpy", forceinline=True)
def fuzzify(antecedents: Antecedents, index: int, inputs: Floats, slots: Floats, slot: int) -> None:
    """Write the memberships of `LANES` values of one input in its terms, linear between points.

    The values are clipped to the universe where they are; memberships begin at a slot.
    """
    layout, universes, memberships = antecedents.inputs, antecedents.universes, antecedents.memberships
    terms, points, start, row = layout[index, 0], layout[index, 1], layout[index, 2], layout[index, 3]
    at = index * LANES
    low, high = universes[start], universes[start + points - 1]
    x = least(most(load(inputs, at, LANES), low), high)
    store(inputs, at, x)
    left = least(np.floor((x - low) * ((points - 1) / (high - low))), points - 1.0)
    below = gather(universes, start, left)
    above = gather(universes, start, least(left + 1.0, points - 1.0))
    if some((x < below) | ((x >= above) & (left < points - 1.0))):  # the points are not evenly spaced
        for lane in range(LANES):
            universe = universes[start : start + points]
            point = np.searchsorted(universe, inputs[at + lane], side="right") - 1
            ahead, distance = row + 2 * terms * point, inputs[at + lane] - universe[point]
            for term in range(terms):
                slots[slot + term * LANES + lane] = (
                    memberships[ahead + terms + term] * distance + memberships[ahead + term]
                )
        return
    distance, ahead = x - below, left * (2.0 * terms)
    for term in range(terms):
        slope = gather(memberships, row + terms + term, ahead)
        store(slots, slot + term * LANES, slope * distance + gather(memberships, row + term, ahead))


@compiled(error_model="numpy", forceinline=True)
def fire_lanes(antecedents: Antecedents, values: Floats, first: int, inputs: Floats, slots: Floats) -> int:
    """Write the clipped inputs and all degrees of up to `LANES` samples; return how many they are."""
    layout, steps = antecedents.inputs, antecedents.steps
    limits, shapes = antecedents.limits, antecedents.shapes
    num_lanes, slot = min(LANES, len(values) - first), 0
    for antecedent in range(len(layout)):
        for lane in range(num_lanes):
            inputs[antecedent * LANES + lane] = values[first + lane, antecedent]
        if len(shapes.kinds) > 0:
            at = antecedent * LANES
            for lane in range(num_lanes, LANES):  # the last sample once more
                inputs[at + lane] = inputs[at + num_lanes - 1]
            x = load(inputs, at, LANES)
            store(inputs, at, least(most(x, limits[antecedent, 0]), limits[antecedent, 1]))
            for term in range(slot, slot + layout[antecedent, 0]):
                write_degrees(shapes, term, inputs, at, slots, term * LANES)
        else:
            fuzzify(antecedents, antecedent, inputs, slots, slot * LANES)
        slot += layout[antecedent, 0]
    for index in range(len(steps)):
        operator, a, b = steps[index, 0], steps[index, 1] * LANES, steps[index, 2] * LANES
        combine_lanes(operator, slots, a, b, (slot + index) * LANES)
    return num_lanes


@compiled(error_model="numpy", nogil=True)
def fire_rows(antecedents: Antecedents, values: Floats, out: Floats) -> None:
    """Write the firing strengths of antecedents for values (n, num_inputs)."""
    program = borrowed(antecedents)
    layout, rule_slots = program.inputs, program.rule_slots
    work = np.zeros((layout[:, 0].sum() + len(program.steps)) * LANES), np.zeros(len(layout) * LANES)
    slots, inputs = borrowed(work)
    for first in range(0, len(values), LANES):
        num_lanes = fire_lanes(program, values, first, inputs, slots)
        for lane in range(num_lanes):
            for rule in range(len(rule_slots)):
                out[first + lane, rule] = slots[rule_slots[rule] * LANES + lane]


@compiled(error_model="numpy", nogil=True)
def sum_rows(antecedents: Antecedents, summation: Summation, values: Floats, out: Floats) -> None:
    """Write the one output, (n,), for values (n, num_inputs): a sum over points, by strengths not stored."""
    held, summed = borrowed((antecedents, summation))
    room = np.zeros((held.inputs[:, 0].sum() + len(held.steps)) * LANES), np.zeros(len(held.inputs) * LANES)
    slots, inputs = borrowed(room)
    memory = make_room(summed, len(held.rule_slots))
    for first in range(0, len(values), LANES):
        fire_lanes(held, values, first, inputs, slots)
        conclude_lanes(summed, slots, held.rule_slots, borrowed(memory), out[first : first + LANES])


@compiled(error_model="numpy", nogil=True)
def average_rows(antecedents: Antecedents, weighing: Weighing, values: Floats, out: Floats) -> None:
    """Write the one output, (n,), for values (n, num_inputs): numbers, weighted by strengths not stored."""
    program, weighed = borrowed((antecedents, weighing))
    rules, weights, parameters = weighed.rules, weighed.weights, weighed.parameters
    num_inputs = len(program.inputs)
    scale = 1.0 if weighed.defuzzifier == codes.WEIGHTED_SUM else codes.RAISED_WEIGHT
    work = np.zeros((program.inputs[:, 0].sum() + len(program.steps)) * LANES), np.zeros(num_inputs * LANES)
    slots, inputs = borrowed(work)
    answers = np.empty(LANES)
    for first in range(0, len(values), LANES):
        num_lanes = fire_lanes(program, values, first, inputs, slots)
        total, moment = splat(0.0, LANES), splat(0.0, LANES)
        for index in range(len(rules)):
            strength = load(slots, program.rule_slots[rules[index]] * LANES, LANES) * weights[index]
            strength = select(strength < 0.0, 0.0, strength)  # a table may leave less than nothing
            number = splat(parameters[index, num_inputs], LANES)
            if not weighed.is_constant:
                for column in range(num_inputs):
                    if parameters[index, column] != 0.0:
                        number += load(inputs, column * LANES, LANES) * parameters[index, column]
                number = select(strength != 0.0, number, 0.0)  # it may be infinite at infinite inputs
            strength *= scale
            total += strength
            moment += strength * number
        fires = total != 0.0
        output = moment
        if weighed.defuzzifier != codes.WEIGHTED_SUM:
            output = moment / select(fires, total, 1.0)
        store(answers, 0, select(fires, output, weighed.default))
        for lane in range(num_lanes):
            out[first + lane] = answers[lane]
