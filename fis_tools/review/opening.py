"""What a review page begins with: what a controller does, verdicts, how it flew, what is not covered."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.analysis import arrays
from fis_tools.array_types import Floats
from fis_tools.document import Block, Heading, Items, Paragraph, Table
from fis_tools.errors import ControllerFileError
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.model.variables import peak
from fis_tools.review.content import extent, shown
from fis_tools.review.flown import Evaluation, Flight, Samples
from fis_tools.words.text import percent, rule_tables, sentences

#: rules that are no table are listed at the top up to so many
FEW_RULES = 12


def lead(controller: FuzzyController) -> str:
    """Say in a few sentences what a controller is for, how it acts and what it consists of."""
    purpose = controller.purpose or "What it is for, nobody has written: its file has no purpose."
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
        tables = rule_tables(system) if system.inputs and not system.weighed else None
        if tables is not None and len(tables) == 1:
            yield _placed(system, tables[0][1])
        elif len(system.rules) <= FEW_RULES:
            yield Items([f"{line}." for line in sentences(system)])
        else:
            yield Paragraph(f"Its {len(system.rules)} rules fill more than one table: they are below.")


def _placed(system: FuzzySystem, rows: Sequence[Sequence[str]]) -> Table:
    """Return a rule table with the place of each term, and what the system answers there."""
    (corner, *_), *lines = rows
    output, last = system.outputs[0], system.inputs[-1]
    places = [[peak(variable, term) for term in variable.terms] for variable in system.inputs]
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, len(places))
    answers = arrays.evaluate(system, grid)[:, 0].reshape(-1, len(last.terms))
    heads = [corner, *(_head(last, place) for place in range(len(last.terms)))]
    down = (
        [_head(system.inputs[0], place) for place in range(len(lines))] if len(places) > 1 else [output.name]
    )
    cells = [
        [head, *(f"{term}: {shown(output, value)}" for term, value in zip(line[1:], row, strict=True))]
        for head, line, row in zip(down, lines, answers, strict=True)
    ]
    caption = f"{output.name} where each term holds most; in between it changes gradually."
    return Table(heads, cells, caption=caption)


def _head(variable: Variable, place: int) -> str:
    term = variable.terms[place]
    return f"{term.name}, {shown(variable, peak(variable, term))}"


def inputs(controller: FuzzyController, samples: Mapping[str, Samples]) -> Table:
    """Say what each input means, in which range it is told apart, and what was met."""
    rows = []
    for system in controller.systems:
        some = samples[system.name]
        for place, variable in enumerate(system.inputs):
            met = _met(variable, some.inputs[:, place]) if some.are_flown else "unknown: nothing was logged"
            rows.append([variable.name, variable.description or "not described", extent(variable), met])
    return Table(["input", "meaning", "range", "met"], rows)


def _met(variable: Variable, values: Floats) -> str:
    low, high = float(values.min()), float(values.max())
    outside = float(np.mean((values < variable.minimum) | (values > variable.maximum)))
    beyond = f"; {percent(outside)} beyond its range, and taken as its end" if outside else ""
    return f"{shown(variable, low)} to {shown(variable, high)}{beyond}"


def flown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[Table]:
    """Show how flights went, those of an evaluation together and each that was recorded."""
    caption = (
        "Means ± standard deviations; 95 % confidence intervals of shares in brackets. Recorded flights are "
        "chosen to be looked at."
    )
    return [Table(heads, rows, caption=caption)] if rows else []


def along(flown: Sequence[Flight], noun: str) -> str:
    """Say along what a controller was reviewed."""
    fires = "A rule fires where its strength is 0.05 or more."
    if not flown:
        return f"No {noun} was given: rules are counted over all inputs alike. {fires}"
    names = ", ".join(
        f"{one.name} ({one.num_inferences} inferences{'' if one.is_own else '; flown by another controller'})"
        for one in flown
    )
    which = f"the {noun} {names}" if len(flown) == 1 else f"{len(flown)} {noun}s: {names}"
    other = " Where another controller flew, this one is asked what it would answer at what was sensed."
    return f"Reviewed along {which}.{'' if all(one.is_own for one in flown) else other} {fires}"


def not_covered(
    evidence: Mapping[str, Any] | None,
    evaluations: Sequence[Evaluation],
    samples: Mapping[str, Samples],
    noun: str,
) -> list[str]:
    """Say what nothing on the page speaks about."""
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
    if not evaluations:
        gaps.append(
            f"How often it fails: no evaluation was given. Selected {noun}s are pictures, not statistics."
        )
    if not all(one.are_flown for one in samples.values()):
        gaps.append("Inputs that come together in use: rules are counted over all inputs alike.")
    gaps.append("What happens between decisions, and whether a real system behaves as the simulated one.")
    return gaps


def verdicts(evidence: Mapping[str, Any], rows: Sequence[Sequence[str]]) -> list[Block]:
    """Show the requirements with their verdicts, and the conditions under which these hold."""
    flown = evidence.get("conditions") or {}
    named = ("Sun", "safety", "navigation", "thrusters", "dynamics")
    words = ", ".join(f"{name} {flown[name.lower()]}" for name in named if name.lower() in flown)
    caption = f"For flights with {words}." if words else ""
    title = Heading("Verdicts", id="requirements")
    return [title, Table(["requirement", "verdict"], rows, caption=caption)]


SCHEMA = "evidence"


def read_evidence(path: Path | str, fingerprint: str) -> tuple[dict[str, Any], list[list[str]]]:
    """Return evidence, and of each requirement its name and its verdict in words.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, is no evidence, or is about another controller.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise ValueError(content["schema"])
        about = content["controller"]
        found = [
            [
                " ".join(str(one[key]) for key in ("id", "title") if key in one),
                str(one.get("sentence") or f"{one['verdict']}: {one['text']} {one['why']}"),
            ]
            for one in content["requirements"]
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ControllerFileError(
            f"{path} is no evidence that can be read ({error}); give the assure/evidence.json of a run of "
            "+experiment=assure"
        ) from error
    if about.get("sha256") != fingerprint:
        raise ControllerFileError(
            f"{path} is about the controller {about.get('name')!r} with the SHA-256 {about.get('sha256')}, "
            f"but this one has {fingerprint}; give the evidence of this controller"
        )
    return content, found
