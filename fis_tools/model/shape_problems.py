"""Problems of membership functions: of their parameters, of their values, and of sets between two of them."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fis_tools.model.membership import SHAPES, MembershipFunction
from fis_tools.model.numbers import Linear, Number
from fis_tools.model.shapes import Between, Polyline, Sampled
from fis_tools.model.variables import Term, Variable, shape_values

#: Kinds of numbers that must be positive; see `fis_tools.model.shapes`.
POSITIVE = frozenset({"width", "deviation", "exponent"})
#: Rounding tolerance of memberships outside [0, 1].
ROUNDING = 1e-12


def shape_problems(shape: MembershipFunction, num_points: int) -> Iterator[str]:
    """Yield the problems of a membership function's parameters, for a universe of `num_points`."""
    if type(shape) not in SHAPES.values():
        known = ", ".join(kind.__name__ for kind in SHAPES.values())
        yield f"{type(shape).__name__} is not a known shape; choose one of {known}"
    elif isinstance(shape, Sampled):
        yield from _value_problems(shape, num_points)
    elif isinstance(shape, Between):
        for bound in (shape.lower, shape.upper):
            if isinstance(bound, Between | Sampled | Number):
                yield f"the bound {type(bound).__name__} of an interval type-2 set is no shape; take another"
            else:
                yield from shape_problems(bound, num_points)
    elif isinstance(shape, Polyline):
        yield from _polyline_problems(shape)
    else:
        yield from parameter_problems(shape)
        if isinstance(shape, Linear) and not all(map(is_finite, shape.coefficients)):
            yield f"the coefficients {shape.coefficients} must be finite numbers"


def parameter_problems(shape: MembershipFunction) -> Iterator[str]:
    """Yield the parameters that the registry's entry of a shape does not allow."""
    entry = shape.entry
    parameters = {name: getattr(shape, name) for name in entry.kinds}
    if not all(map(is_finite, parameters.values())):
        yield f"{_listed(parameters)} must be finite numbers"
        return
    for name, kind in entry.kinds.items():
        words, value = name.replace("_", " "), parameters[name]
        if kind in POSITIVE and not value > 0:
            yield f"{words} {value} is not positive; give a number above 0"
        elif kind == "deviation" and not 0 < 2 * value * value < math.inf:
            yield f"the square of {words} {value} under- or overflows; change it"
    ordered = {name: parameters[name] for name in entry.ascending}
    if list(ordered.values()) != sorted(ordered.values()):
        yield f"{_listed(ordered)} do not ascend; put them in order"
    elif any(parameters[left] == parameters[right] for left, right in entry.flanks):
        yield f"{_listed(ordered)} leave a flank no width; make it wider, or use a trapezoidal shape"


def is_finite(value: object) -> bool:
    """Return whether a value is a finite number, and no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return bool(-math.inf < value < math.inf)


def _listed(parameters: dict[str, float]) -> str:
    values = tuple(parameters.values())
    return f"{', '.join(parameters)} = {values if len(values) > 1 else values[0]}"


def _value_problems(shape: Sampled, num_points: int) -> Iterator[str]:
    """Yield the problems of listed memberships."""
    if len(shape.values) != num_points:
        yield (
            f"{len(shape.values)} membership values are given for a universe of {num_points} points; give "
            "one for each point"
        )
    if not all(is_finite(value) and 0.0 <= value <= 1.0 for value in shape.values):
        yield "a membership value lies outside [0, 1] or is not a number; scale the values to [0, 1]"


def _polyline_problems(shape: Polyline) -> Iterator[str]:
    """Yield the problems of a polyline."""
    if not shape.x or len(shape.x) != len(shape.y):
        yield f"a polyline has {len(shape.x)} x and {len(shape.y)} y; give one y for each x"
    elif not all(map(is_finite, shape.x)) or any(left > right for left, right in pairwise(shape.x)):
        yield "the x of a polyline do not ascend or are no numbers; put them in order"
    elif not all(is_finite(value) and 0.0 <= value <= 1.0 for value in shape.y):
        yield "a y of a polyline lies outside [0, 1] or is not a number; scale them to [0, 1]"


def _between_problems(variable: Variable, term: Term, shape: Between) -> Iterator[str]:
    """Yield the problems of an interval type-2 set."""
    for bound in (shape.lower, shape.upper):
        yield from sample_problems(variable, replace(term, membership=bound))
    lower, upper = (shape_values(variable.universe, bound) for bound in (shape.lower, shape.upper))
    if np.any(lower > upper + ROUNDING):
        x = variable.universe[int(np.argmax(lower - upper))]
        yield f"the lower membership is above the upper one at {x:g}; exchange or change them"


def sample_problems(variable: Variable, term: Term) -> Iterator[str]:
    """Yield the problems of a term's memberships at the points of its universe."""
    if isinstance(term.membership, Between):
        yield from _between_problems(variable, term, term.membership)
        return
    values = shape_values(variable.universe, term.membership)
    if not np.all(np.isfinite(values)):
        yield "a sampled membership is not a number; the parameters are too extreme, so change them"
    elif values.min() < -ROUNDING:
        yield f"the membership falls to {values.min():.3g}, below 0; make the first sigmoid the higher one"
