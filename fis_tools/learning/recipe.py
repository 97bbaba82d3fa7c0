"""What a learned system may look like."""

from dataclasses import dataclass
from typing import Literal, get_args

from fis_tools.learning.partition import WORDS
from fis_tools.model.validate import MOST_INPUTS

Consequents = Literal["sets", "constants", "linear"]


class Unlearnable(ValueError):  # noqa: N818 - the sentence is the message
    """What no system can be learned by, told in a sentence."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What a learned system may look like.

    Parameters
    ----------
    consequents : {"constants", "linear", "sets"}
        What rules conclude: a number each (Takagi-Sugeno of order zero), a number linear in the inputs (of
        order one), or a fuzzy set (Mamdani, by Wang and Mendel).
    terms : int
        Of each input, 2 to 7.
    output_terms : int
        Of an output of sets, 2 to 7.
    max_inputs : int
        Columns that rules may ask for: those that lower the expected error most, one after the other.
    tune : bool
        Whether the terms' peaks are moved to lower it further.
    """

    consequents: Consequents = "constants"
    terms: int = 3
    output_terms: int = 5
    max_inputs: int = 3
    tune: bool = True

    def __post_init__(self) -> None:
        """Refuse what cannot be learned."""
        if self.consequents not in get_args(Consequents):
            known = ", ".join(get_args(Consequents))
            raise Unlearnable(f"consequents is {self.consequents!r}; use one of {known}")
        for name, least, most in (
            ("terms", min(WORDS), max(WORDS)),
            ("output_terms", min(WORDS), max(WORDS)),
            ("max_inputs", 1, MOST_INPUTS),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not least <= value <= most or value != int(value):
                raise Unlearnable(f"{name} is {value!r}; give a whole number from {least} to {most}")
