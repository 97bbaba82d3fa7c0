"""Rules: a statement about the inputs, and what it concludes on the outputs."""

from dataclasses import dataclass

from fis_tools.model.operators import AndOperator, OrOperator


@dataclass(frozen=True, slots=True)
class Is:
    """The statement ``variable is term``."""

    variable: str
    term: str


@dataclass(frozen=True, slots=True)
class Not:
    """The complement of a statement."""

    operand: "Expression"


@dataclass(frozen=True, slots=True)
class And:
    """The conjunction of statements, combined from left to right."""

    operands: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of statements, combined from left to right."""

    operands: tuple["Expression", ...]


Expression = Is | Not | And | Or


@dataclass(frozen=True, slots=True)
class Consequent:
    """What a rule concludes: ``variable is term``, its strength multiplied by `weight`."""

    variable: str
    term: str
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Rule:
    """If `antecedent` then all of `consequents`.

    A rule has operators of its own where it departs from its system.
    """

    antecedent: Expression
    consequents: tuple[Consequent, ...]
    label: str = ""
    and_operator: AndOperator | None = None
    or_operator: OrOperator | None = None

    @property
    def has_own_operators(self) -> bool:
        """Whether it says itself how its statements combine."""
        return self.and_operator is not None or self.or_operator is not None
