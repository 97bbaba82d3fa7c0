"""What an audit consists of: findings, their severity, and the thresholds beyond which something is one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any


class Severity(IntEnum):
    """How serious a finding is; higher is worse."""

    NOTE = 1
    WARNING = 2
    SERIOUS = 3

    @property
    def word(self) -> str:
        """The name in lower case."""
        return self.name.lower()

    def counted(self, count: int) -> str:
        """Say how many findings are as serious as this: ``1 serious``, ``2 warnings``."""
        return f"{count} {self.word}" + ("" if self is Severity.SERIOUS or count == 1 else "s")


@dataclass(frozen=True)
class Finding:
    """One thing that a reviewer should know.

    Parameters
    ----------
    id : str
        Which kind of finding it is; stable, for scripts.
    severity : Severity
    system : str
        The fuzzy system it is about.
    sentence : str
        What was found, with numbers and units.
    cure : str
        What to do about it.
    variable : str
        The variable it is about, if it is about one.
    terms : tuple of str
        The terms it is about.
    rules : tuple of int
        The numbers of the rules it is about, from 1 as in every listing.
    evidence : mapping
        The numbers behind the sentence, as plain JSON.
    """

    id: str
    severity: Severity
    system: str
    sentence: str
    cure: str
    variable: str = ""
    terms: tuple[str, ...] = ()
    rules: tuple[int, ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """The limits beyond which something is a finding.

    Parameters
    ----------
    fired : float
        The strength from which a rule counts as fired, and a value as covered at all.
    coverage : float
        The membership that each value should have in some term, and the strength that some rule should have.
    look_alike : float
        Two terms whose shared area exceeds this share of their joint area (Jaccard) mean the same.
    possibility : float
        Two terms whose intersection is higher than this are hard to tell apart.
    inside : float
        A term with more than this share of its area under another one adds little.
    zero : float
        The membership that 0 should have in a term called zero.
    jump : float
        The most that neighbouring rules should differ by, as a fraction of the output's range.
    against : float
        Up to this fraction of opposite steps, an input counts as intended to act in one direction.
    reversal : float
        The smallest reversal of the output that counts, as a fraction of its range.
    consistency : float
        The least consistency of a rule: agreement of the output with its consequent where it fires most.
    reach : float
        The least fraction of the output's range that should be reached.
    partition : float
        The least GM3M of a variable's terms, against the reference or an even partition.
    clipped : float
        The largest fraction of inferences in which an input may lie outside its universe.
    dead : float
        The largest fraction of rules that may never fire on flights.
    dominant : float
        The largest fraction of inferences that one rule may lead, or of the effect of all rules.
    idle : float
        A rule that moves the output by less than this on average, as a fraction of its range, hardly matters.
    rules, terms : int
        The most rules of a system and terms of a variable that a person can keep in mind.
    """

    fired: float = 0.05
    coverage: float = 0.2
    look_alike: float = 0.7
    possibility: float = 0.85
    inside: float = 0.9
    zero: float = 0.8
    jump: float = 0.55
    against: float = 0.25
    reversal: float = 0.1
    consistency: float = 0.3
    reach: float = 0.5
    partition: float = 0.3
    clipped: float = 0.05
    dead: float = 0.5
    dominant: float = 0.6
    idle: float = 0.001
    rules: int = 60
    terms: int = 9
