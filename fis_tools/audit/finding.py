"""What an audit is made of: findings, how serious they are, and from where on something is one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.formats.text import number
from fis_tools.model import FuzzySystem, Variable

Floats = NDArray[np.float64]


#: Less than this part of a range is a rounding error.
NEGLIGIBLE = 1e-9


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


def amount(variable: Variable, value: float) -> str:
    """Write a value of a variable for people, four digits and the unit; what is lost in rounding is 0."""
    value = 0.0 if abs(value) < NEGLIGIBLE * span(variable) else value
    return f"{number(float(f'{value:.4g}'))} {variable.unit}".rstrip()


def percent(fraction: float) -> str:
    """Write a fraction for people, so that little is told from nothing and nearly all from all."""
    for digits in (0, 1, 2):
        words = f"{100 * fraction:.{digits}f}"
        if (float(words) > 0 or fraction == 0) and (float(words) < 100 or fraction == 1):
            return f"{words} %"
    return "under 0.01 %" if fraction < 0.5 else "over 99.99 %"


def place(system: FuzzySystem, point: Floats) -> str:
    """Write an input of a system for people: ``distance = 80 m, velocity = 0.1 m/s``."""
    values = zip(system.inputs, point, strict=True)
    return ", ".join(f"{variable.name} = {amount(variable, value)}" for variable, value in values)


def listed(words: list[str], most: int = 3) -> str:
    """Join words for people, only the first few of many."""
    shown = words[:most]
    if len(words) > most:
        return f"{', '.join(shown)} and {len(words) - most} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def span(variable: Variable) -> float:
    """Return the width of a variable's universe."""
    return variable.maximum - variable.minimum
