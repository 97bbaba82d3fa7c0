"""Membership functions sampled on a variable's universe, as used by every engine.

Values below `fis_tools.model.shapes.SMALLEST_MEMBERSHIP` are set to zero, because differences of denormal
numbers lose all their digits.
"""

import numpy as np

from fis_tools.model.shape import MembershipFunction
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP
from fis_tools.model.variables import Term, Variable
from fis_tools.typing import Floats


def sample(variable: Variable, term: Term) -> Floats:
    """Sample a term's membership function on the universe of its variable.

    Parameters
    ----------
    variable : Variable
        Its universe is sampled.
    term : Term
        The term to sample.

    Returns
    -------
    array
        Memberships in [0, 1], shape (num_points,).
    """
    values = shape_values(variable.universe, term.membership)
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


def shape_values(universe: Floats, shape: MembershipFunction) -> Floats:
    """Evaluate a membership function's formula, keeping tiny values; inference uses `sample`.

    Parameters
    ----------
    universe : array
        Shape (num_points,).
    shape : MembershipFunction
        With valid parameters (see `fis_tools.model.validate`).
    """
    with np.errstate(all="ignore"):
        return shape.at(universe)


def is_unimodal(values: Floats) -> bool:
    """Return whether values first rise, then fall; flat stretches count as either.

    Parameters
    ----------
    values : array
        Shape (num_points,).
    """
    steps = np.sign(np.diff(values))
    steps = steps[steps != 0]
    return bool(np.all(np.diff(steps) <= 0))
