"""Gather evidence for requirements: flights, searches, proofs and a page of the results: assure/."""

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fis_tools.analysis.domain import as_mapping
from pipeline.controllers.source import controller_of_run, sha256_of
from pipeline.evaluation import sequential
from pipeline.evaluation.assurance import evidence, repeats
from pipeline.evaluation.assurance.campaign import (
    MET,
    Campaign,
    FormulaResult,
    WorstCaseSearch,
    search,
    search_efficiency,
)
from pipeline.evaluation.assurance.case_space import case_space
from pipeline.evaluation.assurance.certificates import certificates, check_questions
from pipeline.evaluation.assurance.conditions import conditions_of, start_bounds
from pipeline.evaluation.assurance.evidence import Domain, domain_of
from pipeline.evaluation.assurance.judgements import cases_needed, failures_allowed, judge
from pipeline.evaluation.assurance.proofs import safety_proof
from pipeline.evaluation.assurance.rare import RARE, NotMet
from pipeline.evaluation.assurance.repeats import repeats_in_words
from pipeline.evaluation.assurance.requirements import (
    BOUNDS,
    CASES,
    METHODS,
    SAFETY_LAYER,
    SEARCH,
    SPLITTING,
    TUBE,
    Requirement,
    Requirements,
    parse_requirements,
    requirements_text,
)
from pipeline.evaluation.assurance.verdicts import Evidence, percent
from pipeline.evaluation.splitting import POPULATIONS, RareShare, rare_share
from pipeline.flight.control.controller import Controller
from pipeline.recording.recorder import FlightRecorder
from pipeline.report.board import render_board
from pipeline.report.board_flights import MOST_FOLLOWED, flights_of_board
from pipeline.report.evidence import render_evidence
from pipeline.report.figures.style import Illustration
from pipeline.report.played import player_of_worst
from pipeline.report.proof_of_run import tube_drawn, tube_proof
from pipeline.report.worst_flight import record_worst, worst_drawn, worst_of
from pipeline.run import artifacts, configuration, maker, tables, writing
from pipeline.run.engine import TaskPool, open_pool
from pipeline.run.progress import Progress
from pipeline.scenarios import DrawnCases
from pipeline.settings.experiment import Assurance, Experiment

#: what methods are called in words
METHOD_WORDS = {name: name.replace("_", " ") for name in METHODS}
#: of the bound on how many flights leave the operational domain
CONFIDENCE = 0.9
#: flights in the picture of a tube
MOST_DRAWN = 100


def run(experiment: Experiment, folder: Path) -> str:
    """Gather the evidence, write it as data and as a page; the ledger keeps what was tried before.

    Return which proofs were asked for in vain, empty if none.

    Raises
    ------
    pipeline.evaluation.assurance.requirements.RequirementError
        If the requirements cannot be read.
    pipeline.run.artifacts.ArtifactError
        If a recorded flight differs from the one that was found.
    """
    text = requirements_text(experiment.assurance.requirements, experiment.mission)
    requirements = parse_requirements(text, experiment.assurance.requirements)
    _print_needs(requirements.requirements, experiment.assurance)
    repeats.seed_ledger(folder)
    for path in (folder / artifacts.WORST_FLIGHTS).glob("*.mcap"):
        path.unlink()
    writing.write_atomically(folder / artifacts.REQUIREMENTS, text)
    with open_pool(experiment.engine, experiment.assurance.workers) as pool:
        gathered = _gather(experiment, folder, requirements, pool)
    # first: whoever reads the evidence finds it in the ledger
    repeats.append(folder, gathered)
    writing.write_json(folder / artifacts.EVIDENCE, gathered)
    requirements_told = gathered["requirements"]
    controller = controller_of_run(experiment, folder)
    player = player_of_worst(experiment, controller, folder, requirements_told)
    page = render_evidence(gathered, _tube_drawn(experiment, folder, requirements_told), player)
    writing.write_atomically(folder / artifacts.EVIDENCE_PAGE, page)
    writing.write_atomically(folder / artifacts.BOARD_PAGE, _board(experiment, folder, gathered))
    for entry in gathered["requirements"]:
        sys.stderr.write(f"  {entry['id']} {entry['title']}. {entry['sentence']}\n")
    for words in (evidence.joint_words(gathered["joint"]), repeats_in_words(gathered)):
        sys.stderr.write(f"  {words}\n" if words else "")
    sys.stderr.write(f"  {folder / artifacts.EVIDENCE_PAGE}\n")
    unproved = [
        f"{entry['id']} ({', '.join(METHOD_WORDS[name] for name in entry['unproved'])})"
        for entry in gathered["requirements"]
        if entry["unproved"]
    ]
    return f"no proof was found, though one was asked for, of {', '.join(unproved)}" if unproved else ""


