"""Networks of layers, compiled: what a learned policy answers to what it sees.

Every flight's numbers are added up in the same order in any company, so that a flight repeats itself.
"""

from math import tanh
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: what becomes of the sums of a layer: nothing, their hyperbolic tangent, nothing below `low` or above `high`
LINEAR, TANH, CLIPPED = range(3)


class Network(NamedTuple):
    """Layers, one after the other.

    Attributes
    ----------
    widths : (L+1,) int
        Numbers that go into each layer, and that come out of the last.
    numbers : (n,)
        Of each layer the weights, a row for each number that goes in, and then what is added.
    kinds : (L,) int
        `LINEAR`, `TANH` or `CLIPPED`.
    low, high : (L,)
        Limits of those that are clipped.
    """

    widths: Integers
    numbers: Floats
    kinds: Integers
    low: Floats
    high: Floats


@compiled(nogil=True, error_model="numpy")
def answer(network: Network, seen: Floats, work: Floats, found: Floats) -> None:
    """Write the answers to what some flights see.

    Parameters
    ----------
    network : Network
    seen : (m, widths[0])
    work : (2, w) for the widest layer, any content
    found : (m, widths[-1]), filled
    """
    widths, numbers = network.widths, network.numbers
    for row in range(len(seen)):
        now, after, first = 0, 1, 0
        for place in range(widths[0]):
            work[now, place] = seen[row, place]
        for layer in range(len(network.kinds)):
            num_in, num_out = widths[layer], widths[layer + 1]
            added = first + num_in * num_out
            for j in range(num_out):
                work[after, j] = numbers[added + j]
            for i in range(num_in):
                value, weights = work[now, i], first + i * num_out
                for j in range(num_out):
                    work[after, j] += numbers[weights + j] * value
            if network.kinds[layer] == TANH:
                for j in range(num_out):
                    work[after, j] = tanh(work[after, j])
            if network.kinds[layer] == CLIPPED:
                for j in range(num_out):
                    work[after, j] = min(max(work[after, j], network.low[layer]), network.high[layer])
            now, after, first = after, now, added + num_out
        for place in range(widths[-1]):
            found[row, place] = work[now, place]
