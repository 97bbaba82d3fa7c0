"""Membership functions, the registry of their shapes, and what an entry of the registry holds."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar, Literal, TypeVar, dataclass_transform, get_args

from fis_tools.array_types import Floats

#: A file format of other programs that names shapes.
Format = Literal["fis", "fll", "fcl"]
# The kinds of numbers that a shape has.
#: A location parameter, in the unit of the variable.
Location = Annotated[float, "location"]
#: A positive length, in the unit of the variable.
Width = Annotated[float, "width"]
#: A positive length whose square the formula divides by.
Deviation = Annotated[float, "deviation"]
#: A steepness of either sign, one over the unit of the variable.
Slope = Annotated[float, "slope"]
#: A positive steepness without a unit.
Exponent = Annotated[float, "exponent"]


@dataclass(frozen=True)
class Entry:
    """The description of a shape, apart from its formula.

    Parameters
    ----------
    name : str
        Its name in our own files.
    phrase : str
        The shape in words, with its numbers in braces.
    kinds : mapping of str to str
        Its numbers by name, and their kinds: ``"location"``, ``"width"`` and so on.
    ascending : tuple of str
        Numbers that must not decrease from one to the next.
    flanks : tuple of (str, str)
        Pairs of these of which the second must be greater than the first.
    corners : tuple of str
        Numbers that are its corners, where the slope changes abruptly.
    words : mapping of str to tuple of str
        For each format that has the shape, its name there, then its numbers in the format's order, if
        that differs.
    """

    name: str
    phrase: str
    kinds: Mapping[str, str]
    ascending: tuple[str, ...]
    flanks: tuple[tuple[str, str], ...]
    corners: tuple[str, ...]
    words: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class MembershipFunction(ABC):
    """The degree, from 0 to 1, to which a value belongs to a term."""

    entry: ClassVar[Entry]

    @abstractmethod
    def at(self, x: Floats) -> Floats:
        """Evaluate the formula at points of shape (n,); see `fis_tools.model.variables.sample`."""

    @property
    def corners(self) -> tuple[float, ...]:
        """Its corners, ascending, jumps twice: points that the universe needs for an exact result."""
        return tuple(sorted(getattr(self, name) for name in self.entry.corners))


@dataclass(frozen=True, slots=True)
class MonotoneFunction(MembershipFunction):
    """A membership function that only rises or only falls, as in the consequent of a Tsukamoto rule."""

    @abstractmethod
    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees, each above zero; they may be outside the range."""


#: Every shape, by its name in our own files.
SHAPES: dict[str, type[MembershipFunction]] = {}
_Shape = TypeVar("_Shape", bound=MembershipFunction)


@dataclass_transform(frozen_default=True)
def shape(
    name: str,
    phrase: str,
    *,
    ascending: tuple[str, ...] = (),
    flanks: tuple[tuple[str, str], ...] = (),
    corners: tuple[str, ...] = (),
    **words: tuple[str, ...],
) -> Callable[[type[_Shape]], type[_Shape]]:
    """Make a class a dataclass, and add it to the registry; see `Entry` for the parameters.

    A format that lacks a shape gets it as a table of points.
    """

    def enter(kind: type[_Shape]) -> type[_Shape]:
        kind = dataclass(frozen=True, slots=True)(kind)
        marks = {each.name: get_args(each.type)[1:] for each in fields(kind)}
        kinds = {key: mark[0] for key, mark in marks.items() if mark and isinstance(mark[0], str)}
        kind.entry = Entry(name, phrase, kinds, ascending, flanks, corners, words)
        SHAPES[name] = kind
        return kind

    return enter


def words_of(file_format: Format) -> dict[str, tuple[type[MembershipFunction], tuple[str, ...]]]:
    """Return a format's names of shapes, each with its shape and the order of the shape's numbers."""
    by_word: dict[str, tuple[type[MembershipFunction], tuple[str, ...]]] = {}
    for kind in SHAPES.values():
        if file_format in kind.entry.words:
            word, *order = kind.entry.words[file_format]
            by_word[word] = kind, tuple(order or kind.entry.kinds)
    return by_word
