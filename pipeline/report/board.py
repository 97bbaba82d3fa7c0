"""The page that a board signs: verdicts, a flight, the rules, what is not covered, on two printed sheets."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fis_tools.document import Block, Document, Heading, Items, Mark, Paragraph, Table
from fis_tools.document.html import page, read
from fis_tools.model import FuzzySystem
from fis_tools.words.text import sentence
from pipeline.evaluation.assurance.evidence import joint_words
from pipeline.evaluation.assurance.repeats import repeats_in_words
from pipeline.report.evidence import css, factors, proved_by, run_in_words
from pipeline.report.figures.style import Illustration, caption_of

#: more rules do not stand on a sheet
MOST_RULES = 60
#: factors of credibility of which the page says what this run does not show
TOLD_FACTORS = ("validation", "input pedigree", "uncertainty characterization", "results robustness")
SIGNATURES = ("controller", "requirements", "evidence")


def render_board(evidence: Mapping[str, Any], systems: Sequence[FuzzySystem], flight: Illustration) -> str:
    """Render the page.

    Parameters
    ----------
    evidence : mapping
        As the stage assure gathers it.
    systems : sequence of FuzzySystem
        Of the controller, whose rules are printed; none without rules.
    flight : Illustration
        A flight of the run.
    """
    style = read("templates/evidence.css", "pipeline.report") + read("templates/board.css", "pipeline.report")
    return page(_document(evidence, systems, flight), style)


def _document(evidence: Mapping[str, Any], systems: Sequence[FuzzySystem], flight: Illustration) -> Document:
    """Return the page for the board: verdicts, a flight, the rules, what is not covered, signatures."""
    controller = evidence["controller"]
    identity = f"Controller SHA-256 {controller['sha256']}. " if controller["sha256"] else ""
    blocks: list[Block] = [
        Heading(f"{controller['name']}: for the board", 1),
        Paragraph(f"{run_in_words(evidence)} {identity}Configuration SHA-256 {evidence['config_hash']}."),
        Heading("Verdicts", id="verdicts"),
        _verdicts(evidence["requirements"]),
    ]
    caveats = joint_words(evidence["joint"]), repeats_in_words(evidence)
    blocks += [Paragraph(words) for words in caveats if words]
    blocks += [Heading("One flight", id="flight"), flight.block]
    blocks += [Heading(f"The {_count(systems)} rules" if systems else "Rules", id="rules"), *_rules(systems)]
    blocks += [Heading("Not covered", id="uncovered"), Items(list(_uncovered(evidence)))]
    rows = [[what, "", "", ""] for what in SIGNATURES]
    signed = Table(["read and accepted", "name", "date", "signature"], rows)
    return Document([*blocks, Heading("Signatures", id="signatures"), signed])


def _verdicts(requirements: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the requirements and their verdicts."""
    rows = [
        [
            f"{requirement['id']} {requirement['title']} ({requirement['severity']})",
            Mark(requirement["verdict"], css(requirement["verdict"])),
            requirement["sentence"],
        ]
        for requirement in requirements
    ]
    return Table(["requirement", "verdict", "in words"], rows)


def _count(systems: Sequence[FuzzySystem]) -> int:
    return sum(len(system.rules) for system in systems)


def _rules(systems: Sequence[FuzzySystem]) -> Iterator[Block]:
    """Yield the rules of each system in words, unless there are too many."""
    if not systems:
        yield Paragraph("The controller has no rules.")
    elif _count(systems) > MOST_RULES:
        yield Paragraph(caption_of("too_many_rules", count=_count(systems)))
    else:
        for system in systems:
            yield Heading(system.name, 3)
            yield Items([f"{number}. {sentence(rule)}" for number, rule in enumerate(system.rules, 1)])


def _uncovered(evidence: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each thing that the evidence does not cover."""
    conditions, requirements = evidence["conditions"], evidence["requirements"]
    for requirement in requirements:
        if requirement["verdict"] != "shown":
            yield f"{requirement['id']} {requirement['title']} is {requirement['verdict']}."
        elif requirement["unproved"]:
            yield f"{requirement['id']} {requirement['title']} has no proof, though one was asked for."
    sun = f", the Sun other than {conditions['sun']}" if conditions["sun"] == "fixed" else ""
    longer = f"Flights longer than {conditions['duration_s']:,g} s"
    yield f"{longer}, starts other than {conditions['starts']}{sun}."
    if any("at samples" in requirement["reach"] for requirement in requirements):
        period = f"{conditions['sample_period_s']:g} s apart"
        yield f"What happens between samples, {period}, where a claim is at samples."
    domain = evidence["domain"]
    if domain and not all(proved_by(requirement) for requirement in requirements):
        left = f"{domain['num_left']:,} of {domain['num_tried']:,} fresh flights left it"
        yield f"Inputs outside the operational domain, as far as flights can show ({left})."
    for assumed in _assumed(requirements):
        yield f"Flights in which this does not hold, which a proof assumes: {assumed}."
    for name, _, _, not_shown in factors(evidence):
        if name in TOLD_FACTORS:
            yield f"{name.capitalize()}: {not_shown}."


def _assumed(requirements: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the assumptions of the proofs that show requirements, each once."""
    assumed: dict[str, None] = {}
    for requirement in requirements:
        method = proved_by(requirement)
        if method == "tube":
            assumed[requirement["tube"]["model"]] = None
        elif method == "safety_layer":
            assumed |= dict.fromkeys(requirement["safety_layer"]["assumed"])
    return list(assumed)
