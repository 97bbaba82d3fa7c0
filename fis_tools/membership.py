"""Membership functions sampled on a variable's universe: the numbers every engine works with.

The shapes follow scikit-fuzzy's `gaussmf`, `trimf` and `trapmf` to the last bit, but for one thing: values
below `SMALLEST_MEMBERSHIP` are zero, because differences of denormal numbers lose all their digits.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import Gaussian, MembershipFunction, Sampled, Term, Trapezoidal, Triangular, Variable

Floats = NDArray[np.float64]

#: Sampled memberships below this are taken as zero.
SMALLEST_MEMBERSHIP = 1e-290


def sample(variable: Variable, term: Term) -> Floats:
    """Sample a term's membership function on the universe of its variable.

    Parameters
    ----------
    variable : Variable
        Where to sample.
    term : Term
        What to sample.

    Returns
    -------
    array
        Memberships in [0, 1], shape (num_points,).
    """
    values = _sample_shape(variable.universe, term.membership)
    values[values < SMALLEST_MEMBERSHIP] = 0.0
    return values


def sample_terms(variable: Variable) -> Floats:
    """Sample all terms of a variable.

    Parameters
    ----------
    variable : Variable
        A variable with at least one term.

    Returns
    -------
    array
        Memberships in [0, 1], shape (num_terms, num_points).
    """
    return np.stack([sample(variable, term) for term in variable.terms])


def gaussian(x: Floats, mean: Floats, standard_deviation: Floats) -> Floats:
    """Evaluate Gaussian membership functions, zero below `SMALLEST_MEMBERSHIP`.

    One population of systems and one system alone go through this same expression, so that a genome flies
    in training exactly as its controller file does later.

    Parameters
    ----------
    x, mean, standard_deviation : arrays
        Of shapes that broadcast.
    """
    with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
        values: Floats = np.exp(-((x - mean) ** 2.0) / (2 * standard_deviation**2.0))
    values[values < SMALLEST_MEMBERSHIP] = 0.0
    return values


def is_unimodal(values: Floats) -> bool:
    """Tell whether values only rise, then only fall; flat stretches count as either.

    Parameters
    ----------
    values : array
        Shape (num_points,).
    """
    steps = np.sign(np.diff(values))
    steps = steps[steps != 0]
    return bool(np.all(np.diff(steps) <= 0))


def _sample_shape(universe: Floats, shape: MembershipFunction) -> Floats:
    match shape:
        case Gaussian(mean, standard_deviation):
            return gaussian(universe, np.array([mean]), np.array([standard_deviation]))
        case Triangular(left, peak, right):
            return _triangle(universe, left, peak, right)
        case Trapezoidal(left, left_top, right_top, right):
            values = np.ones(len(universe))
            rising, falling = universe <= left_top, universe >= right_top
            values[rising] = _triangle(universe[rising], left, left_top, left_top)
            values[falling] = _triangle(universe[falling], right_top, right_top, right)
            values[(universe < left) | (universe > right)] = 0.0
            return values
        case Sampled(samples):
            return np.array(samples, dtype=np.float64)


def _triangle(universe: Floats, left: float, peak: float, right: float) -> Floats:
    values = np.zeros(len(universe))
    if left != peak:
        rising = (left < universe) & (universe < peak)
        values[rising] = (universe[rising] - left) / (peak - left)
    if peak != right:
        falling = (peak < universe) & (universe < right)
        values[falling] = (right - universe[falling]) / (right - peak)
    values[universe == peak] = 1.0
    return values
