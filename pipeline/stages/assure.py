"""Gather evidence for requirements: flights, searches, proofs and a page of the results: assure/."""

import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.analysis.domain import as_mapping
from fis_tools.formats.serialize import fingerprint
from pipeline.controllers.source import controller_of_run, sha256_of
from pipeline.evaluation import sequential
from pipeline.evaluation.assurance import evidence, repeats
from pipeline.evaluation.assurance.campaign import (
    MET,
    Campaign,
    FormulaResult,
    WorstCaseSearch,
    evaluate_each,
    search,
    search_efficiency,
)
from pipeline.evaluation.assurance.case_space import case_space
from pipeline.evaluation.assurance.certificates import certificates, check_questions
from pipeline.evaluation.assurance.conditions import box_in_words, conditions_of, start_bounds
from pipeline.evaluation.assurance.evidence import Domain, domain_of, left_on
from pipeline.evaluation.assurance.formula import (
    COASTING_PAIR,
    OF_COASTING,
    kind_of,
    predicates,
    quantities_of,
)
from pipeline.evaluation.assurance.judgements import cases_needed, failures_allowed, judge
from pipeline.evaluation.assurance.proofs import safety_proof
from pipeline.evaluation.assurance.quantities import track_of, tracks_of
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
from pipeline.evaluation.assurance.sentences import ordinal
from pipeline.evaluation.assurance.tube import TubeProof
from pipeline.evaluation.assurance.verdicts import Evidence, percent
from pipeline.evaluation.splitting import POPULATIONS, RareShare, rare_share
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.proof.apart import check_apart, is_installed
from pipeline.proof.verdict import NotProvable, theorem_of
from pipeline.recording.recorder import FlightRecorder
from pipeline.report.board import gravest, render_board
from pipeline.report.board_flights import MOST_FOLLOWED, flights_of_board
from pipeline.report.evidence import number as written
from pipeline.report.evidence import render_evidence
from pipeline.report.figures.flights import draw_flight, draw_tube
from pipeline.report.figures.style import Illustration
from pipeline.report.played import player_of_worst
from pipeline.run import artifacts, configuration, maker, tables, writing
from pipeline.run.engine import TaskPool, open_pool
from pipeline.run.progress import Progress
from pipeline.scenarios import DrawnCases
from pipeline.settings.experiment import Assurance, Experiment, Mission
from plain_files.file_access import read_bytes
from plain_files.plain_text import parse_json
from telemetry.file import reader
from telemetry.file.topics import DEPUTY_CONTROL, DEPUTY_STATE, MISSION

#: what methods are called in words
METHOD_WORDS = {name: name.replace("_", " ") for name in METHODS}
#: of the bound on how many flights leave the operational domain
CONFIDENCE = 0.9
#: of a theorem
MOST_BYTES = 1024**2
#: flights in the picture of a tube
MOST_DRAWN = 100
#: what single precision of a track amounts to after a day of free motion
MOST_COASTED_OFF_M = 0.05

#: a margin, its unit (empty: the formula's), the case that has it, and where it was found
Worst = tuple[float, str, Scenario, str]


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
        tube = _tube(experiment, controller, folder) if TUBE in requirement.verified_by else None
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
            worst = _worst_of(collected, scenarios, outcome)
            recorded = _record_worst(folder, mission, recorder, domain, requirement, worst)
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


