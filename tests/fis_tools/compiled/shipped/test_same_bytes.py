"""The same source gives the same shipped bytes, wherever it was compiled and after whatever."""

import lzma

import numpy as np
import pytest

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.shipped import load
from tests.fis_tools.compiled.shipped.made import TELLING, object_for


@compiled
def fill(x, out):
    """Copy a number to a table of its own, whose shape numba checks."""
    if x[0] < 0.0:
        raise ValueError("negative")
    out[0] = np.full((2, len(x)), x[0]).reshape(-1)[1]


@pytest.mark.skipif(not load.family(), reason="no code is shipped for this processor")
def test_the_same_source_gives_the_same_bytes_whatever_was_compiled_before():
    """numba numbers what it compiles, and what it raises names the file that it was compiled from."""
    first, again = (object_for(load.family(), fill, (np.ones(3), np.zeros(1)))[0] for _ in range(2))
    assert first == again
    assert not TELLING.search(first)


def test_nothing_shipped_tells_where_it_was_built():
    """Not even where numba was: each exception of numba's would name its file."""
    shipped = {path: lzma.decompress(path.read_bytes()) for path in load.CODE.rglob("*.xz")}
    assert len(shipped) > len(load.FAMILIES)
    assert [path.name for path, content in shipped.items() if TELLING.search(content)] == []
