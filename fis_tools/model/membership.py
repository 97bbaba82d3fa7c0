"""Membership functions sampled on a variable's universe: the numbers every engine works with.

The shapes follow scikit-fuzzy's generators (`gaussmf`, `trimf`, `gbellmf` and so on) to the last bit, but for
one thing: values below `SMALLEST_MEMBERSHIP` are zero, because differences of denormal numbers lose all
their digits.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import (
    Gaussian,
    GeneralizedBell,
    MembershipFunction,
    PiShape,
    Sampled,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SShape,
    Term,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    Variable,
    ZShape,
)

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


def shape_values(universe: Floats, shape: MembershipFunction) -> Floats:  # noqa: PLR0911 - one a shape
    """Evaluate a membership function's formula as it stands; `sample` is what inference uses.

    Parameters
    ----------
    universe : array
        Where, shape (num_points,).
    shape : MembershipFunction
        Its parameters fit together (see `fis_tools.model.validate`).
    """
    with np.errstate(all="ignore"):
        match shape:
            case Gaussian(mean, standard_deviation):
                return gaussian(universe, np.array([mean]), np.array([standard_deviation]))
            case Triangular(left, peak, right):
                return _triangle(universe, left, peak, right)
            case Trapezoidal():
                return _trapezoid(universe, shape)
            case TwoSidedGaussian():
                return _two_sided_gaussian(universe, shape)
            case GeneralizedBell(width, slope, centre):
                bell: Floats = 1.0 / (1.0 + np.abs((universe - centre) / width) ** (2 * slope))
                return bell
            case Sigmoid(inflection, slope):
                return _sigmoid(universe, inflection, slope)
            case SigmoidDifference(first, first_slope, second, second_slope):
                return _sigmoid(universe, first, first_slope) - _sigmoid(universe, second, second_slope)
            case SigmoidProduct(first, first_slope, second, second_slope):
                return _sigmoid(universe, first, first_slope) * _sigmoid(universe, second, second_slope)
            case SShape(foot, top):
                return np.where(universe <= top, _rising(universe, foot, top, is_open=False), 1.0)
            case ZShape(top, foot):
                return np.where(universe >= top, _falling(universe, top, foot), 1.0)
            case PiShape(left, left_top, right_top, right):
                values = _rising(universe, left, left_top, is_open=True)
                values = np.where(universe <= left_top, values, 1.0)
                return np.where(universe >= right_top, _falling(universe, right_top, right), values)
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


def _trapezoid(universe: Floats, shape: Trapezoidal) -> Floats:
    values = np.ones(len(universe))
    rising, falling = universe <= shape.left_top, universe >= shape.right_top
    values[rising] = _triangle(universe[rising], shape.left, shape.left_top, shape.left_top)
    values[falling] = _triangle(universe[falling], shape.right_top, shape.right_top, shape.right)
    values[(universe < shape.left) | (universe > shape.right)] = 0.0
    return values


def _two_sided_gaussian(universe: Floats, shape: TwoSidedGaussian) -> Floats:
    values = np.ones(len(universe))
    for beyond, mean, standard_deviation in (
        (universe <= shape.left_mean, shape.left_mean, shape.left_standard_deviation),
        (universe > shape.right_mean, shape.right_mean, shape.right_standard_deviation),
    ):
        values[beyond] = gaussian(universe[beyond], np.array([mean]), np.array([standard_deviation]))
    return values


def _sigmoid(universe: Floats, inflection: float, slope: float) -> Floats:
    values: Floats = 1.0 / (1.0 + np.exp(-slope * (universe - inflection)))
    return values


def _rising(universe: Floats, foot: float, top: float, *, is_open: bool) -> Floats:
    """Two parabolas from zero up to one, for points up to `top`.

    In the middle the upper one counts, or the lower one if `is_open`: scikit-fuzzy's `smf` and `pimf` differ
    in this, and the two parabolas in the last bit there.
    """
    middle = (foot + top) / 2.0
    lower = 2.0 * ((universe - foot) / (top - foot)) ** 2.0
    upper = 1.0 - 2.0 * ((universe - top) / (top - foot)) ** 2.0
    values = np.where(universe > middle if is_open else universe >= middle, upper, lower)
    return np.where(universe <= foot, 0.0, values)


def _falling(universe: Floats, top: float, foot: float) -> Floats:
    """Two parabolas from one down to zero, for points from `top` on."""
    upper = 1.0 - 2.0 * ((universe - top) / (foot - top)) ** 2.0
    lower = 2.0 * ((universe - foot) / (foot - top)) ** 2.0
    return np.where(universe >= foot, 0.0, np.where(universe < (top + foot) / 2.0, upper, lower))
