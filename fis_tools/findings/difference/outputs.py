"""How far outputs changed: two systems evaluated over the same inputs."""

from dataclasses import replace

import numpy as np

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.difference.change import OutputChange
from fis_tools.model import FuzzySystem, Variable

#: Inputs spread over the ranges.
NUM_SPREAD = 4096


def compare_outputs(
    before: FuzzySystem, after: FuzzySystem, samples: Floats | None = None
) -> tuple[OutputChange, ...]:
    """Compare the common outputs of two systems, over the input ranges and over samples.

    Parameters
    ----------
    before, after : FuzzySystem
        Of inputs of the same names, in any order; without these nothing is compared.
    samples : (n, num_inputs), optional
        Inputs in the order of `after`.
    """
    names = [variable.name for variable in after.inputs]
    if sorted(names) != sorted(variable.name for variable in before.inputs):
        return ()
    spread = spread_inputs(over_both_ranges(before, after), NUM_SPREAD)
    columns = [names.index(variable.name) for variable in before.inputs]
    common = [output for output in after.outputs if output.name in {v.name for v in before.outputs}]
    changes = []
    for where, inputs in (("the ranges", spread), ("the flights", samples)):
        if inputs is not None and len(inputs):
            old = compiled(before)(np.ascontiguousarray(inputs[:, columns]))
            new = compiled(after)(inputs)
            for output in common:
                old_place = [variable.name for variable in before.outputs].index(output.name)
                pair = np.array((old[:, old_place], new[:, after.outputs.index(output)]))
                has_value = np.isfinite(pair).all(axis=0)  # a formula may have none
                rows, pair = inputs[has_value], pair[:, has_value]
                if len(rows):
                    changes.append(_change(before.outputs[old_place], output, where, names, rows, pair))
    return tuple(changes)


def over_both_ranges(before: FuzzySystem, after: FuzzySystem) -> FuzzySystem:
    """Return a system whose inputs have ranges as wide as in both; for their ranges only."""
    wider = []
    for variable in after.inputs:
        old = before.variable(variable.name)
        low, high = min(old.minimum, variable.minimum), max(old.maximum, variable.maximum)
        wider.append(replace(variable, minimum=low, maximum=high))
    return replace(after, inputs=tuple(wider))


def _change(
    before: Variable,
    output: Variable,
    where: str,
    names: list[str],
    inputs: Floats,
    values: Floats,
) -> OutputChange:
    sizes = np.abs(values[1] - values[0])
    worst = int(np.argmax(sizes))
    width = max(variable.maximum - variable.minimum for variable in (before, output))
    mean, largest = float(sizes.mean()), float(sizes[worst])
    return OutputChange(
        output=output,
        where=where,
        num_samples=len(inputs),
        mean=mean,
        largest=largest,
        mean_share=mean / width,
        largest_share=largest / width,
        inputs={name: float(value) for name, value in zip(names, inputs[worst], strict=True)},
        before=float(values[0][worst]),
        after=float(values[1][worst]),
    )
