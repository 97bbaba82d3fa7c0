"""Compiled feed-forward networks: the actions of a learned policy from its observations.

Every flight's sums are taken in the same order whatever flies with it, so that flights are reproducible.
"""

from math import tanh
from typing import NamedTuple

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats, Integers

#: activation of a layer: none, hyperbolic tangent, or clipping to `low` and `high`
LINEAR, TANH, CLIPPED = range(3)


class Network(NamedTuple):
    """Layers, one after the other."""

    widths: Integers  # (L+1,) inputs of each layer, and outputs of the last
    numbers: Floats  # (n,) for each layer the weights, a row per input, followed by the biases
    kinds: Integers  # (L,) `LINEAR`, `TANH` or `CLIPPED`
    low: Floats  # (L,) limits of the clipped layers
    high: Floats


@compiled(nogil=True, error_model="numpy")
def answer(network: Network, seen: Floats, work: Floats, found: Floats) -> None:
    """Write the network's outputs, (m, widths[-1]), for the observations of m flights, (m, widths[0]).

    `work`, (2, w) for the widest layer, may have any content.
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
