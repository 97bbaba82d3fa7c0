"""The content of a review page, in words and tables: opening, constants, systems, findings."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fis_tools.analysis import arrays, bounds, contribution, shapley
from fis_tools.analysis.measures import Measures
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.engines.interval import NotBounded
from fis_tools.errors import ControllerFileError
from fis_tools.findings.audit import Audit, Finding
from fis_tools.model import FuzzyController, FuzzySystem, Variable, peak
from fis_tools.review.flown import Evaluation, Flight, SensedInputs
from fis_tools.review.proved import RIGHT, proof_in_words
from fis_tools.words import text as wording
from fis_tools.words.text import amount, number
from plain_files.document import Block, Heading, Items, Paragraph, Table
from plain_files.file_access import read_bytes, read_text
from plain_files.plain_text import as_number, parse_json

#: rules that are no table are listed at the top up to so many
FEW_RULES = 12


def lead(controller: FuzzyController) -> str:
    """Describe a controller's purpose, how it acts and what it consists of."""
    purpose = controller.purpose or "No purpose is stated in its file."
    number = sum(len(system.rules) for system in controller.systems)
    outputs = [
        f"{output.name} ({extent(output)})" for system in controller.systems for output in system.outputs
    ]
    systems = len(controller.systems)
    made = f"{number} rules{f' in {systems} systems' if systems > 1 else ''} set {', '.join(outputs)}"
    every = dict(controller.attributes).get("decision_period_s")
    return f"{purpose} {made}{f', every {float(every):g} s' if every else ''}."


def rules(controller: FuzzyController) -> Iterator[Block]:
    """Show the rules of each system with their values, where they fit a table, and what its inputs mean."""
    for system in controller.systems:
        yield Heading(system.name, 3)
        tables = wording.rule_tables(system) if system.inputs and not system.weighed else None
        if tables is not None and len(tables) == 1:
            yield _placed(system, tables[0][1])
        elif len(system.rules) <= FEW_RULES:
            yield Items([f"{line}." for line in wording.sentences(system)])
        else:
            yield Paragraph(f"Its {len(system.rules)} rules fill more than one table: they are below.")


def _placed(system: FuzzySystem, rows: Sequence[Sequence[str]]) -> Table:
    """Return a rule table with the location of each term, and the system's output there."""
    (corner, *_), *lines = rows
    output, last = system.outputs[0], system.inputs[-1]
    peaks = [[peak(variable, term) for term in variable.terms] for variable in system.inputs]
    grid = np.stack(np.meshgrid(*peaks, indexing="ij"), axis=-1).reshape(-1, len(peaks))
    answers = arrays.evaluate(system, grid)[:, 0].reshape(-1, len(last.terms))
    heads = [corner, *(_head(last, index) for index in range(len(last.terms)))]
    down = (
        [_head(system.inputs[0], index) for index in range(len(lines))] if len(peaks) > 1 else [output.name]
    )
    cells = [
        [head, *(f"{term}: {shown(output, value)}" for term, value in zip(line[1:], row, strict=True))]
        for head, line, row in zip(down, lines, answers, strict=True)
    ]
    caption = f"{output.name} where each term holds most; in between it changes gradually."
    return Table(heads, cells, caption=caption)


def _head(variable: Variable, index: int) -> str:
    term = variable.terms[index]
    return f"{term.name}, {shown(variable, peak(variable, term))}"


def inputs(
    controller: FuzzyController, samples: Mapping[str, SensedInputs], flown: Sequence[Flight] = ()
) -> Table:
    """Tabulate what each input means, its range, and the values met."""
    met = "met where fired" if any(flight.num_made is not None for flight in flown) else "met"
    rows = []
    for system in controller.systems:
        some = samples[system.name]
        for index, variable in enumerate(system.inputs):
            values = "unknown: nothing was logged"
            if some.are_flown:
                values = _met(
                    variable, some.inputs[:, index], is_clipped=isfinite(system.limits_of(variable)[0])
                )
            rows.append([variable.name, variable.description or "not described", extent(variable), values])
    return Table(["input", "meaning", "range", met], rows)


def _met(variable: Variable, values: Floats, *, is_clipped: bool) -> str:
    """Describe the values that an input had."""
    low, high = float(values.min()), float(values.max())
    outside = float(np.mean((values < variable.minimum) | (values > variable.maximum)))
    beyond = f"; {wording.percent(outside)} beyond its range" if outside else ""
    beyond += ", clipped to it" if outside and is_clipped else ""
    return f"{shown(variable, low)} to {shown(variable, high)}{beyond}"


