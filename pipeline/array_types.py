"""Names for types of arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

#: the elements of these arrays; NumPy's aliases do not tell them in the same way in all its versions
ELEMENTS: dict[Any, type[np.generic]] = {
    Floats: np.float64,
    Integers: np.int64,
    Booleans: np.bool_,
    Bytes: np.uint8,
}
