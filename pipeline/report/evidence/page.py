"""The page itself: evidence in words, tables and pictures, in one file that needs no other."""

import math
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from fis_tools.document.page import read, source_hash, template
from pipeline.report.evidence import goal_structure, margins
from pipeline.report.evidence.credibility import factors, uncertain
from pipeline.run import artifacts

#: ways of verification, as columns are headed
METHODS = {"cases": "cases", "search": "search", "bounds": "bounds", "safety_layer": "safety layer"}
STYLES = ("report.css", "evidence.css")


def write(evidence: Mapping[str, Any]) -> str:
    """Write the page of what `pipeline.evaluation.assurance.evidence` tells.

    Returns
    -------
    str
        HTML that needs no other file, asks for none, and runs no script.
    """
    style = "\n".join(read(f"templates/{name}", "pipeline.report") for name in STYLES)
    told = {**evidence, "requirements": [_requirement(one) for one in evidence["requirements"]]}
    return template("pipeline.report", "templates", "evidence.html").render(
        told,
        artifacts=artifacts,
        methods=METHODS,
        css_of=goal_structure.css_of,
        lead=lead(evidence),
        uncertain=[word for word in uncertain(evidence["conditions"]) if word != "Sun"],
        drawing=goal_structure.draw(evidence),
        domain_words=domain_words(evidence["domain"]) if evidence["domain"] else "",
        factors=factors(evidence),
        provenance=_provenance(evidence),
        style=Markup(style),  # noqa: S704 - files of this package
        style_hash=source_hash(style),
    )


def lead(evidence: Mapping[str, Any]) -> str:
    """Say in two sentences what came out."""
    requirements = evidence["requirements"]
    named = {
        word: [one["id"] for one in requirements if one["verdict"] == word]
        for word in ("shown", "not shown", "refuted")
    }
    verb = {True: "is", False: "are"}
    parts = [f"{', '.join(ids)} {verb[len(ids) == 1]} {word}" for word, ids in named.items() if ids]
    failing = [one for one in requirements if one["verdict"] == "refuted"]
    because = " ".join(f"{one['id']}: {one['why']}." for one in failing)
    return f"Of {len(requirements)} requirements {'; '.join(parts)}. {because}".strip()


def domain_words(domain: Mapping[str, Any]) -> str:
    """Say how the domain was made and how far it can be trusted."""
    return (
        f"The box of inputs that {domain['num_made_from']:,} flights met. Of {domain['num_tried']:,} other "
        f"flights from the same starts' distribution {domain['num_left']:,} leave it; with "
        f"{_percent(domain['confidence'])} confidence no more than {_percent(domain['high'])} of such "
        "flights do. What the controller does outside is not covered."
    )


def _requirement(told: Mapping[str, Any]) -> dict[str, Any]:
    """Add what the page says of a requirement to what is known of it."""
    unit = told["unit"]
    found: dict[str, Any] = {"bounds": [], "worst": None, "departures": [], **told}
    found["claim"], found["brief"] = _claim(told), {"safety_layer": ""}
    if "cases" in told:
        cases = told["cases"]
        found["case_facts"] = _case_facts(cases, unit)
        found["margins"] = margins.draw(cases["histogram"], unit, told["id"])
        found["brief"]["cases"] = f"{cases['num_failed']:,} of {cases['num_cases']:,} fail"
    if "search" in told:
        search = told["search"]
        found["search_facts"] = _search_facts(search, unit)
        found["brief"]["search"] = f"by {search['num_found']} of {search['num_searches']} searches"
    boxes = sum(part["num_boxes"] for part in found["bounds"])
    found["brief"]["bounds"] = f"{boxes:,} boxes"
    if "worst" in told:
        found["worst_facts"] = _worst_facts(told["worst"], unit)
        found["departures"] = [_departure(one) for one in told["worst"]["left_domain"]]
    return found


def _claim(told: Mapping[str, Any]) -> str:
    if not told["probability"]:
        return "for all inputs" if "bounds" in told["verified_by"] else "for all flights"
    return f"{_percent(told['probability'])} of the cases, {_percent(told['confidence'])} confidence"


