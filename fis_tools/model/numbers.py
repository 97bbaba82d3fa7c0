"""Conclusions of Takagi-Sugeno rules: a number instead of a fuzzy set, constant or linear in the inputs.

Takagi and Sugeno, *Fuzzy identification of systems and its applications to modeling and control*, IEEE
Transactions on Systems, Man, and Cybernetics 15 (1985). Outputs with such terms are weighted averages or
sums.
"""

from abc import abstractmethod
from dataclasses import dataclass

from fis_tools.model.shape import MembershipFunction, Place, shape
from fis_tools.typing import Floats


@dataclass(frozen=True, slots=True)
class Number(MembershipFunction):
    """A term that is a number, of a weighted output; it has no degrees of membership."""

    def at(self, x: Floats) -> Floats:
        """Raise TypeError: a number has no membership function.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError(f"{type(self).__name__} is a number, and no membership function")

    @abstractmethod
    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""


@shape("constant", "{value}", fll=("Constant",), fis=("constant",))
@dataclass(frozen=True, slots=True)
class Constant(Number):
    """The number `value`, in the unit of the output."""

    value: Place

    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""
        return (*(0.0,) * num_inputs, self.value)


@shape("linear", "{coefficients} times the inputs plus {constant}", fll=("Linear",), fis=("linear",))
@dataclass(frozen=True, slots=True)
class Linear(Number):
    """The inputs, clipped to their universes, times `coefficients`, in their order, plus `constant`."""

    coefficients: tuple[float, ...]
    constant: Place

    def row(self, num_inputs: int) -> tuple[float, ...]:
        """Return the factor of each input, then the constant."""
        return (*self.coefficients, self.constant)
