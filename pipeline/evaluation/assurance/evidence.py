"""Evidence as plain data: requirements, methods, findings and verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import ceil, floor
from typing import Any

import numpy as np

from fis_tools.analysis.domain import Departure
from fis_tools.analysis.domain import as_mapping as domain_mapping
from pipeline.array_types import Floats
from pipeline.evaluation.assurance.campaign import Outcome
from pipeline.evaluation.assurance.claims import cases_needed
from pipeline.evaluation.assurance.domain import Domain
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.assurance.search import Search, speed
from pipeline.evaluation.assurance.sentence import sentence, share
from pipeline.evaluation.assurance.verdicts import WORDS, Found, outcomes, verdict

SCHEMA, SCHEMA_VERSION = "evidence", 1
#: number of bins for the margins of many cases, approximately
NUM_BINS = 60


def of_requirement(found: Found, random: Outcome | None, worst: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the evidence for one requirement.

    Parameters
    ----------
    found : Found
    random : Outcome, optional
        Of the random cases.
    worst : mapping, optional
        The worst case found and recorded, see `of_worst`.
    """
    requirement = found.requirement
    judged = verdict(found)
    told: dict[str, Any] = {
        **_claim(requirement),
        "verdict": judged.word,
        "share": share(requirement, judged),
        "sentence": sentence(found, judged),
        "why": judged.why,
        "methods": {
            name: {"verdict": WORDS[one.verdict], "word": one.word, "why": one.why}
            for name, one in outcomes(found).items()
        },
    }
    if found.judgement is not None:
        told["cases"] = {
            **asdict(found.judgement),
            "needed_without_failure": None
            if requirement.probability == 1.0
            else cases_needed(requirement.probability, requirement.confidence),
        }
        if random is not None:
            told["cases"]["histogram"] = histogram(random.margins)
    if found.searches and random is not None:
        told["search"] = of_searches(found.searches, random)
    if found.certificates:
        told["bounds"] = [
            {
                "system": one.system,
                "ask": one.question.ask,
                "where": one.question.where,
                "verdict": one.verdict,
                "sentence": one.sentence,
                "num_boxes": len(one.low),
            }
            for one in found.certificates
        ]
    if found.proof is not None:
        told["safety_layer"] = asdict(found.proof)
    if worst is not None:
        told["worst"] = dict(worst)
    return told


def _claim(requirement: Requirement) -> dict[str, Any]:
    return {
        "id": requirement.id,
        "title": requirement.title,
        "text": requirement.text,
        "consequence": requirement.consequence,
        "severity": requirement.severity,
        "accepted": requirement.accepted or None,
        "reason": requirement.reason,
        "source": requirement.source,
        "verified_by": list(requirement.verified_by),
        "formula": requirement.formula_text or None,
        "unit": requirement.unit,
        "probability": requirement.probability if requirement.confidence else None,
        "confidence": requirement.confidence or None,
    }


def histogram(margins: Floats) -> dict[str, Any]:
    """Count margins in bins of equal width; zero is an edge if margins lie on both sides of it."""
    low, high = float(margins.min()), float(margins.max())
    width = (high - low) / NUM_BINS or 1.0
    first, last, origin = 0, NUM_BINS, low
    if low < 0.0 < high:
        first, last, origin = floor(low / width), ceil(high / width), 0.0
    edges: Floats = origin + width * np.arange(first, last + 1, dtype=np.float64)
    edges[-1] = max(edges[-1], high)
    counts, _ = np.histogram(margins, edges)
    return {"edges": edges.tolist(), "counts": counts.tolist()}


def of_searches(searches: Sequence[Search], random: Outcome) -> dict[str, Any]:
    """Return the results of searches, with those of random flights."""
    compared = speed(searches, random)
    return {
        **asdict(compared),
        "ratio": compared.ratio,
        "sentence": compared.sentence,
        "num_flights": sum(len(one.scenarios) for one in searches),
        "worst_margin": min(float(one.outcome.margins.min()) for one in searches),
        "random_worst_margin": float(random.margins.min()),
        "first_failed": [one.first_failed for one in searches],
    }


def of_worst(
    source: str,
    start: Mapping[str, Any],
    margin: float,
    recorded: float,
    path: str,
    left: Sequence[Departure],
) -> dict[str, Any]:
    """Return the worst case of a requirement.

    Parameters
    ----------
    source : str
        The method that found it.
    start : mapping
        Its start.
    margin, recorded : float
        When found, and computed again from the recording.
    path : str
        Of the recording, in the run's folder.
    left : sequence of Departure
        When it left the operational domain.
    """
    return {
        "found_by": source,
        **start,
        "margin": margin,
        "recorded_margin": recorded,
        "recording": path,
        "left_domain": [asdict(one) for one in left],
    }


def of_domain(domain: Domain) -> dict[str, Any]:
    """Return an operational domain and how often flights that did not define it leave it."""
    told = asdict(domain)
    del told["boxes"]
    return {**domain_mapping(domain.boxes), **told}
