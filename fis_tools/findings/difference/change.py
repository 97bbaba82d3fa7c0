"""The changes between two fuzzy systems, as data."""

from dataclasses import dataclass
from typing import NamedTuple

from fis_tools.model import FuzzySystem, Rule, Term, Variable


class Source(NamedTuple):
    """One of the two controllers that are compared.

    Attributes
    ----------
    name, file, sha256 : str
        Its name, where it was read from (empty if from no file), and its fingerprint, as of what is signed.
    """

    name: str
    file: str
    sha256: str


@dataclass(frozen=True)
class Fact:
    """A property whose value changed.

    Parameters
    ----------
    what : str
        Such as ``and operator``.
    before, after : str
        Its values, in words.
    """

    what: str
    before: str
    after: str


@dataclass(frozen=True)
class TermChange:
    """A term that was added, removed, renamed, or redefined.

    Parameters
    ----------
    before, after : Term or None
        None if it did not exist, or no longer exists.
    moved : float
        How far the middle of its highest points moved, in units of the variable; 0 for a term that was
        added or removed.
    share : float
        The same as a fraction of the width of the wider universe.
    similarity : float
        Jaccard: the area under the lower of the two functions over that under the higher.
    """

    before: Term | None
    after: Term | None
    moved: float = 0.0
    share: float = 0.0
    similarity: float = 0.0


@dataclass(frozen=True)
class VariableChange:
    """A variable that was added or removed, or in which something changed.

    Parameters
    ----------
    kind : str
        ``input`` or ``output``.
    before, after : Variable or None
        None if it did not exist, or no longer exists.
    facts : tuple of Fact
        Its unit, universe, default and the like.
    terms : tuple of TermChange
        Those that changed, in their present order.
    """

    kind: str
    before: Variable | None
    after: Variable | None
    facts: tuple[Fact, ...] = ()
    terms: tuple[TermChange, ...] = ()

    @property
    def variable(self) -> Variable:
        """The present variable, or the former one if it was removed."""
        variable = self.after or self.before
        assert variable is not None  # noqa: S101 - one of them stands
        return variable


@dataclass(frozen=True)
class RuleChange:
    """A rule that was added or removed, or concludes something else.

    Parameters
    ----------
    before, after : Rule or None
        None if it did not exist, or no longer exists.
    number : int
        Its number, from 1: the present one, or the former one of a removed rule.
    """

    before: Rule | None
    after: Rule | None
    number: int


@dataclass(frozen=True)
class OutputChange:
    """How far an output changed, over some samples.

    Parameters
    ----------
    output : Variable
        Its present form.
    where : str
        Which samples: ``the ranges`` or ``the flights``.
    num_samples : int
        How many.
    mean, largest : float
        Size of the change, in the output's unit.
    mean_share, largest_share : float
        The same as a fraction of the wider range of the output.
    inputs : dict
        Where it is largest, by the inputs' names.
    before, after : float
        The outputs there.
    """

    output: Variable
    where: str
    num_samples: int
    mean: float
    largest: float
    mean_share: float
    largest_share: float
    inputs: dict[str, float]
    before: float
    after: float


@dataclass(frozen=True)
class SystemDifference:
    """The differences between two systems of the same name.

    Parameters
    ----------
    before, after : FuzzySystem or None
        None if it did not exist, or no longer exists.
    facts : tuple of Fact
        Operators, defuzzifier, and the order of the inputs.
    variables : tuple of VariableChange
        Those that changed.
    rules : tuple of RuleChange
        Those that changed.
    outputs : tuple of OutputChange
        Of each output that both have, over each kind of samples; empty where the inputs are not the same.
    """

    before: FuzzySystem | None
    after: FuzzySystem | None
    facts: tuple[Fact, ...] = ()
    variables: tuple[VariableChange, ...] = ()
    rules: tuple[RuleChange, ...] = ()
    outputs: tuple[OutputChange, ...] = ()

    @property
    def name(self) -> str:
        """The name of the system."""
        system = self.after or self.before
        assert system is not None  # noqa: S101 - one of them stands
        return system.name

    @property
    def is_empty(self) -> bool:
        """Whether nothing changed."""
        is_kept = self.before is not None and self.after is not None
        return is_kept and not (self.facts or self.variables or self.rules)
