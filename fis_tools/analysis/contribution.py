"""The contribution of each rule: the output minus the output without that rule."""

from collections import defaultdict

import numpy as np

from fis_tools.array_types import Booleans, Floats
from fis_tools.engines import interpreter
from fis_tools.engines.codes import FORMULA, INVERTED, NUMBER
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.engines.defuzzifier import formula_values
from fis_tools.engines.inference import infer_outputs
from fis_tools.engines.program import IntervalOutput, Program, Weighing
from fis_tools.model import Formula, FuzzySystem, Linear
from fis_tools.model.intervals import has_intervals

#: Samples, each with one rule silenced, that are concluded at a time.
BATCH = 4096
#: An output this close to its default, as a share of its range, differs by rounding alone.
NOTHING = 1e-9


def contributions(compiled: CompiledSystem, inputs: Floats) -> Floats:
    """Compute each rule's contribution to each output, by leaving out one rule at a time.

    A rule contributes nothing where it does not fire, or where another one that concludes the same fires as
    strongly. Contributions need not add up to the output: what two rules do together is lost with either.

    Parameters
    ----------
    compiled : CompiledSystem
        Made by `fis_tools.engines.compiler.compile`.
    inputs : (n, num_inputs)
        One row per sample.

    Returns
    -------
    (n, num_rules, num_outputs)
        In units of the outputs. Where no other rule fires it is the output less its default; NaN if there is
        none.
    """
    firing = compiled.firing_strengths(inputs)
    outputs = compiled.conclude(firing, inputs)
    count = len(compiled.system.rules)
    samples, rules = np.nonzero(_can_matter(compiled, firing))
    result = np.zeros((len(firing), count, outputs.shape[1]))
    for first in range(0, len(samples), BATCH):
        sample, rule = samples[first : first + BATCH], rules[first : first + BATCH]
        silenced = firing[sample]
        # in interval type-2 systems a rule has two strengths
        silenced.reshape(len(sample), -1, count)[np.arange(len(sample)), :, rule] = 0.0
        result[sample, rule] = outputs[sample] - compiled.conclude(silenced, inputs[sample])
    return result


def _can_matter(compiled: CompiledSystem, firing: Floats) -> Booleans:
    """Return which firing rules affect an output: of a maximum the highest cut, else every cut."""
    firing = firing[:, -len(compiled.system.rules) :]
    matters = np.zeros(firing.shape, dtype=np.bool_)
    for conclusion, output in zip(compiled.program.conclusions, compiled.system.outputs, strict=True):
        if isinstance(conclusion, IntervalOutput):
            matters[:, [rule for rule, _ in compiled.system.conclusions_on(output)]] = True
        elif isinstance(conclusion, Weighing) or not conclusion.cuts:
            matters[:, conclusion.rules] = True
        else:
            cuts = firing[:, conclusion.rules] * conclusion.weights
            for first, last in zip(conclusion.bounds[:-1], conclusion.bounds[1:], strict=True):
                rules, heights = conclusion.rules[first:last], cuts[:, first:last]
                is_highest = heights == heights.max(axis=1, keepdims=True)
                counts = is_highest if output.accumulation == "max" else heights > 0.0
                # a rule may conclude a term several times, with different weights
                for column, rule in enumerate(rules):
                    matters[:, rule] |= counts[:, column]
    return matters & (firing > 0.0)


def holding_back(system: FuzzySystem, output: int = 0) -> tuple[int, ...]:
    """Return the numbers, from 1, of rules that conclude only what the output is when no rule fires.

    Whatever their share, such rules ask for nothing: they hold back what others ask for. `output` is the
    place of one of the system's outputs.
    """
    variable = system.outputs[output]
    fixed = {
        term.name
        for term in variable.terms
        if not isinstance(term.membership, Formula)
        and not (isinstance(term.membership, Linear) and any(term.membership.coefficients))
    }
    concluded: dict[int, set[str]] = defaultdict(set)
    for index, consequent in system.conclusions_on(variable):
        if consequent.weight > 0.0:
            concluded[index].add(consequent.term)
    middle = np.array([(v.minimum + v.maximum) / 2.0 for v in system.inputs])
    # a few rules once: numba would take longer to compile this than Python to infer
    units = np.eye(len(system.rules))
    if has_intervals(system):
        rows = np.tile(middle, (len(units), 1))
        alone = compile(system).conclude(np.tile(units, 2), rows)[:, output].tolist()
    else:
        alone = [infer_outputs(system, unit, middle)[output].value for unit in units]
    away = np.abs(np.array(alone) - (variable.default or 0.0)) / variable.span
    return tuple(index + 1 for index, terms in concluded.items() if terms <= fixed and away[index] < NOTHING)


def importance(compiled: CompiledSystem, inputs: Floats) -> Floats:
    """Compute the importance of each rule over some samples.

    Parameters
    ----------
    compiled : CompiledSystem
        Made by `fis_tools.engines.compiler.compile`.
    inputs : (n, num_inputs)
        One row per sample, at least one.

    Returns
    -------
    (num_rules, num_outputs)
        The mean size of the contributions, as a share of the output's range. Samples without an output are
        left out.

    Raises
    ------
    ValueError
        If there are no samples.
    """
    moved = np.abs(contributions(compiled, inputs))
    if len(moved) == 0:
        raise ValueError("there are no samples; pass at least one row of inputs")
    counts = np.count_nonzero(~np.isnan(moved), axis=0)
    ranges = np.array([variable.span for variable in compiled.system.outputs])
    return np.nansum(moved, axis=0) / np.maximum(counts, 1) / ranges


def concluded_numbers(
    program: Program, weighing: Weighing, firing: Floats, strengths: Floats, inputs: Floats
) -> Floats:
    """Return the number that each rule concludes, (n, c)."""
    low, high = program.limits.T
    clipped = np.clip(inputs, low, high)
    num_inputs = clipped.shape[1]
    numbers = np.empty(strengths.shape)
    outputs = interpreter.conclude(program, firing, inputs).T if weighing.formulas else np.empty((0, 0))
    formulas = formula_values(weighing, inputs, program.limits, outputs)
    for column, kind in enumerate(weighing.kinds):
        row = weighing.parameters[column]
        if kind == NUMBER:
            counts = np.flatnonzero(row[:num_inputs])  # an input that does not count may be infinite
            numbers[:, column] = clipped[:, counts] @ row[counts] + row[num_inputs]
            continue
        if kind == FORMULA:
            numbers[:, column] = formulas[:, int(row[0])]
            continue
        shape = INVERTED[kind](*row[:2])
        degrees = np.clip(strengths[:, column], np.finfo(np.float64).smallest_subnormal, 1.0)
        points = shape.inverse(degrees)
        ends = np.where(points > 0.0, weighing.high, weighing.low)
        numbers[:, column] = np.where(np.isinf(points), ends, points)
    return numbers