def _print_needs(requirements: Sequence[Requirement], settings: Assurance) -> None:
    """Print before anything flies how many cases the claims need."""
    num_cases, is_sequential = settings.num_cases, settings.stop_width is not None
    for requirement in requirements:
        if CASES in requirement.verified_by and requirement.probability == 1.0:
            sys.stderr.write(f"  {requirement.id}: all cases must meet it, which only a proof shows\n")
        elif CASES in requirement.verified_by:
            # flights that end by themselves leave half of the risk to other tries
            sure = 0.5 + 0.5 * requirement.confidence if is_sequential else requirement.confidence
            needed = [
                cases_needed(requirement.probability, sure, failed, is_sequential=is_sequential)
                for failed in (0, 1, 2)
            ]
            allowed = failures_allowed(num_cases, requirement.probability, sure, is_sequential=is_sequential)
            claim = f"{percent(requirement.probability)} with {percent(requirement.confidence)} confidence"
            counts = ", ".join(f"{count:,}" for count in needed)
            room = f"{num_cases:,} allow {allowed:,}" if allowed >= 0 else f"{num_cases:,} are too few"
            sys.stderr.write(
                f"  {requirement.id}: {claim} needs {counts} cases with 0, 1, 2 failures; {room}\n"
            )


def _gather(
    experiment: Experiment, folder: Path, requirements: Requirements, pool: TaskPool
) -> dict[str, Any]:
    """Fly, search and prove; return the evidence as plain data."""
    settings, mission = experiment.assurance, experiment.mission
    controller = controller_of_run(experiment, folder)
    check_questions(requirements.requirements, controller)
    scenarios = _scenarios(experiment, settings.num_cases)
    campaign = Campaign(mission, controller, pool.threads(settings.workers))
    campaign.tracks([scenarios[0]])  # compiles if necessary
    started = time.perf_counter()
    # the question of a try is known before its flights are
    tries = repeats.earlier_tries(folder, _subject(experiment, folder, controller))
    is_sequential = settings.stop_width is not None
    flights = repeats.flights_of(experiment.seed, settings.num_cases, is_sequential=is_sequential)
    stops = _stops(settings, requirements.requirements, flights, tries)
    part_cases = experiment.engine.part_cases
    with Progress("case:", settings.num_cases, 0) as progress:
        outcomes = campaign.judge(
            scenarios, requirements.requirements, pool, part_cases, stops, progress.show
        )
    num_flown = min((len(outcome.is_met) for outcome in outcomes.values()), default=len(scenarios))
    experiment = replace(experiment, assurance=replace(settings, num_cases=num_flown))
    scenarios = scenarios[:num_flown]
    sys.stderr.write(f"  {num_flown:,} cases flown and judged in {time.perf_counter() - started:.1f} s\n")
    if is_sequential:
        how = "stopped" if num_flown < settings.num_cases else "not stopped: an interval is wider"
        sys.stderr.write(f"  {how}; assurance.stop_width is {settings.stop_width:g}\n")
    _write(folder, artifacts.ASSURED_CASES, evidence.case_columns(mission, scenarios, outcomes))
    domain = _domain(experiment, controller, folder)
    proof = safety_proof(mission, scenarios, start_bounds(experiment))
    recorder = FlightRecorder(experiment, controller, configuration.read(folder))
    entries, all_evidence = [], []
    for requirement in requirements.requirements:
        outcome = outcomes.get(requirement.id)
        judgement = None
        if outcome is not None and CASES in requirement.verified_by:
            claim = requirement.probability, requirement.confidence
            before = repeats.tried(requirement, flights, tries, num_flown)
            flown_cases = outcome.margins, outcome.is_met
            judgement = judge(*flown_cases, *claim, outcome.num_occurred, before, is_sequential=is_sequential)
        searches = _searches(experiment, campaign, requirement, outcome, pool)
        risk = repeats.splitting_risk(requirement, flights, tries)
        bounds = certificates(requirement, controller) if BOUNDS in requirement.verified_by else ()
        # whoever asks for a way out asks for the proof that flights stay
        is_kept = proof.stays and requirement.formula is not None and proof.implies(requirement.formula)
        layer = proof if is_kept or SAFETY_LAYER in requirement.verified_by else None
        tube = tube_proof(experiment, controller, folder) if TUBE in requirement.verified_by else None
        flown = [result for result in (outcome, *(search.outcome for search in searches)) if result]
        collected = Evidence(
            requirement,
            judgement,
            searches,
            bounds,
            layer,
            tube,
            duration_s=mission.duration_s,
            period_s=mission.control_period_s,
            worst_unit=min((result.worst for result in flown), default=(0.0, ""))[1],
            rare=_rare(experiment, campaign, requirement, risk, pool),
        )
        recorded = None
        if outcome is not None:
            worst = worst_of(collected, scenarios, outcome)
            recorded = record_worst(folder, mission, recorder, domain, requirement, worst)
        all_evidence.append(collected)
        entries.append(evidence.requirement_entry(collected, outcome, recorded))
    _write(folder, artifacts.SEARCHED, evidence.search_columns(mission, all_evidence))
    _write(folder, artifacts.PROOF_BOXES, evidence.box_columns(all_evidence))
    return {
        **_provenance(experiment, folder, controller, requirements),
        "domain": None if domain is None else evidence.domain_entry(domain),
        "requirements": entries,
        "joint": evidence.joint_claim(entries),
        "earlier": repeats.listed(tries, flights),
    }


