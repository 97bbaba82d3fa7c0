"""An audit: findings with their severity, the thresholds behind them, and its report."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from fis_tools.analysis.measures import Measures
from fis_tools.model import Semantics
from fis_tools.words.text import inferred_as, two_decimals
from plain_files.document import Block, Document, Heading, Items, Paragraph, Result, Table, plain


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
        """Count findings of this severity: ``1 serious``, ``2 warnings``."""
        return f"{count} {self.word}" + ("" if self is Severity.SERIOUS or count == 1 else "s")


@dataclass(frozen=True)
class Finding:
    """A finding: what a reviewer should know, how serious it is, and where it is seen.

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
    system: str = field(default="", kw_only=True)
    sentence: str
    cure: str
    variable: str = ""
    terms: tuple[str, ...] = ()
    rules: tuple[int, ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)


#: Findings of one kind, as they are found.
Findings = Iterator[Finding]


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
    asymmetry : float
        The largest fraction of pairs of rules that may break a symmetry the others have; one always may.
    consistency : float
        The least consistency of a rule: agreement of the output with its consequent where it fires most.
    reach : float
        The least fraction of the output's range that should be reached.
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
    asymmetry: float = 0.1
    consistency: float = 0.3
    reach: float = 0.5
    clipped: float = 0.05
    dead: float = 0.5
    dominant: float = 0.6
    idle: float = 0.001
    rules: int = 60
    terms: int = 9


SCHEMA = "fuzzy-audit"
SCHEMA_VERSION = 2


@dataclass(frozen=True)
class AuditedSystem:
    """The measures of one system.

    Parameters
    ----------
    name : str
    measures : Measures
    num_samples : int or None
        Inferences on the flights that were read; None without flights.
    semantics : str
        The program whose inference it means.
    """

    name: str
    measures: Measures
    num_samples: int | None
    semantics: Semantics = "scikit-fuzzy"


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """The findings of an audit.

    Parameters
    ----------
    controller : str
        Its name; empty where a single system was audited.
    systems : tuple of AuditedSystem
    findings : tuple of Finding
        The most serious first.
    """

    controller: str
    systems: tuple[AuditedSystem, ...]
    findings: tuple[Finding, ...]

    def at_least(self, severity: Severity) -> tuple[Finding, ...]:
        """Return the findings of a severity or above."""
        return tuple(finding for finding in self.findings if finding.severity >= severity)

    def summary(self) -> str:
        """Return how many findings there are of each severity, in one line."""
        totals = self.counted()
        flown = [system.num_samples for system in self.systems if system.num_samples is not None]
        along = f" and {sum(flown)} logged inferences" if flown else ", no logs"
        number = f"{len(self.systems)} system{'' if len(self.systems) == 1 else 's'}"
        tools = inferred_as(*(system.semantics for system in self.systems))
        return f"{self._name}: {totals or 'nothing found'} ({number}{along}{tools})"

    def counted(self, system: str = "") -> str:
        """Count the findings of each severity, of all systems or of one."""
        severities = [finding.severity for finding in self.findings if system in ("", finding.system)]
        return ", ".join(each.counted(severities.count(each)) for each in _WORST_FIRST if each in severities)

    @property
    def _name(self) -> str:
        return self.controller or self.systems[0].name

    def document(self) -> Document:
        """Give a summary, the findings by severity, then the measures."""
        blocks: list[Block] = [Paragraph(self.summary())]
        for severity in _WORST_FIRST:
            findings = [
                f"{finding.system} · {finding.id}: {finding.sentence}\n→ {finding.cure}"
                for finding in self.findings
                if finding.severity == severity
            ]
            blocks += [Heading(severity.word.upper()), Items(findings)] if findings else []
        table = _measure_table(self.systems)
        return Document([*blocks, Heading("MEASURES"), table, Items(MEASURE_WORDS)])

    def plain(self) -> dict[str, Any]:
        """Return it as plain data, for the schema `SCHEMA`.

        Keys are ``controller``, ``summary`` (how many findings of each severity), ``systems`` (each with
        ``name``, ``samples`` and ``measures``) and ``findings``, the most serious first, as in `Finding`.
        """
        return {
            "controller": self.controller,
            "summary": {s.word: sum(f.severity == s for f in self.findings) for s in _WORST_FIRST},
            "systems": [
                {
                    "name": system.name,
                    "samples": system.num_samples,
                    "measures": _plain_measures(system.measures),
                }
                for system in self.systems
            ],
            "findings": plain(self.findings),
        }


_WORST_FIRST = tuple(sorted(Severity, reverse=True))


#: What the measures mean, a sentence each; all are from 0 (worst) to 1.
MEASURE_WORDS = (
    "Completeness: the strength of the strongest rule where rules cover the inputs worst.",
    "Rule consistency: how close the output, where a rule fires most strongly, comes to what that rule alone "
    "would give; an index of our own.",
)


def _completeness(measures: Measures) -> str:
    completeness = measures.completeness
    return f"{completeness.least:.2f}" if completeness.is_exact else f"{completeness.least:.2f} (of samples)"


#: What the table of measures says of a system, row by row.
_ROWS: dict[str, Callable[[Measures], str]] = {
    "rules": lambda m: str(m.complexity.rules),
    "premises": lambda m: str(m.complexity.premises),
    "terms in, out": lambda m: f"{m.complexity.input_terms}, {m.complexity.output_terms}",
    "completeness (lowest maximum strength)": _completeness,
    "rule consistency (lowest)": lambda m: two_decimals(m.rule_consistency.index),
}


def _measure_table(systems: tuple[AuditedSystem, ...]) -> Table:
    """Return the measures with one column per system."""
    rows = [[words, *(cell(system.measures) for system in systems)] for words, cell in _ROWS.items()]
    if any(system.num_samples is not None for system in systems):
        rows.append(["logged inferences", *(str(system.num_samples) for system in systems)])
    return Table(["", *(system.name for system in systems)], rows, numbers=range(1, 1 + len(systems)))


def _plain_measures(measures: Measures) -> dict[str, Any]:
    """Return a system's measures as plain data."""
    complete, consistency = measures.completeness, measures.rule_consistency
    return {
        **plain(measures.complexity),
        "coverage": plain(measures.coverage),
        "completeness": {"least": complete.least, "at": plain(complete.at), "exact": complete.is_exact},
        "rule_consistency": {"index": consistency.index, "rules": plain(consistency.values)},
    }
