"""Evidence as plain data and as tables: findings, verdicts, and the operational domain of flights."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import ceil, floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis.domain import Box, Departure, box_of, departures
from fis_tools.analysis.domain import as_mapping as domain_mapping
from pipeline.array_types import Floats
from pipeline.evaluation.assurance import judgements, sentences, verdicts
from pipeline.evaluation.assurance.campaign import FormulaResult, WorstCaseSearch, search_efficiency
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.paired_runs import of_deputy
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.scenarios import columns_of
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.sizes import BLOCK_ROWS
from pipeline.threads import in_threads


@dataclass(frozen=True)
class Domain:
    """The inputs that some flights met, and how other flights compare.

    Parameters
    ----------
    boxes : tuple of Box
        One for each system that decided anything.
    num_made_from, num_tried, num_left : int
        Flights that define it; others that test it; and how many of these left it.
    high : float
        Upper bound, with `confidence`, of the share of such flights that leave it.
    confidence : float
    """

    boxes: tuple[Box, ...]
    num_made_from: int
    num_tried: int
    num_left: int
    high: float
    confidence: float


def domain_of(
    experiment: Experiment, controller: Controller, scenarios: Sequence[Scenario], confidence: float
) -> Domain:
    """Fly scenarios, logged: the first half defines the domain, the second tests it.

    Parameters
    ----------
    experiment : Experiment
    controller : Controller
        With fuzzy systems.
    scenarios : sequence of Scenario
        At least two.
    confidence : float
    """
    half = len(scenarios) // 2

    def flown_from(scenario: Scenario) -> dict[str, Floats]:
        return sensed(fly_logged(experiment.mission, controller, scenario), controller)

    flown = in_threads(flown_from, scenarios, workers=experiment.assurance.workers)
    boxes = []
    for system in controller.systems:
        rows = np.concatenate([inputs[system.name] for inputs in flown[:half]])
        if len(rows):
            boxes.append(box_of(system, rows))
    num_left = sum(
        any(bool((box.beyond(inputs[box.system]) > 0.0).any()) for box in boxes) for inputs in flown[half:]
    )
    num_tried = len(scenarios) - half
    _, high = judgements.share_bounds(num_left, num_tried, confidence)
    return Domain(tuple(boxes), half, num_tried, num_left, high, confidence)


def sensed(log: FlightLog, controller: Controller) -> dict[str, Floats]:
    """Return the inputs of each system, by its name, where inference decided, (n, num_inputs)."""
    return {
        system.name: log.fis_input[log.is_decided, index, : len(system.inputs)].copy()
        for index, system in enumerate(controller.systems)
    }


def left_on(domain: Domain, log: FlightLog, controller: Controller, period_s: float) -> tuple[Departure, ...]:
    """Return when the inputs of a flight were outside an operational domain, the earliest first."""
    times = np.flatnonzero(log.is_decided).astype(np.float64) * period_s
    inputs = sensed(log, controller)
    departed = [departure for box in domain.boxes for departure in departures(box, times, inputs[box.system])]
    return tuple(sorted(departed, key=lambda departure: departure.first_s))


SCHEMA, SCHEMA_VERSION = "evidence", 2
#: number of bins for the margins of many cases, approximately
NUM_BINS = 60


def requirement_entry(
    evidence: verdicts.Evidence, random: FormulaResult | None, worst: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Return the evidence for a requirement as plain data.

    Parameters
    ----------
    evidence : Evidence
    random : FormulaResult, optional
        Of the random cases.
    worst : mapping, optional
        The worst case found and recorded, see `pipeline.report.worst_flight`.
    """
    requirement = evidence.requirement
    judged = verdicts.verdict(evidence)
    entry: dict[str, Any] = {
        **_claim(requirement),
        "verdict": judged.word,
        "share": sentences.claimed_share(requirement, judged),
        "reach": sentences.claimed_reach(evidence, judged).removeprefix(", "),
        "sentence": sentences.sentence(evidence, judged),
        "why": judged.why,
        "methods": {
            name: {
                "verdict": result.verdict,
                "word": result.word,
                "why": result.why,
                "is_proof": result.is_proof,
            }
            for name, result in verdicts.results_by_method(evidence).items()
        },
        "unproved": list(verdicts.unproved(evidence)),
    }
    if evidence.judgement is not None:
        share = requirement.probability
        needed = None if share == 1.0 else judgements.needed_by(evidence.judgement, share)
        entry["cases"] = {**asdict(evidence.judgement), "needed_without_failure": needed}
        if random is not None:
            entry["cases"]["histograms"] = histograms(random, requirement.unit)
    if evidence.rare is not None:
        entry["splitting"] = asdict(evidence.rare)
    if evidence.searches and random is not None:
        entry["search"] = searches_entry(evidence.searches, random, requirement.unit)
    if evidence.certificates:
        entry["bounds"] = [
            {
                "system": certificate.system,
                **asdict(certificate.question),
                "verdict": certificate.verdict,
                "sentence": certificate.sentence,
                "num_boxes": len(certificate.low),
            }
            for certificate in evidence.certificates
        ]
    if evidence.proof is not None:
        entry["safety_layer"] = asdict(evidence.proof)
    if evidence.tube is not None:
        entry["tube"] = asdict(evidence.tube)
    if worst is not None:
        entry["worst"] = dict(worst)
    return entry


