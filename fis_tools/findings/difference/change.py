"""What can change from one fuzzy system to another, as data."""

from dataclasses import dataclass

from fis_tools.model import FuzzySystem, Rule, Term, Variable


@dataclass(frozen=True)
class Fact:
    """Something with a value that changed.

    Parameters
    ----------
    what : str
        As ``and operator``.
    before, after : str
        Its values, in words.
    """

    what: str
    before: str
    after: str


@dataclass(frozen=True)
class TermChange:
    """A term that was added, removed, renamed, or means something else.

    Parameters
    ----------
    before, after : Term or None
        None where there was, or is, none.
    moved : float
        How far the middle of its highest points has gone, in units of the variable; 0 for a term that was
        added or removed.
    share : float
        The same as a part of the universe's width, the wider one of the two.
    similarity : float
        Jaccard: the area under the lower of the two functions over that under the higher.
    """

    before: Term | None
    after: Term | None
    moved: float = 0.0
    share: float = 0.0
    similarity: float = 0.0

    @property
    def is_renamed(self) -> bool:
        """Whether it has another name than before."""
        return self.before is not None and self.after is not None and self.before.name != self.after.name


@dataclass(frozen=True)
class VariableChange:
    """A variable that was added or removed, or in which something changed.

    Parameters
    ----------
    kind : str
        ``input`` or ``output``.
    before, after : Variable or None
        None where there was, or is, none.
    facts : tuple of Fact
        Its unit, universe, default and the like.
    terms : tuple of TermChange
        Those that changed, in the order in which they now stand.
    """

    kind: str
    before: Variable | None
    after: Variable | None
    facts: tuple[Fact, ...] = ()
    terms: tuple[TermChange, ...] = ()

    @property
    def variable(self) -> Variable:
        """The variable as it is now, or as it was if it was removed."""
        variable = self.after or self.before
        assert variable is not None  # noqa: S101 - one of them stands
        return variable


@dataclass(frozen=True)
class RuleChange:
    """A rule that was added or removed, or concludes something else.

    Parameters
    ----------
    before, after : Rule or None
        None where there was, or is, none.
    number : int
        Its place among the rules, from 1: now, or before if it is no more.
    """

    before: Rule | None
    after: Rule | None
    number: int


@dataclass(frozen=True)
class OutputChange:
    """How far an output moved, over some samples.

    Parameters
    ----------
    output : Variable
        As it is now.
    where : str
        Which samples: ``the ranges`` or ``the flights``.
    num_samples : int
        How many.
    mean, largest : float
        Size of the change, in the output's unit.
    mean_share, largest_share : float
        The same as a part of the output's range, the wider one of the two.
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
    """What changed between two systems of the same name.

    Parameters
    ----------
    before, after : FuzzySystem or None
        None where there was, or is, none.
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
        """What the system is called."""
        system = self.after or self.before
        assert system is not None  # noqa: S101 - one of them stands
        return system.name

    @property
    def is_empty(self) -> bool:
        """Whether nothing changed."""
        is_kept = self.before is not None and self.after is not None
        return is_kept and not (self.facts or self.variables or self.rules)
