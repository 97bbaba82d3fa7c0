"""Quadrature for shares that are integrals over the probability with which each rule joins."""

import numpy as np

from fis_tools.array_types import Floats


def quadrature(num_players: int) -> tuple[Floats, Floats]:
    """Return chances of joining and weights that integrate the shares of up to so many players exactly."""
    nodes, weights = np.polynomial.legendre.leggauss((num_players + 1) // 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights
