"""The page that a board signs: verdicts, flights, rules, what is not covered, on two printed sheets."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from fis_tools.analysis import arrays
from fis_tools.model import FuzzySystem, Variable, conjunctions, peak
from fis_tools.words.text import sentence
from pipeline.evaluation.assurance.evidence import joint_words
from pipeline.evaluation.assurance.judgements import ORDER
from pipeline.evaluation.assurance.repeats import repeats_in_words
from pipeline.evaluation.assurance.requirements import SEVERITIES
from pipeline.report import board_flights
from pipeline.report.board_flights import BoardFlights, draw_distances, farthest_limit, limits_of
from pipeline.report.evidence import css, factors, number, proved_by
from pipeline.report.figures.style import Illustration, caption_of
from pipeline.settings.keys import unit_of
from pipeline.settings.schema import as_yaml
from plain_files.document.html import policy, read, template

#: more rules do not stand on a sheet
MOST_RULES = 60
#: factors of credibility of which the page says what this run does not show
TOLD_FACTORS = ("validation", "input pedigree", "uncertainty characterization", "results robustness")
SIGNATURES = (
    ("controller", "the rules"),
    ("requirements", "the claims and their limits"),
    ("evidence", "verdicts, and what is not covered"),
)
DECISIONS = ("accepted", "accepted for the conditions on sheet 1, with the limits written here", "rejected")
#: what forces along Hill's axes are in words
PUSHES = {
    "force_x": "push up (+) or down (−)",
    "force_y": "push ahead (+) or back (−)",
    "force_z": "push north (+) or south (−)",
}
#: how the deputy moves, by `dynamics.model`
MOTION = {"cw": "by Clohessy and Wiltshire's equations", "two_body": "of two bodies about the planet"}
#: letters of a hash that tell it from others at a glance
SHORT = 16


class Cell(NamedTuple):
    """A rule of a grid: its number, its term, the output at its values, and how strong that is, 0 to 4."""

    number: int
    term: str
    value: str
    sign: str
    strength: int


class Grid(NamedTuple):
    """The rules of a system with two inputs."""

    title: str
    unit: str
    down: Variable
    across: Variable
    heads: list[tuple[str, str]]
    rows: list[tuple[tuple[str, str], list[Cell]]]


def render_board(
    evidence: Mapping[str, Any],
    systems: Sequence[FuzzySystem],
    flights: BoardFlights,
    worst: tuple[str, Illustration] | None,
    made: date,
    force_axes: str = "",
) -> str:
    """Render the page; it runs no script.

    Parameters
    ----------
    evidence : mapping
        As the stage assure gathers it.
    systems : sequence of FuzzySystem
        Of the controller, whose rules are printed; none without rules.
    flights : BoardFlights
        Of the first cases.
    worst : tuple of str and Illustration, optional
        What the worst flight fails or comes nearest to failing, and its picture.
    made : date
        When the evidence was gathered.
    force_axes : str
        Of forces that rules command, see `fis_tools.model.thrust`.
    """
    requirements, limits = evidence["requirements"], limits_of(evidence["requirements"])
    of_documents = (read("style.css"), read("page.css"))
    for_board = (read(f"templates/{name}.css", "pipeline.report") for name in ("evidence", "board"))
    style = Markup("".join((*of_documents, *for_board)))  # noqa: S704 - of our packages
    caveats = joint_words(evidence["joint"]), repeats_in_words(evidence)
    return template("pipeline.report", "templates", "board.html").render(
        title=f"{evidence['controller']['name']}: for the board",
        policy=policy(style if worst is None else ""),
        style=style,
        hashes=[(name, full) for name, _, full in _conditions(evidence, made) if full],
        lead=lead(requirements),
        caveats=[words for words in caveats if words],
        conditions=list(_conditions(evidence, made)),
        rows=[_row(requirement) for requirement in requirements],
        num_cases=evidence["conditions"]["num_cases"],
        drawing=draw_distances(flights, limits),
        drawing_words=board_flights.in_words(flights, limits),
        worst=worst,
        num_rules=_count(systems),
        grids=[grid_of(system, force_axes) for system in systems] if _count(systems) <= MOST_RULES else [],
        rules=list(_rules(systems)),
        uncovered=list(_uncovered(evidence, flights)),
        signatures=SIGNATURES,
        decisions=DECISIONS,
        settings=[
            f"{key}: {as_yaml(value)} {unit_of(key).symbol}".strip()
            for key, value in evidence["conditions"]["settings"].items()
        ],
    )


def lead(requirements: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Return how many verdicts are open, in a sentence, and which requirements are not shown."""
    counts, total = Counter(requirement["verdict"] for requirement in requirements), len(requirements)
    num_open = total - counts["shown"]
    shown = f"{counts['shown']} of {total} requirements {'is' if counts['shown'] == 1 else 'are'} shown"
    first = f"{shown}, {num_open} {'is' if num_open == 1 else 'are'} not."
    if not num_open:
        first = f"All {total} requirements are shown."
    rest = []
    for verdict in reversed(ORDER):
        names = [f"{r['id']} {r['title']}" for r in requirements if r["verdict"] == verdict]
        if names and verdict != "shown":
            rest.append(f"{verdict[0].upper()}{verdict[1:]}: {', '.join(names)}.")
    if not counts["refuted"]:
        rest.append("None is refuted.")
    return first, " ".join(rest)


def gravest(requirements: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the requirement whose worst flight is shown: of the worst verdict, then the gravest."""
    flown = [requirement for requirement in requirements if requirement.get("worst")]
    ranked = sorted(
        flown, key=lambda each: (-ORDER.index(each["verdict"]), SEVERITIES.index(each["severity"]))
    )
    return ranked[0] if ranked else None


def _conditions(evidence: Mapping[str, Any], made: date) -> Iterator[tuple[str, str, str]]:
    """Yield what was judged, under which conditions and by what: names, words, and words in full."""
    controller, conditions = evidence["controller"], evidence["conditions"]
    sha256, revision = controller["sha256"], evidence["git_revision"]
    yield "controller", controller["name"], ""
    yield "its SHA-256", f"{sha256[:SHORT]}…" if sha256 else "none: neither fuzzy nor learned", sha256 or ""
    yield "requirements", evidence["name"], ""
    product = evidence["versions"].get("product", "unknown")
    yield "software", f"{product}, revision {revision[:12] if revision else 'unknown'}", revision or ""
    yield "sources", f"{evidence['sources'][:SHORT]}…", evidence["sources"]
    yield "configuration", f"{evidence['config_hash'][:SHORT]}…", evidence["config_hash"]
    yield "evidence made", f"{made.day} {made:%B %Y}", ""
    processor = evidence["processor"]
    yield "processor", f"{processor['compiled_for']}, {processor['libm']}", ""
    yield "cases", f"{conditions['num_cases']:,}, seed {conditions['seed']}", ""
    yield "starts", conditions["starts"], ""
    yield "the Sun", conditions["sun"] or "not asked for", ""
    yield "safety layer", "off" if conditions["safety"] == "none" else conditions["safety"], ""
    yield "navigation, thrusters", f"{conditions['navigation']}, {conditions['thrusters']}", ""
    drawn = ", ".join(conditions["dispersed"]) or "nothing"
    yield "dispersed", drawn, ""
    yield "motion", MOTION.get(conditions["dynamics"], conditions["dynamics"]), ""
    period = f"every {conditions['sample_period_s']:g} s"
    yield "flights", f"{conditions['duration_s']:,g} s, sampled {period}", ""


def _row(requirement: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of the verdicts."""
    cases, worst = requirement.get("cases"), requirement.get("worst")
    flown = "not flown"
    if cases:
        flown = f"{cases['num_failed']:,} of {cases['num_cases']:,} fail"
        if not proved_by(requirement):
            allowed = cases["num_allowed"]
            flown += f"; {allowed:,} allowed" if allowed >= 0 else f"; {cases['num_cases']:,} are too few"
    sign = "+" if worst and worst["margin"] > 0.0 else ""
    margin = f"{sign}{number(worst['margin'])} {worst['unit']}".strip() if worst else ""
    return {
        "id": requirement["id"],
        "title": requirement["title"],
        "stake": f"{requirement['severity']}: {requirement['consequence']}",
        "claim": requirement["text"].rstrip("."),
        "verdict": requirement["verdict"],
        "css": css(requirement["verdict"]),
        "share": requirement["share"],
        "flown": flown,
        "margin": margin,
        "found_by": worst["found_by"] if worst else "",
    }


def _count(systems: Sequence[FuzzySystem]) -> int:
    return sum(len(system.rules) for system in systems)


def grid_of(system: FuzzySystem, force_axes: str = "") -> Grid | None:
    """Return the rules of a system of two inputs as a grid; None where they are none.

    A force is that at the rule's own values, where it fires alone or most strongly.
    """
    rules = conjunctions(system) if len(system.inputs) == 2 and not system.weighed else None
    if rules is None:
        return None
    cells, consequents = rules
    down, across = system.inputs
    shape = len(down.terms), len(across.terms)
    if sorted(map(tuple, cells.tolist())) != [(i, j) for i in range(shape[0]) for j in range(shape[1])]:
        return None
    output = system.outputs[0]
    peaks = [[peak(variable, term) for term in variable.terms] for variable in system.inputs]
    points = np.stack(np.meshgrid(*peaks, indexing="ij"), axis=-1).reshape(-1, 2)
    values = arrays.evaluate(system, points)[:, 0].reshape(shape)
    most = float(np.abs(values).max()) or 1.0
    rule_at = {tuple(cell): index for index, cell in enumerate(cells.tolist())}

    def cell(i: int, j: int) -> Cell:
        rule, value = rule_at[i, j], round(float(values[i, j]), 12)
        sign = "plus" if value > 0.0 else "minus" if value < 0.0 else "zero"
        term = output.terms[consequents[rule]].name.replace("_", " ")
        return Cell(rule + 1, term, _signed(value), sign, round(4 * abs(value) / most))

    heads = [
        [(_words(term.name), _signed(at)) for term, at in zip(variable.terms, some, strict=True)]
        for variable, some in zip(system.inputs, peaks, strict=True)
    ]
    rows = [(head, [cell(i, j) for j in range(shape[1])]) for i, head in enumerate(heads[0])]
    means = PUSHES.get(output.name, "") if force_axes == "hill" else output.description
    title = f"{_words(output.name)}: {means}" if means else _words(output.name)
    return Grid(title, output.unit, down, across, heads[1], rows)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _signed(value: float) -> str:
    """Format a number to three digits, with its sign."""
    return f"{value:+.3g}".replace("-", "−") if value else "0"


def _rules(systems: Sequence[FuzzySystem]) -> Iterator[tuple[str, list[str]]]:
    """Yield the rules of each system that is no grid, in words, unless there are too many."""
    if not systems:
        yield "The controller has no rules.", []
    elif _count(systems) > MOST_RULES:
        yield caption_of("too_many_rules", count=_count(systems)), []
    else:
        for system in systems:
            if grid_of(system) is None:
                yield system.name, [sentence(rule) for rule in system.rules]


def _uncovered(evidence: Mapping[str, Any], flights: BoardFlights) -> Iterator[str]:
    """Yield a sentence for each thing that the evidence does not cover."""
    conditions, requirements = evidence["conditions"], evidence["requirements"]
    for requirement in requirements:
        if requirement["verdict"] != "shown":
            yield f"{requirement['id']} {requirement['title']} is {requirement['verdict']}."
        elif requirement["unproved"]:
            yield f"{requirement['id']} {requirement['title']} has no proof, though one was asked for."
    limit = farthest_limit(limits_of(requirements), flights)
    if limit is not None and not any("coasting" in (each["formula"] or "") for each in requirements):
        last = board_flights.TOLD_MIN[-1]
        beyond = f"{flights.percent_beyond(limit.value_m, last):.0f} % of these flights are beyond"
        yield f"What follows the end: without a further push {beyond} {limit.value_m:g} m within {last} min."
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