def _stops(
    settings: Assurance,
    requirements: Sequence[Requirement],
    flights: repeats.Flights,
    tries: Sequence[repeats.Try],
) -> dict[str, sequential.Stop]:
    """Return where flights end by the interval of each claim that they judge; nothing if all are flown."""
    if settings.stop_width is None:
        return {}
    judged = [each for each in requirements if CASES in each.verified_by and each.formula is not None]
    risks = {each.id: repeats.tried(each, flights, tries).risk for each in judged}
    return {
        name: sequential.Stop(MET, settings.stop_width, 100.0 * (1.0 - risk)) for name, risk in risks.items()
    }


def _scenarios(experiment: Experiment, num_cases: int) -> DrawnCases:
    """Return the first cases that are drawn from this seed; claims are about random starts."""
    cases = replace(experiment.monte_carlo, num_cases=num_cases, table=None)
    return DrawnCases(replace(experiment, monte_carlo=cases), range(num_cases))


def _searches(
    experiment: Experiment,
    campaign: Campaign,
    requirement: Requirement,
    random: FormulaResult | None,
    pool: TaskPool,
) -> tuple[WorstCaseSearch, ...]:
    """Search for the worst case of a requirement, if it asks for that, and print how it went."""
    if SEARCH not in requirement.verified_by or random is None:
        return ()
    space = case_space(experiment)
    numbers = range(experiment.assurance.searches)
    tasks = [(requirement, campaign, space, experiment, number) for number in numbers]
    ended: dict[int, WorstCaseSearch] = {}
    with Progress(f"{requirement.id}, search:", len(tasks), 0) as progress:
        for index, result in pool.run(search, tasks):
            ended[index] = result
            progress.show(len(ended))
    searches = tuple(ended[number] for number in numbers)
    sys.stderr.write(f"  {requirement.id}: {search_efficiency(searches, random).sentence}\n")
    return searches


