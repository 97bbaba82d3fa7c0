"""What an audit is made of: findings, how serious they are, and from where on something is one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any


class Severity(IntEnum):
    """How much a finding weighs; higher is worse."""

    NOTE = 1
    WARNING = 2
    SERIOUS = 3

    @property
    def word(self) -> str:
        """Its name as people write it."""
        return self.name.lower()


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
    """From where on something is a finding.

    Parameters
    ----------
    fired : float
        A rule counts as fired, and a value as covered at all, from this strength on.
    coverage : float
        Each value of a variable should belong to a term this much, and each input to a rule.
    look_alike : float
        Two terms whose areas are shared by more than this (Jaccard) mean the same.
    possibility : float
        Two terms that hold together by more than this are hard to tell apart.
    inside : float
        A term of which more than this lies under another one says little of its own.
    zero : float
        How much 0 should belong to a term called zero.
    jump : float
        The most that neighbouring rules should differ by, as a fraction of the output's range.
    against : float
        Up to this fraction of steps against the rest, an input counts as meant to act one way.
    reversal : float
        The least way back of the output that counts, as a fraction of its range.
    meaning : float
        The least that an answer should be like the consequent of a rule that holds in full.
    reach : float
        The least part of the output's range that should be reached.
    partition : float
        The least GM3M, of a variable's terms against an even partition.
    clipped : float
        The most inferences in which an input should lie outside its universe, as a fraction.
    dead : float
        The most rules that should never fire on flights, as a fraction.
    dominant : float
        The most that one rule should lead, or matter, as a fraction of all.
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
    meaning: float = 0.3
    reach: float = 0.5
    partition: float = 0.3
    clipped: float = 0.05
    dead: float = 0.5
    dominant: float = 0.6
    idle: float = 0.001
    rules: int = 60
    terms: int = 9