def along(flown: Sequence[Flight], noun: str) -> str:
    """Describe the flights that a controller was reviewed along."""
    fires = "A rule fires where its strength is 0.05 or more."
    if not flown:
        return f"No {noun} was given: rules are counted over all inputs alike. {fires}"
    names = ", ".join(
        f"{flight.name} ({flight.num_inferences} inferences"
        f"{'' if flight.num_made is None else f' whose force was fired, of {flight.num_made}'}"
        f"{'' if flight.is_own else '; flown by another controller'})"
        for flight in flown
    )
    sources = f"the {noun} {names}" if len(flown) == 1 else f"{len(flown)} {noun}s: {names}"
    other = " Where another controller flew, this one is asked what it would answer at what was sensed."
    return f"Reviewed along {sources}.{'' if all(flight.is_own for flight in flown) else other} {fires}"


def not_covered(
    evidence: Mapping[str, Any] | None,
    evaluations: Sequence[Evaluation],
    samples: Mapping[str, SensedInputs],
    noun: str,
) -> list[str]:
    """List what the page does not cover."""
    gaps = []
    if evidence is None:
        gaps.append("Requirements: no evidence was given, so that none is judged here.")
    elif domain := evidence.get("domain"):
        gaps.append(
            f"Inputs outside the operational domain: {domain['num_left']:,} of {domain['num_tried']:,} "
            f"fresh flights left what {domain['num_made_from']:,} others had met."
        )
    if evidence and evidence.get("conditions"):
        gaps.append("Other conditions than those of the verdicts.")
    if not any(evaluation.is_own for evaluation in evaluations):
        given = "the evaluation is of another controller" if evaluations else "no evaluation was given"
        is_logged = any(sample_set.are_flown for sample_set in samples.values())
        selected = f" Selected {noun}s are pictures, not statistics." if is_logged else ""
        gaps.append(f"How often it fails: {given}.{selected}")
    if not all(sample_set.are_flown for sample_set in samples.values()):
        gaps.append("Inputs that come together in use: rules are counted over all inputs alike.")
    if noun == "flight" or evidence:
        gaps.append("What happens between decisions, and whether a real system behaves as the simulated one.")
    return gaps


def verdicts(evidence: Mapping[str, Any], rows: Sequence[Sequence[str]]) -> list[Block]:
    """Show the requirements with their verdicts, and the conditions under which these hold."""
    flown = evidence.get("conditions") or {}
    named = ("Sun", "safety", "navigation", "thrusters", "dynamics")
    words = ", ".join(f"{name} {flown[name.lower()]}" for name in named if flown.get(name.lower()))
    caption = f"For flights with {words}. " if words else ""
    caption += f"Checked here: the evidence names this controller by its hash, and {evidence['manifest']}"
    outcome, words = evidence["proof"]
    caption += f"; {words}." if words else "."
    caption += " python -m pipeline verify checks a run."
    title = Heading("Verdicts", id="requirements")
    heads = ["requirement", "verdict", "checked"]
    checked = [_checked(requirement, outcome) for requirement in evidence["requirements"]]
    body = [[*row, check] for row, check in zip(rows, checked, strict=True)]
    return [title, Table(heads, body, caption=caption)]


def _checked(requirement: Mapping[str, Any], outcome: str) -> str:
    """Return what was checked here of a verdict."""
    methods = requirement.get("methods")
    tube = methods.get(BY_PROOF) if isinstance(methods, dict) else None
    if not isinstance(tube, dict) or not tube.get("is_proof") or not outcome:
        return UNCHECKED
    if outcome == RIGHT:
        return "the proof was checked here, and is right; that it proves this is as the file says"
    return "the proof was checked here, and is REFUSED"


def _as_the_manifest_says(path: Path) -> str:
    """Return in words whether evidence is as the manifest of its run says."""
    folder = path.resolve().parent.parent
    name = path.resolve().relative_to(folder).as_posix()
    try:
        written = parse_json(read_text(folder / "manifest.json"))["sha256"].get(name)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return "beside it is no manifest of a run, so that nobody can tell whether it was altered"
    if written != hashlib.sha256(read_bytes(path)).hexdigest():
        return "ALTERED: it is not what the manifest of its run says"
    return "it is as the manifest of its run says"


SCHEMA = "evidence"
#: the method of a requirement that a proof in the run shows
BY_PROOF = "tube"
#: of a verdict that is repeated from a file
UNCHECKED = "as the file says, not checked here"


