"""Variables and their terms, and the terms sampled on a universe, as every engine uses them.

Values below `fis_tools.model.shapes.SMALLEST_MEMBERSHIP` are set to zero, because differences of denormal
numbers lose all their digits.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.numbers import Number
from fis_tools.model.operators import Accumulation, Aggregation, Defuzzifier
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP, Sampled
from plain_files.plain_text import plain


@dataclass(frozen=True, slots=True)
class Term:
    """A linguistic value and its membership function."""

    name: str
    membership: MembershipFunction


@dataclass(frozen=True)
class Variable:
    """A linguistic variable over a universe of discourse.

    Parameters
    ----------
    name : str
        The variable's name in rules.
    unit : str
        The unit of its values; empty if dimensionless.
    minimum, maximum : float
        The ends of the universe, in `unit`.
    terms : tuple of Term
        From the lowest to the highest.
    num_points : int
        Points of the universe, evenly spaced from `minimum` to `maximum`.
    points : tuple of float, optional
        The universe itself, if it is not evenly spaced; `num_points` is then its length.
    default : float, optional
        For an output: the value when no rule fires.
    description : str
        The variable's meaning, in a sentence.
    defuzzifier : str, optional
        For an output: how it becomes a number; None for the system's method.
    accumulation : str
        For an output: how the strengths of several rules that conclude the same term combine into the height
        of its cut, one rule after the other.
    aggregation : str
        For an output: how the rules' conclusions combine into one membership function. Under the maximum each
        term is cut once; under any other, each rule's conclusion counts separately.
    is_clipped : bool
        For an input of a system whose program clips none: whether it is clipped to its range all the same.
    """

    name: str
    unit: str
    minimum: float
    maximum: float
    terms: tuple[Term, ...]
    num_points: int = 101
    points: tuple[float, ...] | None = None
    default: float | None = None
    description: str = ""
    defuzzifier: Defuzzifier | None = None
    accumulation: Accumulation = "max"
    aggregation: Aggregation = "max"
    is_clipped: bool = False

    def __post_init__(self) -> None:
        """Clean the free text."""
        object.__setattr__(self, "unit", plain(self.unit))
        object.__setattr__(self, "description", plain(self.description))

    @cached_property
    def universe(self) -> Floats:
        """The points on which membership functions are sampled, ascending, shape (num_points,)."""
        if self.points is not None:
            return np.array(self.points, dtype=np.float64)
        return np.linspace(self.minimum, self.maximum, self.num_points)

    @property
    def span(self) -> float:
        """The width of the universe."""
        return self.maximum - self.minimum

    @property
    def has_sets(self) -> bool:
        """Whether its terms are fuzzy sets rather than numbers."""
        return not any(isinstance(term.membership, Number) for term in self.terms)

    @cached_property
    def memberships(self) -> Floats:
        """All terms, at least one, sampled on the universe, (num_terms, num_points); to be read only."""
        sampled = np.stack([sample(self, term) for term in self.terms])
        sampled.flags.writeable = False
        return sampled

    @property
    def counts_strongest(self) -> bool:
        """Whether only the strongest of the rules that conclude a term counts."""
        return self.accumulation == "max" and self.aggregation == "max"

    def term_index(self, name: str) -> int:
        """Return the position of the term called `name`.

        Raises
        ------
        KeyError
            If there is none.
        """
        for index, term in enumerate(self.terms):
            if term.name == name:
                return index
        known = ", ".join(term.name for term in self.terms)
        raise KeyError(f"variable {self.name!r} has no term {name!r}; its terms are {known}")


def with_universe(variable: Variable, universe: Floats) -> Variable:
    """Return a variable over points from its minimum to its maximum, listed unless they are evenly spaced.

    Parameters
    ----------
    variable : Variable
    universe : array
        Ascending, shape (num_points,).
    """
    even = np.linspace(variable.minimum, variable.maximum, len(universe))
    points = None if np.array_equal(even, universe) else tuple(universe.tolist())
    return replace(variable, num_points=len(universe), points=points)


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


def memberships_at(variable: Variable, term: Term, points: Floats) -> Floats:
    """Return a term's memberships at any points, also outside of the range, by its formula."""
    if isinstance(term.membership, Sampled):
        values = np.interp(points, variable.universe, term.membership.values)
    else:
        values = shape_values(points, term.membership)
    values[values < SMALLEST_MEMBERSHIP] = 0.0
    return values


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


def peak(variable: Variable, term: Term) -> float:
    """Return the middle of where a term's sampled membership is highest; rounding errors become 0."""
    values = sample(variable, term)
    centre = float(np.mean(variable.universe[values >= values.max() - 1e-9]))
    return 0.0 if abs(centre) < 1e-9 * variable.span else centre
