"""Systems and wired ones over boxes of inputs: as numbers, evaluated and bounded."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines import interpreter, interval
from fis_tools.engines.program import Program
from fis_tools.engines.trees import tree_values
from fis_tools.model import FuzzySystem, Inferable

#: An input is not split where the memberships in its terms vary less than this, summed over the terms.
SMALLEST_VARIATION = 1e-9


@dataclass(frozen=True)
class TreeProgram:
    """A tree as numbers: its systems' programs, and what `FuzzyTree` says of columns."""

    num_inputs: int
    programs: tuple[Program, ...]
    columns: tuple[tuple[int, ...], ...]
    output_columns: tuple[int, ...]


def pack(system: Inferable) -> Program | TreeProgram:
    """Return the arrays that `bound` and `evaluate` read; raises as `interval.pack` does."""
    if isinstance(system, FuzzySystem):
        return interval.pack(system)
    programs = tuple(map(interval.pack, system.systems))
    return TreeProgram(len(system.inputs), programs, system.columns, system.output_columns)


def evaluate(program: Program | TreeProgram, inputs: Floats) -> Floats:
    """Return the outputs, (n, num_outputs), for many samples."""
    if isinstance(program, Program):
        return interpreter.evaluate(program, inputs)
    parts = tuple(_evaluated(part) for part in program.programs)
    return tree_values(program.columns, parts, inputs, {})[:, program.output_columns]


def _evaluated(program: Program) -> Callable[[Floats], Floats]:
    return lambda rows: interpreter.evaluate(program, np.ascontiguousarray(rows))


def bound(program: Program | TreeProgram, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """Bound the outputs over many boxes; see `fis_tools.engines.interval.bound`.

    Of a tree the bounds of each system are the boxes of the next. They hold; but they forget that two values
    come from the same inputs, so that a large box is bounded loosely. Smaller boxes are bounded better.
    """
    if isinstance(program, Program):
        return interval.bound(program, low, high)
    least, greatest, varied = [*low.T], [*high.T], []
    for part_columns, part in zip(program.columns, program.programs, strict=True):
        ends = [np.stack([side[column] for column in part_columns], axis=1) for side in (least, greatest)]
        is_silent = np.isnan(ends[0]).any(axis=1)
        lows, highs = (np.where(is_silent[:, np.newaxis], 0.0, end) for end in ends)
        bounds = interval.bound(part, lows, highs)
        for side, limits in zip((least, greatest), bounds[:2], strict=True):
            side += [np.where(is_silent, np.nan, column) for column in limits.T]
        varied.append(bounds[2])
    columns = list(program.output_columns)
    variation = _traced(program, varied)
    return np.stack(least, axis=1)[:, columns], np.stack(greatest, axis=1)[:, columns], variation


def _traced(program: TreeProgram, varied: list[Floats]) -> Floats:
    """Return how much each input varies what is computed, (n, num_inputs), through all wires.

    The variation that an output brings to another system is shared out among what varies that output. Where
    rules fire too faintly to vary, splitting would not narrow it.
    """
    varied = [np.where(part > SMALLEST_VARIATION, part, 0.0) for part in varied]
    counts = [len(part.conclusions) for part in program.programs]
    firsts = program.num_inputs + np.cumsum([0, *counts])
    total = np.zeros((len(varied[0]), program.num_inputs))
    weights = [np.ones(len(total)) for _ in program.programs]
    for index in reversed(range(len(program.programs))):
        for number, column in enumerate(program.columns[index]):
            variation = weights[index] * varied[index][:, number]
            if column < program.num_inputs:
                total[:, column] += variation
                continue
            before = int(np.searchsorted(firsts, column, side="right")) - 1
            weights[before] = weights[before] + variation / np.maximum(varied[before].sum(axis=1), 1e-300)
    return total
