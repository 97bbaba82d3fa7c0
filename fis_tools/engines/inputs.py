"""Inputs in whatever form they come, as rows or by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.errors import require_known
from fis_tools.model import Inferable

#: Clipped inputs, and the outputs inferred so far, by their names.
Values = Mapping[str, Any]


def columns_of(inputs: Any) -> tuple[str, ...] | None:
    """Return the column names of a mapping or a table; None for a plain array, which has positions only.

    Mappings, structured arrays, and objects with keys or columns like the tables and rows of pandas,
    polars and Arrow are recognised. A table's row without names for its numbers is a plain array.
    """
    labels = getattr(getattr(inputs, "dtype", None), "names", None)
    for attribute in ("column_names", "keys", "columns"):
        if labels is None:
            labels = getattr(inputs, attribute, None)
    if labels is None:
        return None
    names = tuple(labels() if callable(labels) else labels)
    if getattr(inputs, "ndim", 2) == 1 and not any(isinstance(name, str) for name in names):
        return None
    return names


def pick(system: Inferable, inputs: Any, names: tuple[str, ...]) -> list[Floats]:
    """Return each input of a system by its name, broadcast to one shape.

    A table may have other columns; a mapping is written for this call, so unknown names are
    errors.

    Raises
    ------
    ValueError
        If an input is missing, or a mapping names one that the system does not have.
    """
    wanted = [variable.name for variable in system.inputs]
    if isinstance(inputs, Mapping):
        require_known(names, wanted, f"system {system.name!r} has no input", ValueError)
    for name in wanted:
        if name not in names:
            kind = "column" if not isinstance(inputs, Mapping) else "input"
            raise ValueError(f"{kind} {name!r} is missing; pass {', '.join(wanted)}")
    return list(np.broadcast_arrays(*(np.asarray(inputs[name], dtype=np.float64) for name in wanted)))


def as_rows(system: Inferable, inputs: Any) -> Floats:
    """Return inputs as an array, the last axis in the order of the system's inputs.

    A plain array is returned unchanged; a mapping or table as (n, num_inputs), or (num_inputs,) for numbers.

    Raises
    ------
    ValueError
        As in `pick`.
    """
    names = columns_of(inputs)
    if names is None:
        return np.asarray(inputs, dtype=np.float64)
    return np.stack(pick(system, inputs, names), axis=-1)