def read_evidence(path: Path | str, fingerprint: str) -> tuple[dict[str, Any], list[list[str]]]:
    """Return evidence, and of each requirement its name and its verdict in words.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, is no evidence, or is about another controller.
    """
    try:
        content = parse_json(read_text(path))
        if content["schema"] != SCHEMA:
            raise ValueError(content["schema"])
        name, sha256 = (content["controller"].get(key) for key in ("name", "sha256"))
        requirements = [
            [
                " ".join(str(requirement[key]) for key in ("id", "title") if key in requirement),
                str(
                    requirement.get("sentence")
                    or f"{requirement['verdict']}: {requirement['text']} {requirement['why']}"
                ),
            ]
            for requirement in content["requirements"]
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ControllerFileError(
            f"{path} is no evidence that can be read ({error}); give the assure/evidence.json of a run of "
            "+experiment=assure"
        ) from error
    if sha256 != fingerprint:
        raise ControllerFileError(
            f"{path} is about the controller {name!r} with the SHA-256 {sha256}, "
            f"but this one has {fingerprint}; give the evidence of this controller"
        )
    proof = proof_in_words(Path(path).resolve().parent.parent, fingerprint)
    return content | {"manifest": _as_the_manifest_says(Path(path)), "proof": proof}, requirements


#: ends of names that tell a unit
UNITS = {
    "_m_s": "m/s", "_rad_s": "rad/s",
    "_m": "m", "_s": "s", "_n": "N", "_rad": "rad", "_deg": "°", "_kg": "kg",
}  # fmt: skip


class ConstantRow(NamedTuple):
    """A row of the table of constants; texts are empty where nothing is known.

    Attributes
    ----------
    name, value, exact, unit, meaning : str
        The value to four digits and as in the file.
    """

    name: str
    value: str
    exact: str
    unit: str
    meaning: str


def constants(controller: FuzzyController, meanings: Mapping[str, str]) -> list[ConstantRow]:
    """Return a row for each attribute that is a number.

    Parameters
    ----------
    controller : FuzzyController
    meanings : mapping of str to str
        What the attributes mean, with or without a unit after a comma, by their names.
    """
    rows = []
    for name, text in controller.attributes:
        value = as_number(text)
        if value is None:
            continue
        unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
        meaning = meanings.get(name, "").removesuffix(f", {unit}")
        rows.append(ConstantRow(name, f"{value:.4g}", text, unit, meaning))
    return rows


#: cividis (J. R. Nuñez, C. R. Anderton, R. S. Renslow, PLoS ONE 13, 2018) from its lowest to its highest,
#: stated here so that a page is made without matplotlib
BRIGHTNESS = (
    *("#00224e", "#00285b", "#002e6a", "#053371", "#1a386f", "#273e6e", "#32436d", "#3b496c", "#434e6c"),
    *("#4b546c", "#535a6d", "#5a5f6e", "#61656f", "#686a71", "#6f7073", "#767676", "#7d7c78", "#848279"),
    *("#8c8878", "#938e78", "#9b9476", "#a39a74", "#aba072", "#b4a76f", "#bcae6c", "#c4b468", "#cdbb63"),
    *("#d5c25e", "#dec958", "#e7d150", "#f0d846", "#f9e03a", "#fee838"),
)
#: The first of them on which black letters stand out more than white ones.
FIRST_BRIGHT = 15


def level(index: int, count: int) -> int:
    """Return the level in `BRIGHTNESS` of an index among ordered things."""
    last = len(BRIGHTNESS) - 1
    return round((0.08 + 0.9 * (index / (count - 1) if count > 1 else 0.7)) * last)


def level_styles() -> str:
    """Return the rules of a style sheet that give each level its ground and a readable ink."""
    inks = ["#ffffff"] * FIRST_BRIGHT + ["#000000"] * (len(BRIGHTNESS) - FIRST_BRIGHT)
    rules = [
        f".level-{index} {{ background: {colour}; color: {ink}; }}"
        for index, (colour, ink) in enumerate(zip(BRIGHTNESS, inks, strict=True))
    ]
    return "\n".join(rules) + "\n"


def texts(controller: FuzzyController) -> list[tuple[str, str]]:
    """Return the attributes of a controller that are no numbers."""
    return [(name, text) for name, text in controller.attributes if as_number(text) is None]


def facts(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return facts with their keys in words."""
    return [(key.replace("_", " "), value) for key, value in pairs]


def system_words(
    system_number: int, system: FuzzySystem, samples: SensedInputs, measures: Measures
) -> dict[str, Any]:
    """Return the template's words on one system.

    Parameters
    ----------
    system_number : int
        Among the controller's systems, from 1.
    system : FuzzySystem
    samples : SensedInputs
        What its rules are counted over.
    measures : Measures
        What was measured of it.
    """
    compiled = compile(system)
    importance = shapley.importance(compiled, samples.inputs).max(axis=1)
    ranges, unbounded = proved_ranges(system)
    return {
        "id": f"s{system_number}",
        "place": system_number,
        "model": system,
        "samples": samples.words,
        "measures": measures,
        "matrices": wording.rule_tables(system) or (),
        "ranges": ranges,
        "unbounded": unbounded,
        "order": np.argsort(-importance, kind="stable").tolist(),
        "usage": arrays.rule_usage(arrays.firing(system, samples.inputs)),
        "importance": importance,
        "needed": contribution.importance(compiled, samples.inputs).max(axis=1),
    }


def universe_words(variable: Variable) -> str:
    """Describe a variable's universe, and its value when no rule fires."""
    extent = f"{number(variable.minimum)} to {number(variable.maximum)} {variable.unit}".rstrip()
    default = "" if variable.default is None else f"; {number(variable.default)} when no rule fires"
    return f"{extent}, {variable.num_points} points{default}".replace("-", "−")


#: of many rules only so many are linked
MOST_LINKS = 6


def finding_rows(audit: Audit, controller: FuzzyController) -> list[dict[str, Any]]:
    """Return a row for each finding, most serious first.

    A row holds the finding, a key that tells it from the others, the place of its system, links as (words,
    id on the page), and in ``point`` the inputs at which it can be seen, as JSON; empty where there are none.
    """
    numbers = {system.name: system_number for system_number, system in enumerate(controller.systems, start=1)}
    rows = []
    for finding in audit.findings:
        # one about the whole controller stands with the first system
        system_number = numbers.get(finding.system, 1)
        system = controller.systems[system_number - 1]
        about = (finding.system, finding.variable, *finding.terms, *map(str, finding.rules))
        key = "/".join((finding.id, *about))
        point = _point(finding, system)
        links = _links(finding, system, f"s{system_number}") if finding.system in numbers else []
        rows.append({"key": key, "finding": finding, "place": system_number, "links": links, "point": point})
    return rows


def _links(finding: Finding, system: FuzzySystem, system_id: str) -> list[tuple[str, str]]:
    """Return the links of a finding: texts and ids of its variable and rules."""
    links = []
    for kind, variables in (("i", system.inputs), ("o", system.outputs)):
        for index, variable in enumerate(variables, start=1):
            if variable.name == finding.variable:
                links.append((variable.name, f"{system_id}-{kind}{index}"))
    links += [(f"rule {number}", f"{system_id}-r{number}") for number in finding.rules[:MOST_LINKS]]
    return links or [(system.name, system_id)]


def _point(finding: Finding, system: FuzzySystem) -> str:
    """Return the inputs, or some of them, at which a finding can be seen."""
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


#: how near proved and attained ends are brought, as a fraction of the output's range
TOLERANCE = 0.01
#: for each end of each output
MOST_BOXES = 5_000


def proved_ranges(system: FuzzySystem) -> tuple[tuple[bounds.Range, ...], str]:
    """Return the range of each output; none, and why, where they cannot be bounded."""
    try:
        return bounds.output_ranges(system, tolerance=TOLERANCE, max_boxes=MOST_BOXES), ""
    except NotBounded as error:
        return (), str(error)


def extent(variable: Variable) -> str:
    """Describe a variable's declared range."""
    return interval_words(variable, variable.minimum, variable.maximum)


def interval_words(variable: Variable, low: float, high: float) -> str:
    """Describe an interval of a variable's values."""
    return f"{shown(variable, low)} to {shown(variable, high)}"


def point_words(system: FuzzySystem, point: Mapping[str, float]) -> str:
    """Describe a point of the inputs."""
    return ", ".join(f"{name} = {shown(system.variable(name), value)}" for name, value in point.items())


def shown(variable: Variable, value: float) -> str:
    """Format a value with its unit and a minus sign as print has it."""
    return amount(variable, value).replace("-", "−", 1)


#: What the template calls.
CALLED: dict[str, Callable[..., Any]] = {
    **{
        function.__name__: function
        for function in (
            wording.with_unit,
            wording.two_decimals,
            wording.shape_words,
            wording.sentence,
            wording.summary,
            json.dumps,
        )
    },
    **{
        function.__name__: function
        for function in (level, universe_words, extent, interval_words, point_words, shown)
    },
}
