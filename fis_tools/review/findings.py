"""What the audit found, laid out for the page: sentences with links to what they are about."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from fis_tools.findings.audit import Audit, Finding
from fis_tools.model import FuzzyController, FuzzySystem

#: of many rules only so many are linked
MOST_LINKS = 6


def finding_rows(audit: Audit, controller: FuzzyController) -> list[dict[str, Any]]:
    """Return a row for each finding, the most serious first.

    A row holds a key that tells it from the others, its severity as a word and as a number, the system's
    name, sentence and cure, links as (words, id on the page), and in ``point`` the inputs at which it can be
    seen, as JSON; empty where there are none.
    """
    places = {system.name: place for place, system in enumerate(controller.systems, start=1)}
    rows = []
    for finding in audit.findings:
        place = places[finding.system]
        system = controller.systems[place - 1]
        rows.append(
            {
                "key": "/".join(
                    (finding.id, finding.system, finding.variable, *finding.terms, *map(str, finding.rules))
                ),
                "severity": finding.severity.word,
                "weight": int(finding.severity),
                "system": finding.system,
                "place": place,
                "sentence": finding.sentence,
                "cure": finding.cure,
                "links": _links(finding, system, f"s{place}"),
                "point": _point(finding, system),
            }
        )
    return rows


def finding_counts(audit: Audit, system: str = "") -> str:
    """Say how many findings of each severity there are, maybe of one system: ``1 serious, 2 warnings``."""
    counts = Counter(finding.severity for finding in audit.findings if system in ("", finding.system))
    return ", ".join(one.counted(counts[one]) for one in sorted(counts, reverse=True)) or "none"


def _links(finding: Finding, system: FuzzySystem, system_id: str) -> list[tuple[str, str]]:
    links = []
    for kind, variables in (("i", system.inputs), ("o", system.outputs)):
        for place, variable in enumerate(variables, start=1):
            if variable.name == finding.variable:
                links.append((variable.name, f"{system_id}-{kind}{place}"))
    links += [(f"rule {number}", f"{system_id}-r{number}") for number in finding.rules[:MOST_LINKS]]
    return links or [(system.name, system_id)]


def _point(finding: Finding, system: FuzzySystem) -> str:
    """Return inputs, or some of them, at which a finding can be seen."""
    evidence: Mapping[str, Any] = finding.evidence
    inputs = {variable.name for variable in system.inputs}
    point: dict[str, float] = {}
    at = evidence.get("at")
    if isinstance(at, Sequence) and len(at) == len(system.inputs):
        point = {variable.name: value for variable, value in zip(system.inputs, at, strict=True)}
    elif isinstance(at, float) and finding.variable in inputs:
        point = {finding.variable: at}
    elif "held" in evidence and finding.variable in inputs:
        point = {**evidence["held"], finding.variable: evidence["from"]}
    return json.dumps(point) if point else ""
