"""Wired systems as functions of whole arrays, step by step, and bounded; see `fis_tools.model.trees`.

Where no rule fires and there is no default, a value is no number, and neither is what depends on it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines import interpreter, interval
from fis_tools.engines.inference import Inference, OutputInference, infer
from fis_tools.engines.inputs import as_rows, columns_of, pick
from fis_tools.engines.program import Program
from fis_tools.model import FuzzySystem, FuzzyTree, Inferable

#: An input is not split where the memberships in its terms vary less than this, summed over the terms.
SMALLEST_VARIATION = 1e-9


@dataclass(frozen=True, repr=False)
class CompiledTree:
    """A tree that evaluates whole arrays; made by `fis_tools.engines.compiler.compile`.

    Parameters
    ----------
    system : FuzzyTree
        The compiled tree.
    parts : tuple of callable
        Its systems as functions from rows of inputs to rows of outputs.
    """

    system: FuzzyTree
    parts: tuple[Callable[[Floats], Floats], ...]

    def __call__(self, inputs: Any) -> Any:
        """Return the outputs for many samples, in the form of the inputs.

        Parameters
        ----------
        inputs : (n, num_inputs) array, or mapping or table of names to arrays or numbers
            As a compiled system takes them.

        Raises
        ------
        ValueError
            If the shape is wrong, an input is missing or unknown, or a value is NaN.
        """
        names = columns_of(inputs)
        if names is None:
            return self.values(inputs)[:, self.system.output_columns]
        columns = pick(self.system, inputs, names)
        rows = self.values(np.stack([column.ravel() for column in columns], axis=1))
        ends = zip(self.system.outputs, self.system.output_columns, strict=True)
        return {variable.name: rows[:, column].reshape(columns[0].shape) for variable, column in ends}

    def values(self, inputs: Any, fixed_values: Mapping[int, Floats] | None = None) -> Floats:
        """Return all values, (n, num_values): the inputs, then the outputs of each system.

        Parameters
        ----------
        inputs : (n, num_inputs)
        fixed_values : mapping of int to (n,), optional
            Values that are given instead of computed, by their index.
        """
        rows = as_rows(self.system, inputs)
        if rows.ndim != 2 or rows.shape[1] != len(self.system.inputs):
            wanted = ", ".join(variable.name for variable in self.system.inputs)
            raise ValueError(f"inputs have shape {rows.shape}; pass (n, {len(self.system.inputs)}): {wanted}")
        if np.isnan(rows).any():
            raise ValueError("an input is NaN; pass numbers")
        return _values(self.system.columns, self.parts, rows, fixed_values or {})

    def __repr__(self) -> str:
        names = [", ".join(v.name for v in side) for side in (self.system.inputs, self.system.outputs)]
        return f"<compiled {self.system.name!r}: {len(self.parts)} systems, {' -> '.join(names)}>"


def _values(
    columns: tuple[tuple[int, ...], ...],
    parts: tuple[Callable[[Floats], Floats], ...],
    inputs: Floats,
    fixed_values: Mapping[int, Floats],
) -> Floats:
    """Compute the parts of a tree one after the other; see `values`."""
    values = [*inputs.T]
    for part_columns, part in zip(columns, parts, strict=True):
        rows = np.stack([values[column] for column in part_columns], axis=1)
        is_known = ~np.isnan(rows).any(axis=1)
        outputs = part(rows[is_known])
        for computed in outputs.T:
            column = np.full(len(inputs), np.nan)
            column[is_known] = computed
            values.append(fixed_values.get(len(values), column))
    return np.stack(values, axis=1)


@dataclass(frozen=True)
class TreeInference:
    """All steps of one inference of a tree.

    Parameters
    ----------
    system : FuzzyTree
    inputs : (num_inputs,)
        As given.
    parts : tuple of Inference
        In the order of its systems.
    outputs : tuple of OutputInference
        In the order of its outputs.
    """

    system: FuzzyTree
    inputs: Floats
    parts: tuple[Inference, ...]
    outputs: tuple[OutputInference, ...]


def infer_tree(tree: FuzzyTree, inputs: Any) -> TreeInference:
    """Evaluate a tree for one sample, keeping every step; parameters and errors as of `infer`."""
    given = as_rows(tree, inputs)
    if given.shape != (len(tree.inputs),):
        raise ValueError(
            f"inputs have shape {given.shape}; {tree.name!r} has {len(tree.inputs)} inputs, pass one number "
            "for each"
        )
    values, parts = given.tolist(), []
    steps: list[OutputInference | None] = [None] * len(values)
    for system, columns in zip(tree.systems, tree.columns, strict=True):
        for column in columns:
            if np.isnan(values[column]):
                raise ValueError(
                    f"{tree.source(column)} is no number there, and {system.name} needs it; give it a default"
                )
        parts.append(infer(system, np.array([values[column] for column in columns])))
        values += [output.value for output in parts[-1].outputs]
        steps += parts[-1].outputs
    outputs = tuple(step for column in tree.output_columns if (step := steps[column]) is not None)
    return TreeInference(tree, given, tuple(parts), outputs)


def infer_whole(system: Inferable, inputs: Any) -> Inference | TreeInference:
    """Evaluate a system or a tree for one sample."""
    return infer_tree(system, inputs) if isinstance(system, FuzzyTree) else infer(system, inputs)


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
    return _values(program.columns, parts, inputs, {})[:, program.output_columns]


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
