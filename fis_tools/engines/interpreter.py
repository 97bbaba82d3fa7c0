"""The compiled functions that run a `Program`: any fuzzy system, exactly, step by step.

`fis_tools.engines.inference` defines the computation; this is the same arithmetic in the same order for many
samples, with every operator, weight, universe, output and defuzzifier of the model.
`fis_tools.engines.kernel` is faster still and supports fewer systems.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import isfinite, isnan
from typing import NamedTuple

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import (
    ROW,
    Vector,
    aligned,
    borrowed,
    gather,
    gather_rows,
    least,
    load,
    most,
    padded,
    select,
    some,
    splat,
    store,
)
from fis_tools.engines import codes
from fis_tools.engines.defuzzifier import conclude_by_rule, conclude_by_term, weigh, weigh_rows
from fis_tools.engines.intervals import conclude_interval, weigh_interval
from fis_tools.engines.lanes import LANES, combine_lanes, write_degrees
from fis_tools.engines.program import Antecedents, Conclusion, IntervalOutput, Program, Summation, Weighing
from fis_tools.engines.sampled_lanes import Room, conclude_lanes, conclude_sampled, make_room

#: firing strengths per block between evaluating rules and outputs: so many stay in the processor's cache
BLOCK = 65_536
#: below these a sum of strengths, or of numbers times them, may have lost digits
FAINT, FAINTEST = 2.0**-100, 2.0**-900


def fire(program: Program, inputs: Floats) -> Floats:
    """Return the firing strengths, before weights, (n, num_rules), for inputs (n, num_inputs)."""
    firing = np.empty((len(inputs), program.num_rules))
    fire_rows(program.antecedents, inputs, make_work(program.antecedents), firing)
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
    columns, work = np.empty((len(program.conclusions), len(inputs))), make_work(program.antecedents)
    if (numbers := weighed_numbers(program)) is not None:
        average_rows(program.antecedents, numbers, inputs, work, columns[0])
        return columns.T
    if program.only_summation is not None:
        room = make_room(program.only_summation, program.num_rules)
        sum_rows(program.antecedents, program.only_summation, inputs, work, room, columns[0])
        return columns.T
    size = max(LANES, min(BLOCK // program.num_rules, len(inputs)))
    firing = np.empty((size, program.num_rules))
    for first in range(0, len(inputs), size):
        rows = inputs[first : first + size]
        fire_rows(program.antecedents, rows, work, firing[: len(rows)])
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
    work = make_work(program.antecedents)
    if (numbers := weighed_numbers(program)) is not None:
        return _direct(partial(average_rows, program.antecedents, numbers, row, work, outputs))
    if program.only_summation is not None:
        room = make_room(program.only_summation, program.num_rules)
        return _direct(
            partial(sum_rows, program.antecedents, program.only_summation, row, work, room, outputs)
        )
    firing, columns = np.empty((1, program.num_rules)), outputs[:, np.newaxis]
    fire = partial(fire_rows, program.antecedents, row, work, firing)
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
            num_rules = firing.shape[1]
            room = make_room(summation, num_rules)
            degrees = aligned(num_rules * LANES)
            yield partial(conclude_sampled, summation, firing, degrees, np.arange(num_rules), room, out)
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


class LaneWork(NamedTuple):
    """What `LANES` samples are inferred in.

    Attributes
    ----------
    slots : (num_slots * LANES,)
        Memberships and results of steps, by the slots of a program.
    inputs : (num_inputs * LANES,)
        The clipped inputs.
    columns : (most columns, LANES)
        Memberships of one input and their slopes.
    """

    slots: Floats
    inputs: Floats
    columns: Floats


def make_work(antecedents: Antecedents) -> LaneWork:
    """Return what `fire_lanes` works in."""
    terms = antecedents.inputs[:, 0]
    return LaneWork(
        aligned((int(terms.sum()) + len(antecedents.steps)) * LANES),
        aligned(len(terms) * LANES),
        aligned((padded(2 * int(terms.max()), ROW), LANES)),
    )


@compiled(error_model="numpy", forceinline=True)
def fuzzify(antecedents: Antecedents, index: int, work: LaneWork, slot: int) -> None:
    """Write the memberships of `LANES` values of one input in its terms, linear between points.

    The values are clipped to the universe where they are; memberships begin at a slot.
    """
    slots, inputs, columns = work.slots, work.inputs, work.columns
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
    for column in range(0, 2 * terms, ROW):
        gather_rows(memberships, row + column, ahead, min(ROW, 2 * terms - column), columns[column:])
    for term in range(terms):
        membership, slope = load(columns, term, LANES), load(columns, terms + term, LANES)
        store(slots, slot + term * LANES, slope * distance + membership)


@compiled(error_model="numpy", forceinline=True)
def fire_lanes(antecedents: Antecedents, values: Floats, first: int, work: LaneWork) -> int:
    """Write the clipped inputs and all degrees of up to `LANES` samples; return how many they are."""
    slots, inputs = work.slots, work.inputs
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
            fuzzify(antecedents, antecedent, work, slot * LANES)
        slot += layout[antecedent, 0]
    for index in range(len(steps)):
        operator, a, b = steps[index, 0], steps[index, 1] * LANES, steps[index, 2] * LANES
        combine_lanes(operator, slots, a, b, (slot + index) * LANES)
    return num_lanes


@compiled(error_model="numpy", nogil=True)
def fire_rows(antecedents: Antecedents, values: Floats, work: LaneWork, out: Floats) -> None:
    """Write the firing strengths of antecedents for values (n, num_inputs)."""
    program, work = borrowed((antecedents, work))
    rule_slots = program.rule_slots
    for first in range(0, len(values), LANES):
        num_lanes = fire_lanes(program, values, first, work)
        for lane in range(num_lanes):
            for rule in range(len(rule_slots)):
                out[first + lane, rule] = work.slots[rule_slots[rule] * LANES + lane]


@compiled(error_model="numpy", nogil=True)
def sum_rows(
    antecedents: Antecedents, summation: Summation, values: Floats, work: LaneWork, room: Room, out: Floats
) -> None:
    """Write the one output, (n,), for values (n, num_inputs): a sum over points, by strengths not stored."""
    program, summed, work, room = borrowed((antecedents, summation, work, room))
    for first in range(0, len(values), LANES):
        fire_lanes(program, values, first, work)
        conclude_lanes(summed, work.slots, program.rule_slots, room, out[first : first + LANES])


@compiled(error_model="numpy", nogil=True)
def average_rows(
    antecedents: Antecedents, weighing: Weighing, values: Floats, work: LaneWork, out: Floats
) -> None:
    """Write the one output, (n,), for values (n, num_inputs): numbers, weighted by strengths not stored."""
    program, weighed, work = borrowed((antecedents, weighing, work))
    answers = np.empty(LANES)
    for first in range(0, len(values), LANES):
        num_lanes = fire_lanes(program, values, first, work)
        total, moment = _weighed(program, weighed, work)
        keeps_digits = ((total >= FAINT) | (total == 0.0)) & ((abs(moment) >= FAINTEST) | (moment == 0.0))
        if some(~keeps_digits):  # NaN included
            total, moment = _weighed_with_care(program, weighed, work)
        fires = total != 0.0
        output = moment
        if weighed.defuzzifier != codes.WEIGHTED_SUM:
            output = moment / select(fires, total, 1.0)
        store(answers, 0, select(fires, output, weighed.default))
        for lane in range(num_lanes):
            out[first + lane] = answers[lane]


@compiled(error_model="numpy", forceinline=True)
def _weighed(program: Antecedents, weighing: Weighing, work: LaneWork) -> tuple[Vector, Vector]:
    """Return the sum of the strengths, and that of the numbers times them.

    The second is NaN where an input is infinite, and where either is faint digits may be lost.
    """
    parameters, num_inputs = weighing.parameters, len(program.inputs)
    total, moment = splat(0.0, LANES), splat(0.0, LANES)
    for index in range(len(weighing.rules)):
        slot = program.rule_slots[weighing.rules[index]]
        strength = load(work.slots, slot * LANES, LANES) * weighing.weights[index]
        strength = select(strength < 0.0, 0.0, strength)  # a table may leave less than nothing
        number = splat(parameters[index, num_inputs], LANES)
        if not weighing.is_constant:
            for column in range(num_inputs):
                number += load(work.inputs, column * LANES, LANES) * parameters[index, column]
        total += strength
        moment += strength * number
    return total, moment


@compiled(error_model="numpy", forceinline=True)
def _weighed_with_care(program: Antecedents, weighing: Weighing, work: LaneWork) -> tuple[Vector, Vector]:
    """Return the same where strengths and numbers may be faint, and inputs infinite.

    An input that does not count may be infinite, and so may the number of a rule that does not fire.
    """
    parameters, num_inputs = weighing.parameters, len(program.inputs)
    scale = 1.0 if weighing.defuzzifier == codes.WEIGHTED_SUM else codes.RAISED_WEIGHT
    total, moment = splat(0.0, LANES), splat(0.0, LANES)
    for index in range(len(weighing.rules)):
        slot = program.rule_slots[weighing.rules[index]]
        strength = load(work.slots, slot * LANES, LANES) * weighing.weights[index]
        strength = select(strength < 0.0, 0.0, strength)
        number = splat(parameters[index, num_inputs], LANES)
        for column in range(num_inputs):
            if parameters[index, column] != 0.0:
                number += load(work.inputs, column * LANES, LANES) * parameters[index, column]
        number = select(strength != 0.0, number, 0.0)
        total += strength * scale
        moment += strength * scale * number
    return total, moment
