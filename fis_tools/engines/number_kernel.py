"""Systems with one weighted output, compiled from inputs to output in one pass.

It takes the steps of `fis_tools.engines.interpreter` and `fis_tools.engines.weigher` in the same order, some
samples side by side, and stores no strengths.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed, gather, least, load, most, select, some, splat, store
from fis_tools.engines.interpreter import LANES, combine, fuzzify_one
from fis_tools.engines.program import MIN, NUMBER, PRODUCT, WEIGHTED_SUM, Program, Weighing

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def covers(program: Program) -> bool:
    """Return whether this kernel supports a program."""
    (first, *others) = program.conclusions
    return not others and isinstance(first, Weighing) and bool((first.kinds == NUMBER).all())


def arguments(program: Program) -> tuple[Any, ...]:
    """Return the arguments of `infer_rows` for a supported program."""
    (weighing,) = program.conclusions
    assert isinstance(weighing, Weighing)  # noqa: S101 - see `covers`
    return (
        *program.antecedents,
        program.ends,
        weighing.rules,
        weighing.weights,
        weighing.parameters,
        weighing.is_constant,
        weighing.defuzzifier,
        weighing.default,
    )


def evaluate(program: Program, inputs: Floats) -> Floats:
    """Return the outputs, (n, 1), for inputs (n, num_inputs) of a supported program."""
    out = np.empty(len(inputs))
    infer_rows(*(*arguments(program), inputs, out))
    return out[:, np.newaxis]


@compiled(error_model="numpy", forceinline=True)
def fuzzify_all(
    layout: Integers,
    universes: Floats,
    memberships: Floats,
    values: Floats,
    at: int,
    slots: Floats,
    slot: int,
) -> None:
    """Do the same as `fuzzify_one` for values from an index on, side by side; write rows from a slot on."""
    terms, points, start, row = layout[0], layout[1], layout[2], layout[3]
    low, high = universes[start], universes[start + points - 1]
    x = least(most(load(values, at, LANES), low), high)
    left = least(np.floor((x - low) * ((points - 1) / (high - low))), points - 1.0)
    here = gather(universes, start, left)
    beyond = gather(universes, start, least(left + 1.0, points - 1.0))
    if some((x < here) | ((x >= beyond) & (left < points - 1.0))):  # the points are not evenly spaced
        for lane in range(LANES):
            fuzzify_one(layout, universes, memberships, values[at + lane], slots[slot + lane :: LANES])
        return
    distance, ahead = x - here, left * (2.0 * terms)
    for term in range(terms):
        slope = gather(memberships, row + terms + term, ahead)
        store(slots, slot + term * LANES, slope * distance + gather(memberships, row + term, ahead))


@compiled(error_model="numpy", nogil=True)
def infer_rows(  # noqa: PLR0912 - written out for speed
    layout: Integers,
    universes: Floats,
    memberships: Floats,
    steps: Integers,
    rule_slots: Integers,
    ends: Floats,
    rules: Integers,
    weights: Floats,
    parameters: Floats,
    is_constant: bool,
    defuzzifier: int,
    default: float,
    values: Floats,
    out: Floats,
) -> None:
    """Write the outputs, (n,), for values (n, num_inputs)."""
    layout, universes, memberships, steps = borrowed((layout, universes, memberships, steps))
    rule_slots, rules, weights, parameters = borrowed((rule_slots, rules, weights, parameters))
    num_inputs, num_terms = len(layout), layout[:, 0].sum()
    room, values_room = np.zeros((num_terms + len(steps)) * LANES), np.zeros(num_inputs * LANES)
    slots, clipped = borrowed((room, values_room))
    answers = np.empty(LANES)
    for first in range(0, len(values), LANES):
        num_lanes = min(LANES, len(values) - first)
        slot = 0
        for place in range(num_inputs):
            for lane in range(num_lanes):
                clipped[place * LANES + lane] = values[first + lane, place]
            fuzzify_all(layout[place], universes, memberships, clipped, place * LANES, slots, slot * LANES)
            if not is_constant:
                x = load(clipped, place * LANES, LANES)
                store(clipped, place * LANES, least(most(x, ends[place, 0]), ends[place, 1]))
            slot += layout[place, 0]
        for index in range(len(steps)):
            operator, a, b = steps[index, 0], steps[index, 1] * LANES, steps[index, 2] * LANES
            result = (num_terms + index) * LANES
            if operator == MIN:
                store(slots, result, least(load(slots, a, LANES), load(slots, b, LANES)))
            elif operator == PRODUCT:
                store(slots, result, load(slots, a, LANES) * load(slots, b, LANES))
            else:
                for lane in range(LANES):
                    slots[result + lane] = combine(operator, slots[a + lane], slots[b + lane])
        total, moment = splat(0.0, LANES), splat(0.0, LANES)
        for index in range(len(rules)):
            strength = load(slots, rule_slots[rules[index]] * LANES, LANES) * weights[index]
            number = splat(parameters[index, num_inputs], LANES)
            if not is_constant:
                for place in range(num_inputs):
                    number += load(clipped, place * LANES, LANES) * parameters[index, place]
            total += strength
            moment += strength * number
        fires = total != 0.0
        output = moment
        if defuzzifier != WEIGHTED_SUM:
            output = moment / select(fires, total, 1.0)
        store(answers, 0, select(fires, output, default))
        for lane in range(num_lanes):
            out[first + lane] = answers[lane]