def _case_facts(cases: Mapping[str, Any], unit: str) -> list[tuple[str, str]]:
    few = "too few cases"
    allowed, margin = cases["num_allowed"], cases["margin"]
    return [
        ("flown", f"{cases['num_cases']:,}"),
        ("failed", f"{cases['num_failed']:,}"),
        ("failures with which it is shown", f"at most {allowed:,}" if allowed >= 0 else few),
        ("cases needed without a failure", f"{cases['needed_without_failure']:,}"),
        ("share that meets it, one-sided bounds", f"{_percent(cases['low'])} to {_percent(cases['high'])}"),
        (
            "margin, at the claim's share and confidence",
            few if margin is None else f"at least {_quantity(margin, unit)}",
        ),
        ("median margin", _quantity(cases["median_margin"], unit)),
        ("worst margin", _quantity(cases["worst_margin"], unit)),
    ]


def _search_facts(search: Mapping[str, Any], unit: str) -> list[tuple[str, str]]:
    none = "none found"
    found, at_random = search["flights_per_find"], search["random_flights_per_find"]
    ratio = search["ratio"]
    return [
        ("flights of all searches", f"{search['num_flights']:,}"),
        ("flights for each failure found", none if found is None else f"{found:,.0f}"),
        ("flights at random for each failure", none if at_random is None else f"{at_random:,.0f}"),
        ("faster than at random", "no ratio" if ratio is None else f"{ratio:.1f} times"),
        ("worst margin found", _quantity(search["worst_margin"], unit)),
        ("worst margin at random", _quantity(search["random_worst_margin"], unit)),
    ]


def _worst_facts(worst: Mapping[str, Any], unit: str) -> list[tuple[str, str]]:
    start = ", ".join(f"{value:.3f}" for value in worst["position_m"]).replace("-", "−")
    left = len(worst["left_domain"])
    return [
        ("found by", worst["found_by"]),
        ("margin", _quantity(worst["margin"], unit)),
        ("margin of the recording, read back", _quantity(worst["recorded_margin"], unit)),
        ("start, Hill axes", f"({start}) m"),
        ("Sun at the start", _sun(worst)),
        *((key, f"{value:.6g}") for key, value in worst["settings"].items()),
        ("left the operational domain", "never" if not left else "once" if left == 1 else f"{left} times"),
    ]


def _sun(worst: Mapping[str, Any]) -> str:
    angle, elevation = math.degrees(worst["sun_angle_rad"]), math.degrees(worst["sun_elevation_rad"])
    over = f", {elevation:.2f}° over the orbit plane" if elevation else ""
    return f"{angle:.2f}°{over}".replace("-", "−")


def _departure(left: Mapping[str, Any]) -> str:
    unit = f" {left['unit']}" if left["unit"] else ""
    return (
        f"{left['system']} senses {left['name']} up to {left['value']:.4g}{unit} from {left['first_s']:g} to "
        f"{left['last_s']:g} s, outside {left['low']:.4g} to {left['high']:.4g}{unit}"
    )


def _provenance(evidence: Mapping[str, Any]) -> list[tuple[str, str]]:
    controller = evidence["controller"]
    return [
        ("controller", controller["name"]),
        ("controller, SHA-256", controller["sha256"] or "neither fuzzy nor learned"),
        ("configuration, SHA-256", evidence["config_hash"]),
        ("revision of the sources", evidence["git_revision"] or "not in a repository"),
        ("sources, SHA-256", evidence["sources"]),
        ("compiled for", evidence["processor"]["compiled_for"]),
    ]


def _quantity(value: float, unit: str) -> str:
    """Write a margin with its unit and a true minus sign."""
    return f"{value:.4g} {unit if unit != 'mixed' else '(of several units)'}".strip().replace("-", "−")


def _percent(share: float) -> str:
    """Write a share in per cent; near one its distance from one has digits too."""
    return f"{100.0 * share:.5g} %" if share > 0.9 else f"{100.0 * share:.3g} %"
