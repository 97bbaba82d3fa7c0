"""Arrow tables for data frames; each field carries its unit."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa

#: key of the unit in a field's metadata
UNIT: Final = "unit"


def table(
    columns: Mapping[str, NDArray[np.generic]], units: Mapping[str, str], description: Mapping[str, str]
) -> "pa.Table":
    """Build an Arrow table.

    Parameters
    ----------
    columns : mapping of str to array
        Arrays of equal length; further axes become lists of fixed size.
    units : mapping of str to str
        Of the columns that have one; stored in the field's metadata as ``unit``.
    description : mapping of str to str
        Metadata of the table.
    """
    # pyarrow takes a tenth of a second to import; only tables need it
    import pyarrow as pa  # noqa: PLC0415

    arrays = {name: _array(values) for name, values in columns.items()}
    fields = []
    for name, array in arrays.items():
        unit = units.get(name, "")
        fields.append(pa.field(name, array.type, metadata={UNIT: unit} if unit else None))
    return pa.table(list(arrays.values()), schema=pa.schema(fields, metadata=dict(description)))


def _array(values: NDArray[np.generic]) -> "pa.Array":
    import pyarrow as pa  # noqa: PLC0415

    flat = values.ravel()
    array = pa.array(flat.tolist(), pa.string()) if values.dtype.kind == "U" else pa.array(flat)
    for size in reversed(values.shape[1:]):
        array = _lists(array, size, values.size, len(values))
    return array


def _lists(array: "pa.Array", size: int, num_values: int, num_rows: int) -> "pa.Array":
    import pyarrow as pa  # noqa: PLC0415

    if num_values == 0:
        return pa.array([[]] * num_rows, pa.list_(array.type, size))
    return pa.FixedSizeListArray.from_arrays(array, size)