def _tube(experiment: Experiment, controller: Controller, folder: Path) -> TubeProof:
    """Return the result of the stage prove in this run, if it is about these flights."""
    if not (folder / artifacts.THEOREM).exists() or controller.fuzzy is None:
        return TubeProof("no proof of these rules is in this run; add the stage prove before assure")
    try:
        written = _theorem(folder)
    except (OSError, ValueError, RecursionError):
        return TubeProof(f"{artifacts.THEOREM} cannot be read; repeat the stage prove")
    try:
        theorem = theorem_of(experiment)
    except NotProvable as error:
        return TubeProof(str(error))
    wanted = {**json.loads(json.dumps(asdict(theorem))), "controller_sha256": fingerprint(controller.fuzzy)}
    if not isinstance(written, dict) or any(written.get(name) != value for name, value in wanted.items()):
        return TubeProof(f"{artifacts.THEOREM} is of other flights; repeat the stage prove")
    fault, is_checked = f"not proved: {written.get('fault')}", False
    if not written.get("fault"):
        fault, is_checked = _check(folder, written)
    if fault:
        return TubeProof(fault)
    return TubeProof(
        fault="",
        is_checked=is_checked,
        starts=f"every start with {box_in_words(theorem.start_low, theorem.start_high)}",
        model=(
            f"motion by Clohessy and Wiltshire's equations, n = {theorem.mean_motion_rad_s:g} rad/s, "
            f"{theorem.mass_kg:g} kg, at most {theorem.max_force_n:g} N on each axis, decided every "
            f"{theorem.period_s:g} s, without any error"
        ),
        end_s=written["num_periods"] * theorem.period_s,
        limit=theorem.limit,
        goal=theorem.goal,
    )


def _theorem(folder: Path) -> Any:
    return parse_json(read_bytes(folder / artifacts.THEOREM, MOST_BYTES))


def _check(folder: Path, written: Mapping[str, Any]) -> tuple[str, bool]:
    """Return why a run's certificate proves nothing, if so, and whether the checker has checked it."""
    count = written.get("num_periods")
    if not isinstance(count, int) or count < 1:
        return f"{artifacts.THEOREM} has no number of control periods; repeat the stage prove", False
    if not is_installed():
        return "", False
    sys.stderr.write("  checking the proof\n")
    if refusal := check_apart(folder):
        return f"the checker refuses the proof in this run ({refusal}); repeat the stage prove", False
    if _theorem(folder) != written:
        return f"{artifacts.THEOREM} was changed while it was checked; repeat the stage prove", False
    return "", True


def _tube_drawn(
    experiment: Experiment, folder: Path, entries: Sequence[Mapping[str, Any]]
) -> Illustration | None:
    """Draw the tube of the proof that a requirement rests on, over the first cases."""
    if not any("tube" in entry and entry["tube"]["is_checked"] for entry in entries):
        return None
    mission, num_cases = experiment.mission, min(MOST_DRAWN, experiment.assurance.num_cases)
    campaign = Campaign(mission, controller_of_run(experiment, folder), experiment.assurance.workers)
    tracks, _ = campaign.tracks(list(_scenarios(experiment, num_cases)))
    boxes = tables.read_parquet(folder, artifacts.TUBE)
    return draw_tube(boxes, tracks, mission, experiment.report.dots_per_inch)


