"""An audit as text for a terminal, as plain data, and as HTML for a notebook."""

import textwrap
from dataclasses import dataclass
from html import escape
from typing import Any

from fis_tools.analysis.measures import Measures
from fis_tools.findings.audit.finding import Finding, Severity
from fis_tools.words.text import aligned

SCHEMA = "fuzzy-audit"
SCHEMA_VERSION = 2


@dataclass(frozen=True, repr=False)
class AuditedSystem:
    """The measures of one system.

    Parameters
    ----------
    name : str
    measures : Measures
    num_samples : int or None
        Inferences on the flights that were read; None without flights.
    """

    name: str
    measures: Measures
    num_samples: int | None


@dataclass(frozen=True)
class Audit:
    """What an audit found.

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
        counts = [(sum(f.severity == severity for f in self.findings), severity) for severity in _WORST_FIRST]
        told = ", ".join(f"{count} {_plural(severity, count)}" for count, severity in counts if count)
        flown = [system.num_samples for system in self.systems if system.num_samples is not None]
        along = f" and {sum(flown)} logged inferences" if flown else ", no logs"
        number = f"{len(self.systems)} system{'' if len(self.systems) == 1 else 's'}"
        return f"{self._name}: {told or 'nothing found'} ({number}{along})"

    @property
    def _name(self) -> str:
        return self.controller or self.systems[0].name

    def __repr__(self) -> str:
        return text(self)

    def _repr_html_(self) -> str:
        return html(self)


_WORST_FIRST = tuple(sorted(Severity, reverse=True))


def _plural(severity: Severity, count: int) -> str:
    return severity.word + ("" if severity is Severity.SERIOUS or count == 1 else "s")


def text(audit: Audit, width: int = 110) -> str:
    """Write an audit for a terminal: a summary, the findings by severity, then the measures."""
    lines = [audit.summary()]
    for severity in _WORST_FIRST:
        found = [finding for finding in audit.findings if finding.severity == severity]
        lines += ["", severity.word.upper()] if found else []
        for finding in found:
            lines += _wrapped(f"{finding.system} · {finding.id}: {finding.sentence}", width, "  ", "    ")
            lines += _wrapped(f"→ {finding.cure}", width, "    ", "      ")
    lines += ["", "MEASURES", *aligned(_measure_rows(audit), 2)]
    for words in measure_words(audit):
        lines += _wrapped(words, width, "  ", "    ")
    return "\n".join(lines) + "\n"


def _wrapped(words: str, width: int, first: str, others: str) -> list[str]:
    kept = words.replace(" %", "\N{NO-BREAK SPACE}%")
    lines = textwrap.wrap(kept, width, initial_indent=first, subsequent_indent=others, break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def measure_words(audit: Audit) -> tuple[str, ...]:
    """Explain the measures, a sentence each; all are from 0 (worst) to 1."""
    return (
        "Completeness: how strongly the strongest rule fires where rules cover the inputs worst.",
        "Nauck index: how easily the rules are read (few premises, few and evenly spread terms; Nauck 2003).",
        f"GM3M: how near the terms are to {audit.systems[0].measures.reference}, by their places, symmetry "
        "and areas (Gacto, Alcalá and Herrera 2010, who compare with the terms before tuning: --reference).",
        "Rule consistency: how much the system answers what a rule says where that rule fires most strongly, "
        "against the rule alone; our own index.",
    )


def _measure_rows(audit: Audit) -> list[list[str]]:
    """Return the measures as a table with one column per system."""
    rows = [["", *(system.name for system in audit.systems)]]
    measured = [system.measures for system in audit.systems]
    rows.append(["rules", *(str(m.complexity.rules) for m in measured)])
    rows.append(["premises", *(str(m.complexity.premises) for m in measured)])
    rows.append(
        ["terms in, out", *(f"{m.complexity.input_terms}, {m.complexity.output_terms}" for m in measured)]
    )
    rows.append(["completeness (lowest maximum strength)", *(_completeness(m) for m in measured)])
    rows.append(["Nauck index", *(f"{m.nauck.index:.4f}" for m in measured)])
    rows.append(["GM3M", *(f"{m.gm3m:.2f}" for m in measured)])
    rows.append(["rule consistency (lowest)", *(f"{m.rule_consistency.index:.2f}" for m in measured)])
    if any(system.num_samples is not None for system in audit.systems):
        rows.append(["logged inferences", *(str(system.num_samples) for system in audit.systems)])
    return rows


def _completeness(measures: Measures) -> str:
    found = measures.completeness
    return f"{found.least:.2f}" if found.is_exact else f"{found.least:.2f} (of samples)"


def plain(audit: Audit) -> dict[str, Any]:
    """Return an audit as plain JSON data.

    Keys are ``schema`` (fuzzy-audit), ``schema_version`` (2), ``controller``, ``summary`` (how many findings
    of each severity), ``systems`` (each with ``name``, ``samples`` and ``measures``) and ``findings``, the
    most serious first, each with ``id``, ``severity``, ``system``, ``variable``, ``terms``, ``rules``
    (numbers from 1), ``sentence``, ``cure`` and ``evidence``. Keys may be added; the version changes when one
    changes its meaning or is removed.
    """
    return {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "controller": audit.controller,
        "summary": {s.word: sum(f.severity == s for f in audit.findings) for s in _WORST_FIRST},
        "systems": [
            {"name": system.name, "samples": system.num_samples, "measures": _plain_measures(system.measures)}
            for system in audit.systems
        ],
        "findings": [
            {
                "id": finding.id,
                "severity": finding.severity.word,
                "system": finding.system,
                "variable": finding.variable,
                "terms": list(finding.terms),
                "rules": list(finding.rules),
                "sentence": finding.sentence,
                "cure": finding.cure,
                "evidence": dict(finding.evidence),
            }
            for finding in audit.findings
        ],
    }


def _plain_measures(measures: Measures) -> dict[str, Any]:
    counted, nauck, complete = measures.complexity, measures.nauck, measures.completeness
    return {
        "rules": counted.rules,
        "premises": counted.premises,
        "input_terms": counted.input_terms,
        "output_terms": counted.output_terms,
        "nauck": {
            "complexity": nauck.complexity,
            "coverage": nauck.coverage,
            "partition": nauck.partition,
            "index": nauck.index,
        },
        "coverage": {name: {"least": c.least, "at": c.at} for name, c in measures.coverage.items()},
        "completeness": {"least": complete.least, "at": complete.at.tolist(), "exact": complete.is_exact},
        "gm3m": {
            "reference": measures.reference,
            "index": measures.gm3m,
            "variables": {name: found.gm3m for name, found in measures.integrity.items()},
        },
        "rule_consistency": {
            "index": measures.rule_consistency.index,
            "rules": measures.rule_consistency.values.tolist(),
        },
    }


def html(audit: Audit) -> str:
    """Write an audit as a fragment of a page: a summary, a table of findings, a table of measures."""
    findings = "".join(
        f'<tr class="{finding.severity.word}"><td><strong>{finding.severity.word}</strong></td>'
        f"<td>{escape(finding.system)}</td><td><code>{finding.id}</code></td>"
        f'<td style="text-align: left">{escape(finding.sentence)}'
        f"<br><em>{escape(finding.cure)}</em></td></tr>"
        for finding in audit.findings
    )
    head, *rows = _measure_rows(audit)
    columns = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head[1:])
    measures = "".join(
        f'<tr><th scope="row">{escape(name)}</th>' + "".join(f"<td>{escape(c)}</td>" for c in cells) + "</tr>"
        for name, *cells in rows
    )
    explained = "".join(f"<li>{escape(words)}</li>" for words in measure_words(audit))
    heads = "".join(
        f'<th scope="col">{word}</th>' for word in ("severity", "system", "kind", "finding and cure")
    )
    return (
        f'<section class="audit"><p>{escape(audit.summary())}</p>'
        f"<table><caption>Findings</caption><thead><tr>{heads}</tr></thead><tbody>{findings}</tbody></table>"
        f"<table><caption>Measures</caption><thead><tr><td></td>{columns}</tr></thead>"
        f"<tbody>{measures}</tbody></table><ul>{explained}</ul></section>"
    )
