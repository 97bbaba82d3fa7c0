"""Audits of fuzzy controllers: what a reviewer should look at before signing, with the numbers behind it."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

import numpy as np

from fis_tools.analysis.arrays import check_samples
from fis_tools.analysis.measures import measure
from fis_tools.array_types import Floats
from fis_tools.findings.audit import answers, rules, terms
from fis_tools.findings.audit.report import Audit, AuditedSystem, Finding, Findings, Severity, Thresholds
from fis_tools.formats.serialize import edited, original_name
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.intervals import require_type_1
from fis_tools.model.validate import validate

__all__ = ["Audit", "AuditedSystem", "Finding", "Severity", "Thresholds", "audit"]


def audit(
    controller: FuzzyController | FuzzySystem,
    samples: Mapping[str, Floats] | None = None,
    thresholds: Thresholds | None = None,
) -> Audit:
    """Check a controller for everything that its reviewer should know.

    Parameters
    ----------
    controller : FuzzyController or FuzzySystem
        What is audited.
    samples : mapping of str to (n, num_inputs), optional
        Inputs by the system's name, such as `fis_tools.analysis.flights.inputs_along` returns; with them, the
        audit reports what the rules did there.
    thresholds : Thresholds, optional
        The limits beyond which something is a finding.

    Raises
    ------
    InvalidSystem
        If a system has problems, with one line for each.
    ValueError
        If samples are given for an unknown system, or their number of columns is not its number of inputs.
    """
    systems = (controller,) if isinstance(controller, FuzzySystem) else controller.systems
    require_type_1(systems, "an audit")
    thresholds = thresholds or Thresholds()
    check_samples(systems, samples or {})
    name, findings = "", list[Finding]()
    if isinstance(controller, FuzzyController):
        name, findings = controller.name, [*_edited(controller)]
    audited = []
    for system in systems:
        validate(system)
        measures = measure(system)
        results = [check.find(system, measures, thresholds) for check in (terms, rules, answers)]
        rows = None if samples is None else samples.get(system.name, np.empty((0, len(system.inputs))))
        if rows is not None:
            results.append(answers.find_along(system, rows, thresholds))
        audited.append(
            AuditedSystem(system.name, measures, None if rows is None else len(rows), system.semantics)
        )
        findings += (replace(finding, system=system.name) for finding in chain(*results))
    findings.sort(key=lambda finding: -finding.severity)
    return Audit(name, tuple(audited), tuple(findings))


def _edited(controller: FuzzyController) -> Findings:
    """Yield a finding if a controller differs from the one that its provenance describes."""
    if (how := edited(controller)) is not None:
        yield Finding(
            "edited",
            Severity.WARNING,
            f"{original_name(controller)} was edited {how}.",
            "Measure it anew, or take the controller that the figures are of.",
            system=controller.name,
        )
