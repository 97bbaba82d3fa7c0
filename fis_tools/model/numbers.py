"""What a Takagi-Sugeno rule concludes in place of a fuzzy set: a number, the same always or linear in inputs.

Takagi and Sugeno, *Fuzzy identification of systems and its applications to modeling and control*, IEEE
Transactions on Systems, Man, and Cybernetics 15 (1985). An output of such terms is weighed, not defuzzified.
"""

from abc import abstractmethod
from dataclasses import dataclass

from fis_tools.model.shape import Floats, MembershipFunction, Place, shape


@dataclass(frozen=True, slots=True)
class Number(MembershipFunction):
    """A term of a weighed output that is a number; nothing belongs to it to any degree."""

    def at(self, x: Floats) -> Floats:
        """Refuse: asked of a number this is a slip in a program.

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
