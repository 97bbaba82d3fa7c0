"""Wired systems as functions of whole arrays; see `fis_tools.model.trees`.

Where no rule fires and there is no default, a value is no number, and neither is what depends on it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines.inputs import as_rows, columns_of, pick
from fis_tools.model import FuzzyTree


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
        return tree_values(self.system.columns, self.parts, rows, fixed_values or {})

    def __repr__(self) -> str:
        names = [", ".join(v.name for v in side) for side in (self.system.inputs, self.system.outputs)]
        return f"<compiled {self.system.name!r}: {len(self.parts)} systems, {' -> '.join(names)}>"


def tree_values(
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