def _rare(
    experiment: Experiment, campaign: Campaign, requirement: Requirement, risk: float, pool: TaskPool
) -> RareShare | None:
    """Return the share of cases that fail a requirement, by splitting, if it asks for that, and print it."""
    if SPLITTING not in requirement.verified_by:
        return None
    drawn_cases = replace(experiment, monte_carlo=replace(experiment.monte_carlo, table=None))
    law = NotMet(case_space(drawn_cases, is_exact=True), experiment.seed, campaign, requirement)
    # each end of the interval has the risk
    confidence, num_flights = 100.0 * (1.0 - 2.0 * risk), experiment.assurance.splitting_flights
    with Progress(f"{requirement.id}, population:", POPULATIONS, 0) as progress:
        rare = rare_share(law, num_flights, confidence, (experiment.seed, RARE, 1), pool, progress.show)
    sys.stderr.write(f"  {requirement.id}: {rare.sentence} fail\n")
    return rare


def _tube_drawn(
    experiment: Experiment, folder: Path, entries: Sequence[Mapping[str, Any]]
) -> Illustration | None:
    """Draw the tube of the proof that a requirement rests on, over the first cases."""
    if not any("tube" in entry and entry["tube"]["is_checked"] for entry in entries):
        return None
    num_cases = min(MOST_DRAWN, experiment.assurance.num_cases)
    campaign = Campaign(
        experiment.mission, controller_of_run(experiment, folder), experiment.assurance.workers
    )
    tracks, _ = campaign.tracks(list(_scenarios(experiment, num_cases)))
    return tube_drawn(experiment, folder, tracks)


def _board(experiment: Experiment, folder: Path, gathered: Mapping[str, Any]) -> str:
    """Return the page that a board signs, with the first cases and the gravest verdict's worst flight."""
    mission, controller = experiment.mission, controller_of_run(experiment, folder)
    num_cases = gathered["conditions"]["num_cases"]
    campaign = Campaign(mission, controller, experiment.assurance.workers)
    deputies = mission.fleet.deputies
    tracks, facts = campaign.tracks(list(_scenarios(experiment, min(MOST_FOLLOWED // deputies, num_cases))))
    flights = flights_of_board(facts, tracks, num_cases)
    made = datetime.now(UTC).date()
    worst = worst_drawn(experiment, folder, gathered)
    return render_board(gathered, controller.systems, flights, worst, made, controller.force_axes)


def _domain(experiment: Experiment, controller: Controller, folder: Path) -> Domain | None:
    """Return the operational domain of a fuzzy controller, and write it for the monitor."""
    # what deputies of a fleet sense depends on what the others tell, which this does not fly
    if not controller.systems or experiment.mission.has_fleet:
        (folder / artifacts.DOMAIN).unlink(missing_ok=True)
        return None
    scenarios = _scenarios(experiment, 2 * experiment.assurance.domain_cases)
    domain = domain_of(experiment, controller, scenarios, CONFIDENCE)
    writing.write_json(folder / artifacts.DOMAIN, as_mapping(domain.boxes))
    return domain


def _write(folder: Path, name: str, table: Mapping[str, Any]) -> None:
    """Write a table, unless it is empty."""
    if table:
        tables.write_parquet(folder / name, table)
    else:
        (folder / name).unlink(missing_ok=True)


def _subject(experiment: Experiment, folder: Path, controller: Controller) -> dict[str, Any]:
    """Return whom the evidence is about, and under which conditions."""
    return {
        "controller": {"name": controller.name, "sha256": sha256_of(controller)},
        "conditions": conditions_of(experiment, configuration.read(folder)),
    }


def _provenance(
    experiment: Experiment, folder: Path, controller: Controller, requirements: Requirements
) -> dict[str, Any]:
    """Return the subject and the sources of the evidence."""
    gathered = f"{artifacts.ASSURANCE}/", f"{Path(artifacts.THEOREM).parent}/"
    files = [name for name in artifacts.list_artifacts(folder) if name.startswith(gathered)]
    excluded = artifacts.EVIDENCE, artifacts.LEDGER, artifacts.EVIDENCE_PAGE, artifacts.BOARD_PAGE
    config = configuration.read(folder)
    return {
        "schema": evidence.SCHEMA,
        "schema_version": evidence.SCHEMA_VERSION,
        "name": requirements.name,
        **_subject(experiment, folder, controller),
        "config_hash": configuration.config_hash(config),
        **maker.present_maker(),
        "sha256": {name: artifacts.file_hash(folder / name) for name in files if name not in excluded},
    }
