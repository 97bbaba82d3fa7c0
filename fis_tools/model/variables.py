"""Linguistic variables and their terms."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fis_tools.model.operators import Accumulation, Aggregation, Defuzzifier
from fis_tools.model.shape import MembershipFunction


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

    @cached_property
    def universe(self) -> NDArray[np.float64]:
        """The points on which membership functions are sampled, ascending, shape (num_points,)."""
        if self.points is not None:
            return np.array(self.points, dtype=np.float64)
        return np.linspace(self.minimum, self.maximum, self.num_points)

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