def _claim(requirement: Requirement) -> dict[str, Any]:
    """Return a requirement's claim as plain data."""
    return {
        **{name: getattr(requirement, name) for name in ("id", "title", "text", "consequence", "severity")},
        "accepted": requirement.accepted or None,
        **{name: getattr(requirement, name) for name in ("reason", "source")},
        "verified_by": list(requirement.verified_by),
        "formula": requirement.formula_text or None,
        "unit": requirement.unit,
        "probability": requirement.probability if requirement.confidence else None,
        "confidence": requirement.confidence or None,
    }


def histograms(result: FormulaResult, unit: str) -> list[dict[str, Any]]:
    """Return a histogram of margins for each unit that they have, with its ``unit`` and ``least`` margin."""
    units = result.units if len(result.units) else np.full(len(result.margins), unit)
    return [
        {"unit": str(name), "least": float(margins.min()), **histogram(margins)}
        for name in dict.fromkeys(units.tolist())
        if len(margins := result.margins[units == name])
    ]


def joint_claim(entries: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Return the claims that flights show, and the confidence that all hold; None for fewer than two."""
    shown = [
        entry
        for entry in entries
        if entry["verdict"] == "shown"
        and entry["confidence"]
        and not any(method["is_proof"] for method in entry["methods"].values())
    ]
    if len(shown) < 2:
        return None
    confidence = verdicts.joint_confidence([entry["confidence"] for entry in shown])
    return {"requirements": [entry["id"] for entry in shown], "confidence": confidence}


def joint_words(joint: Mapping[str, Any] | None) -> str:
    """Return the confidence that several claims hold at once, in a sentence; empty if there is none."""
    if joint is None:
        return ""
    *names, last = joint["requirements"]
    sure = verdicts.percent(joint["confidence"])
    return (
        f"{', '.join(names)} and {last} are shown by flights, each with its own confidence; that all of them "
        f"hold at once has a confidence of at least {sure} (Bonferroni: the risks add up)."
    )


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


def searches_entry(searches: Sequence[WorstCaseSearch], random: FormulaResult, unit: str) -> dict[str, Any]:
    """Return the results of searches, with those of random flights; the unit is that of the formula."""
    worst = min(search.outcome.worst for search in searches)
    compared = search_efficiency(searches, random)
    return {
        **asdict(compared),
        "ratio": compared.ratio,
        "sentence": compared.sentence,
        "num_flights": sum(len(search.scenarios) for search in searches),
        "worst_margin": worst[0],
        "worst_unit": worst[1] or unit,
        "random_worst_margin": random.worst[0],
        "random_worst_unit": random.worst[1] or unit,
        "first_failed": [search.first_failed for search in searches],
    }


def domain_entry(domain: Domain) -> dict[str, Any]:
    """Return an operational domain and how often flights that did not define it leave it."""
    entry = asdict(domain)
    del entry["boxes"]
    return {**domain_mapping(domain.boxes), **entry}


Columns = dict[str, NDArray[Any]]


def case_columns(
    mission: Mission, scenarios: Sequence[Scenario], outcomes: Mapping[str, FormulaResult]
) -> Columns:
    """Return the columns of `assure/cases.parquet`: starts, each requirement's margin, whether it is met.

    Each dispersed setting has a column, named after its key.
    """
    judged = {
        f"{name}_{quantity}": values
        for name, outcome in outcomes.items()
        for quantity, values in (("margin", outcome.margins), ("met", outcome.is_met))
    }
    return {"case": np.arange(len(scenarios)), **_starts(mission, scenarios), **judged}


def search_columns(mission: Mission, gathered: Sequence[verdicts.Evidence]) -> Columns:
    """Return the columns of `assure/search.parquet`: every flight of every search; none without a search."""
    flown: list[tuple[str, int, WorstCaseSearch]] = [
        (evidence.requirement.id, number, search)
        for evidence in gathered
        for number, search in enumerate(evidence.searches)
    ]
    if not flown:
        return {}
    counts = [len(evidence.scenarios) for _, _, evidence in flown]
    return {
        "requirement": np.repeat([name for name, _, _ in flown], counts),
        "search": np.repeat([number for _, number, _ in flown], counts),
        "flight": np.concatenate([np.arange(count) for count in counts]),
        **_starts(mission, [scenario for _, _, evidence in flown for scenario in evidence.scenarios]),
        "margin": np.concatenate([evidence.outcome.margins for _, _, evidence in flown]),
        "met": np.concatenate([evidence.outcome.is_met for _, _, evidence in flown]),
    }


def box_columns(gathered: Sequence[verdicts.Evidence]) -> Columns:
    """Return the columns of `assure/boxes.parquet`: a row for each input of each box of each certificate."""
    rows = [
        (evidence.requirement.id, proof.system, proof.question.ask, box, name, low[column], high[column])
        for evidence in gathered
        for proof in evidence.certificates
        for box, (low, high) in enumerate(zip(proof.low, proof.high, strict=True))
        for column, name in enumerate(proof.inputs)
    ]
    names = ("requirement", "system", "ask", "box", "input", "low", "high")
    return (
        {name: np.array([row[column] for row in rows]) for column, name in enumerate(names)} if rows else {}
    )


def _starts(mission: Mission, scenarios: Sequence[Scenario]) -> Columns:
    """Return the columns of starts, Suns, and drawn settings; few starts are in memory at a time."""
    firsts = range(0, len(scenarios), BLOCK_ROWS)
    blocks = [_block_of_starts(mission, list(scenarios[first : first + BLOCK_ROWS])) for first in firsts]
    # where all starts of a block are at rest, it has no velocities
    names = max(blocks, key=len)
    zeros = [np.zeros(len(block["sun_angle_rad"])) for block in blocks]
    return {
        name: np.concatenate([block.get(name, zero) for block, zero in zip(blocks, zeros, strict=True)])
        for name in names
    }


def _block_of_starts(mission: Mission, scenarios: Sequence[Scenario]) -> Columns:
    settings = [dict(drawn(mission, scenario)) for scenario in scenarios] if mission.dispersions else []
    return {
        **(_starts_of_fleets(scenarios) if mission.has_fleet else columns_of(scenarios)),
        "sun_angle_rad": np.array([scenario.sun_angle_rad for scenario in scenarios]),
        "sun_elevation_rad": np.array([scenario.sun_elevation_rad for scenario in scenarios]),
        **{key: np.array([of[key] for of in settings]) for key in (settings[0] if settings else ())},
    }


def _starts_of_fleets(scenarios: Sequence[Scenario]) -> Columns:
    """Return the starts of all deputies, those of further ones named after them."""
    return {
        of_deputy(name, number + 1): column
        for number, starts in enumerate(zip(*(scenario.fleet for scenario in scenarios), strict=True))
        for name, column in columns_of(starts).items()
    }