def _board(experiment: Experiment, folder: Path, gathered: Mapping[str, Any]) -> str:
    """Return the page that a board signs, with the first cases and the gravest verdict's worst flight."""
    mission, controller = experiment.mission, controller_of_run(experiment, folder)
    num_cases = gathered["conditions"]["num_cases"]
    campaign = Campaign(mission, controller, experiment.assurance.workers)
    deputies = mission.fleet.deputies
    tracks, _ = campaign.tracks(list(_scenarios(experiment, min(MOST_FOLLOWED // deputies, num_cases))))
    flights = flights_of_board(mission, tracks, num_cases)
    made = datetime.now(UTC).date()
    worst = _worst_drawn(experiment, folder, gathered)
    return render_board(gathered, controller.systems, flights, worst, made, controller.force_axes)


def _worst_drawn(
    experiment: Experiment, folder: Path, gathered: Mapping[str, Any]
) -> tuple[str, Illustration] | None:
    """Return the recorded flight that fails the gravest open requirement most, in words and drawn."""
    requirement = gravest(gathered["requirements"])
    if requirement is None:
        return None
    worst, mission = requirement["worst"], experiment.mission
    recording = reader.read(folder / worst["recording"], (DEPUTY_CONTROL, DEPUTY_STATE, MISSION))
    (track, *_), facts = track_of(recording, mission)
    name = f"{requirement['id']} {requirement['title']}"
    words = (
        f"{name}: {worst['found_by']} has the least margin that is known, "
        f"{written(worst['margin'])} {worst['unit']}".rstrip()
        + f" ({worst['recording']})."
    )
    return words, draw_flight(track, facts.number, mission, experiment.report.dots_per_inch)


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


def _worst_of(evidence: Evidence, scenarios: Sequence[Scenario], outcome: FormulaResult) -> Worst:
    """Return the worst known case of a requirement, at random or by a search."""
    case = int(np.argmin(outcome.margins))
    known = [(*outcome.worst, scenarios[case], f"case {case}")]
    for number, searched in enumerate(evidence.searches):
        source = f"{ordinal(number + 1)} search, flight {searched.worst}"
        known.append((*searched.outcome.worst, searched.scenarios[searched.worst], source))
    return min(known, key=lambda worst: worst[0])


def _record_worst(
    folder: Path,
    mission: Mission,
    recorder: FlightRecorder,
    domain: Domain | None,
    requirement: Requirement,
    worst: Worst,
) -> dict[str, Any]:
    """Fly the worst known case of a requirement again, logged; record it, and evaluate the recording."""
    controller, (margin, unit, scenario, source) = recorder.controller, worst
    names, logs = _recorded(folder, mission, recorder, requirement, scenario)
    assert requirement.formula is not None  # noqa: S101 - flown ones have one
    recordings = [reader.read(folder / name, (DEPUTY_CONTROL, DEPUTY_STATE, MISSION)) for name in names]
    tracks, facts = tracks_of(recordings, mission)
    again = evaluate_each(tracks, facts, {requirement.id: requirement.formula}, mission.control_period_s)
    margins = again[requirement.id].margins
    deputy = int(np.argmin(margins))
    recorded, path, start = float(margins[deputy]), folder / names[deputy], scenario.fleet[deputy]
    # tracks have single precision: the larger the numbers compared, the larger the error of the margin
    largest = max(abs(predicate.constant) for predicate in predicates(requirement.formula)) + abs(margin)
    looking_ahead = *OF_COASTING, COASTING_PAIR
    coasts = any(kind_of(name) in looking_ahead for name in quantities_of(requirement.formula))
    if not abs(recorded - margin) <= (MOST_COASTED_OFF_M if coasts else max(1e-5, 1e-6 * largest)):
        raise artifacts.ArtifactError(
            f"{path} has a margin of {recorded:g}, but {source} was found with {margin:g}; the flight is "
            "not the one that was found: report this"
        )
    left = left_on(domain, logs[deputy], controller, mission.control_period_s) if domain else ()
    of_fleet = {"deputy": deputy + 1, "recordings": names} if mission.has_fleet else {}
    return {
        "found_by": source,
        **of_fleet,
        "position_m": start.position_m.tolist(),
        "velocity_m_s": start.velocity_m_s.tolist(),
        "sun_angle_rad": float(scenario.sun_angle_rad),
        "sun_elevation_rad": float(scenario.sun_elevation_rad),
        "settings": dict(drawn(mission, scenario)),
        "margin": margin,
        "unit": unit or requirement.unit,
        "recorded_margin": recorded,
        "recording": names[deputy],
        "left_domain": [asdict(departure) for departure in left],
    }


def _recorded(
    folder: Path, mission: Mission, recorder: FlightRecorder, requirement: Requirement, scenario: Scenario
) -> tuple[list[str], list[FlightLog]]:
    """Fly a requirement's worst case and record it, of a fleet each deputy; return the files and logs."""
    controller, name = recorder.controller, f"{requirement.id}-worst"
    (folder / artifacts.WORST_FLIGHTS).mkdir(parents=True, exist_ok=True)
    if not mission.has_fleet:
        log, file = fly_logged(mission, controller, scenario), f"{artifacts.WORST_FLIGHTS}/{name}.mcap"
        recorder.record(folder / file, scenario, log, name)
        return [file], [log]
    fleet = fly_logged_fleet(mission, controller, scenario)
    files = [f"{artifacts.WORST_FLIGHTS}/{name}-deputy-{each.deputy}.mcap" for each in fleet]
    for file, each, start in zip(files, fleet, scenario.fleet, strict=True):
        recorder.record(folder / file, start, each.flight, name, each)
    return files, [each.flight for each in fleet]


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
