"""Quadrature for shares that are integrals over the probability with which each rule joins."""

import numpy as np

from fis_tools.array_types import Floats


def quadrature(num_players: int) -> tuple[Floats, Floats]:
    """Return the chances and weights that integrate the shares of so many players, or fewer, exactly."""
    nodes, weights = np.polynomial.legendre.leggauss((num_players + 1) // 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights
