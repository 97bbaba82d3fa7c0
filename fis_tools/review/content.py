"""What a review page says of a controller and its systems, in words and tables."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fis_tools.analysis import arrays, bounds, contribution, shapley
from fis_tools.analysis.measures import Measures
from fis_tools.engines.compiler import compile
from fis_tools.engines.interval import NotBounded
from fis_tools.findings.audit import Audit, Finding
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.review.flown import Samples
from fis_tools.words.text import amount, number, rule_tables, sentence, shape_words, summary, with_unit

#: ends of names that tell a unit
UNITS = {
    "_m_s": "m/s", "_rad_s": "rad/s",
    "_m": "m", "_s": "s", "_n": "N", "_rad": "rad", "_deg": "°", "_kg": "kg",
}  # fmt: skip


class Constant(NamedTuple):
    """A row of the table; texts are empty where nothing is known.

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


def constants(controller: FuzzyController, meanings: Mapping[str, str]) -> list[Constant]:
    """Return a row for each attribute that is a number.

    Parameters
    ----------
    controller : FuzzyController
    meanings : mapping of str to str
        What the attributes mean, with or without a unit after a comma, by their names.
    """
    found = []
    for name, text in controller.attributes:
        value = number_of(text)
        if value is None:
            continue
        unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
        meaning = meanings.get(name, "").removesuffix(f", {unit}")
        found.append(Constant(name, f"{value:.4g}", text, unit, meaning))
    return found


def number_of(text: str) -> float | None:
    """Return the number that an attribute is, if it is one."""
    try:
        return float(text)
    except ValueError:
        return None


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


def level(place: int, count: int) -> int:
    """Return which of the levels of `BRIGHTNESS` the thing at a place among some ordered things has."""
    last = len(BRIGHTNESS) - 1
    return round((0.08 + 0.9 * (place / (count - 1) if count > 1 else 0.7)) * last)


def level_styles() -> str:
    """Return the rules of a style sheet that give each level its ground and a readable ink."""
    inks = ["#ffffff"] * FIRST_BRIGHT + ["#000000"] * (len(BRIGHTNESS) - FIRST_BRIGHT)
    rules = [
        f".level-{place} {{ background: {colour}; color: {ink}; }}"
        for place, (colour, ink) in enumerate(zip(BRIGHTNESS, inks, strict=True))
    ]
    return "\n".join(rules) + "\n"


def texts(controller: FuzzyController) -> list[tuple[str, str]]:
    """Return the attributes of a controller that are no numbers."""
    return [(name, text) for name, text in controller.attributes if number_of(text) is None]


def facts(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return facts with their keys in words."""
    return [(key.replace("_", " "), value) for key, value in pairs]


def system_words(place: int, system: FuzzySystem, samples: Samples, measures: Measures) -> dict[str, Any]:
    """Return what the template tells of one system.

    Parameters
    ----------
    place : int
        Among the controller's systems, from 1.
    system : FuzzySystem
    samples : Samples
        What its rules are counted over.
    measures : Measures
        What was measured of it.
    """
    compiled = compile(system)
    importance = shapley.importance(compiled, samples.inputs).max(axis=1)
    ranges, unbounded = proved_ranges(system)
    return {
        "id": f"s{place}",
        "place": place,
        "model": system,
        "samples": samples.words,
        "measures": measures,
        "matrices": rule_tables(system) or (),
        "ranges": ranges,
        "unbounded": unbounded,
        "order": np.argsort(-importance, kind="stable").tolist(),
        "usage": arrays.rule_usage(arrays.firing(system, samples.inputs)),
        "importance": importance,
        "needed": contribution.importance(compiled, samples.inputs).max(axis=1),
    }


def universe_words(variable: Variable) -> str:
    """Say what a variable's universe is, and what it is when no rule fires."""
    extent = f"{number(variable.minimum)} to {number(variable.maximum)} {variable.unit}".rstrip()
    default = "" if variable.default is None else f"; {number(variable.default)} when no rule fires"
    return f"{extent}, {variable.num_points} points{default}".replace("-", "−")


#: of many rules only so many are linked
MOST_LINKS = 6


def finding_rows(audit: Audit, controller: FuzzyController) -> list[dict[str, Any]]:
    """Return a row for each finding, the most serious first.

    A row holds the finding, a key that tells it from the others, the place of its system, links as (words,
    id on the page), and in ``point`` the inputs at which it can be seen, as JSON; empty where there are none.
    """
    places = {system.name: place for place, system in enumerate(controller.systems, start=1)}
    rows = []
    for finding in audit.findings:
        # one about the whole controller stands with the first system
        place = places.get(finding.system, 1)
        system = controller.systems[place - 1]
        about = (finding.system, finding.variable, *finding.terms, *map(str, finding.rules))
        rows.append(
            {
                "key": "/".join((finding.id, *about)),
                "finding": finding,
                "place": place,
                "links": _links(finding, system, f"s{place}") if finding.system in places else [],
                "point": _point(finding, system),
            }
        )
    return rows


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
    """Say between which numbers a variable lies, as it is declared."""
    return interval_words(variable, variable.minimum, variable.maximum)


def interval_words(variable: Variable, low: float, high: float) -> str:
    """Say between which numbers values of a variable lie."""
    return f"{shown(variable, low)} to {shown(variable, high)}"


def point_words(system: FuzzySystem, point: Mapping[str, float]) -> str:
    """Say which inputs make up a point."""
    return ", ".join(f"{name} = {shown(system.variable(name), value)}" for name, value in point.items())


def shown(variable: Variable, value: float) -> str:
    """Format a value with its unit and a minus sign as print has it."""
    return amount(variable, value).replace("-", "−", 1)


#: What the template calls.
CALLED: dict[str, Callable[..., Any]] = {
    **{one.__name__: one for one in (with_unit, shape_words, sentence, summary, json.dumps)},
    **{one.__name__: one for one in (level, universe_words, extent, interval_words, point_words, shown)},
}
