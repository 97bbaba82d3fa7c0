"""The page of evidence as a document: verdicts in sentences, the argument, what was found, how credible."""

from collections.abc import Iterator, Mapping
from functools import partial
from math import log
from textwrap import wrap
from typing import Any

import yaml
from markupsafe import Markup

from pipeline.evaluation.assurance.evidence import joint_words
from pipeline.evaluation.assurance.judgements import ORDER
from pipeline.evaluation.assurance.repeats import repeats_in_words
from pipeline.evaluation.assurance.requirements import METHODS as ALL_METHODS
from pipeline.evaluation.assurance.requirements import SEVERITIES
from pipeline.report.facts import sun_at_start
from pipeline.report.figures.style import Illustration, caption_of
from pipeline.run import artifacts, typed
from pipeline.settings.keys import unit_of
from pipeline.settings.schema import as_yaml
from plain_files.document import Block, Code, Document, Figure, Fold, Heading, Items, Mark, Paragraph, Table
from plain_files.document.html import ScriptedPanel, element, page, read, template

#: ways of verification, as circles are lettered and columns are headed
METHODS = {name: name.replace("_", " ") for name in ALL_METHODS}
#: groups of masses, limits and gains, and what is not known of these
DESIGN = {"deputy", "chief", "orbit", "sensor", "attitude"}
OF_PAPER = "they are those of a published problem; none was measured on a spacecraft"
OF_RUN = "they are of the configuration of this run, see provenance; no measurement is known to support them"
#: what a proof covers, whatever flights have met; braces stand for its starts
PROVED_SETS = {
    "tube": "proved from {}",
    "safety_layer": "proved from every start {}, whatever the controller asks for",
    "bounds": "proved for every input that the questions are about",
}
#: of a histogram, in its own units: a number nearer to the zero than this would stand on it
ROOM = 40.0


def render_evidence(
    evidence: Mapping[str, Any], tube: Illustration | None = None, worst: ScriptedPanel | None = None
) -> str:
    """Render the page of the evidence that the stage assure gathers.

    Parameters
    ----------
    evidence : mapping
    tube : Illustration, optional
        Of a proof about all starts.
    worst : ScriptedPanel, optional
        The player of the worst flights; without it the page runs no script.
    """
    shown = document(evidence, tube)
    if worst:
        heading = Heading("The worst flights", id="worst")
        flown = "worst_fleets" if "deputies" in evidence["conditions"] else "worst_flights"
        shown = Document([*shown.blocks, heading, Paragraph(caption_of(flown))])
    return page(shown, read("templates/evidence.css", "pipeline.report"), worst)


def document(evidence: Mapping[str, Any], tube: Illustration | None = None) -> Document:
    """Return evidence as a document; see `render_evidence`."""
    requirements, conditions = evidence["requirements"], evidence["conditions"]
    drawn = element("figcaption", caption_of("argument"))
    caveats = joint_words(evidence["joint"]), repeats_in_words(evidence)
    blocks: list[Block] = [
        Heading(f"Evidence for {evidence['controller']['name']}", 1),
        Paragraph(run_in_words(evidence)),
        Heading("Verdicts", id="verdicts"),
        Paragraph(lead(evidence)),
        *(Paragraph(words) for words in caveats if words),
        _matrix(requirements),
        Heading("Argument", id="argument"),
        Figure(element("figure", _drawings().argument(evidence), drawn, tabindex=0)),
        Heading("Requirements", id="requirements"),
    ]
    for requirement in requirements:
        blocks += _requirement(requirement, tube, has_sun=bool(conditions["sun"]))
    blocks += [Heading("Operational domain", id="domain"), *_domain(evidence)]
    heads = ["factor", "scale", "this run shows", "it does not show"]
    credibility = Table(heads, factors(evidence), caption=caption_of("credibility"))
    blocks += [Heading("Credibility", id="credibility"), credibility]
    return Document([*blocks, Heading("Provenance", id="provenance"), *_provenance(evidence)])


def run_in_words(evidence: Mapping[str, Any]) -> str:
    """Return the requirements, the number of cases and the conditions of a run in a sentence."""
    conditions = evidence["conditions"]
    errors = ", ".join(word for word in uncertain(conditions) if word != "Sun")
    sun = f"Sun {conditions['sun']}, " if conditions["sun"] else ""
    cases = f"{conditions['num_cases']:,} cases"
    cases += f" of {conditions['deputies']} deputies" if "deputies" in conditions else ""
    return (
        f'Requirements "{evidence["name"]}"; {cases}, seed {conditions["seed"]}, '
        f"{sun}safety {conditions['safety']}{errors and f', with {errors}'}."
    )


def _drawings() -> Any:
    """Return the macros that draw."""
    words = {"wrapped": partial(wrap, max_lines=3, placeholder=" …"), "narrow": partial(wrap, width=12)}
    known = {"css": css, "css_of": css_of, "methods": METHODS, "order": ORDER, "contexts": contexts, **words}
    return template("pipeline.report", "templates", "drawings.html").make_module(known)


def contexts(evidence: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the contexts of the argument: each in words, with a link to its part of the page.

    Flights argue from inputs that flights have met; a proof argues from its own set, which is larger.
    """
    conditions, requirements = evidence["conditions"], evidence["requirements"]
    sun = f"; Sun {conditions['sun']}" if conditions["sun"] else ""
    flights = (
        f"starts {conditions['starts']}{sun}; safety {conditions['safety']}; flights of "
        f"{conditions['duration_s']:,g} s, sampled every {conditions['sample_period_s']:g} s"
    )
    links = [("provenance", flights)]
    if not all(proved_by(requirement) for requirement in requirements):
        domain = "the operational domain: inputs that flights have met"
        none = "the controller has no fuzzy inputs, hence no operational domain"
        none = "of fleets there is no operational domain" if "deputies" in conditions else none
        links.append(("domain", domain if evidence["domain"] else none))
    for method, words in PROVED_SETS.items():
        proved = [requirement for requirement in requirements if proved_by(requirement) == method]
        if proved:
            names = ", ".join(requirement["id"] for requirement in proved)
            where = proved[0][method]["starts"] if method != "bounds" else ""
            links.append((f"{proved[0]['id']}-{method}", f"{names}: {words.format(where)}"))
    return links


def proved_by(requirement: Mapping[str, Any]) -> str:
    """Return the method whose proof shows a requirement, empty if flights do."""
    if not requirement["verdict"].startswith("shown"):
        return ""
    methods = requirement["methods"]
    return next((name for name in PROVED_SETS if methods.get(name, {}).get("is_proof")), "")


def draw_margins(histogram: Mapping[str, Any], unit: str, name: str) -> Markup:
    """Draw a histogram of margins as an SVG element.

    Parameters
    ----------
    histogram : mapping
        ``edges``, one more than ``counts``; zero is an edge where margins of both signs are.
    unit : str
        Of the margins.
    name : str
        Of the requirement, for readers who do not see the picture.
    """
    edges, counts = histogram["edges"], histogram["counts"]
    first, last, most = edges[0], edges[-1], max(counts)

    def position(value: float) -> float:
        return float(46.0 + 584.0 * (value - first) / (last - first))

    def height(count: float) -> float:
        # a logarithmic axis from half a flight, so that few failures among thousands are seen
        return 100.0 * log(2.0 * count) / log(2.0 * most)

    bars = [
        (
            "refuted" if high <= 0.0 else "shown",
            f"{count:,} from {low:.4g} to {high:.4g} {unit}".strip(),
            position(low),
            height(count),
            max(1.0, position(high) - position(low) - 1.0),
        )
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
        if count
    ]
    shown = {"start": first, "end": last}
    if first < 0.0 < last:
        far = {anchor: end for anchor, end in shown.items() if abs(position(end) - position(0.0)) > ROOM}
        shown = {**far, "middle": 0.0}
    marks = [(anchor, position(value), number(value)) for anchor, value in shown.items()]
    ticks = [(f"{10**power:,}", height(10**power)) for power in range(len(str(most)))]
    label = f"Margins of the cases of {name}: from {first:.4g} to {last:.4g} {unit}"
    return Markup(_drawings().margins(bars, marks, ticks, unit, label))  # noqa: S704 - escaped by the template


def css_of(result: Mapping[str, Any]) -> str:
    """Return the class of a method's result; a failure that a search finds refutes no share of the cases."""
    return {"failure found": "not-shown", "none found": "neutral", "does not apply": "neutral"}.get(
        result["word"], css(result["verdict"])
    )


def css(verdict: str) -> str:
    """Return the CSS class that gives a verdict its colour."""
    return verdict.replace(" ", "-")


def number(value: float) -> str:
    """Format a number with a true minus sign."""
    return f"{value:.4g}".replace("-", "−")


def lead(evidence: Mapping[str, Any]) -> str:
    """Return the result in words: the gravest requirement of the worst verdict, then all others."""
    ranked = sorted(
        evidence["requirements"],
        key=lambda requirement: (
            -ORDER.index(requirement["verdict"]),
            SEVERITIES.index(requirement["severity"]),
        ),
    )
    first, *others = ranked
    rest = [
        f"{', '.join(ids)}: {word}" + (", as worded below" if word == "shown" else "")
        for word in reversed(ORDER)
        if (ids := [requirement["id"] for requirement in others if requirement["verdict"] == word])
    ]
    return f"{first['id']}, {first['severity']}. {first['sentence']}" + (
        f" The others: {'; '.join(rest)}." if rest else ""
    )


def _matrix(requirements: list[Mapping[str, Any]]) -> Table:
    """Return a table of requirements by methods of verification, with links to the details."""
    rows: list[list[Mark | str]] = []
    shown = [name for name in METHODS if any(name in requirement["methods"] for requirement in requirements)]
    for requirement in requirements:
        stake = f"failing means {requirement['consequence']} ({requirement['severity']})"
        word = Mark(
            requirement["verdict"], css(requirement["verdict"]), note=f"{requirement['share']}; {stake}"
        )
        rows.append([Mark(f"{requirement['id']} {requirement['title']}", link=requirement["id"]), word])
        for method in shown:
            result = requirement["methods"].get(method)
            kind = css_of(result) if result else ""
            link = f"{requirement['id']}-{method}"
            mark = Mark(result["word"], kind, link, _brief(requirement, method)) if result else ""
            rows[-1].append(mark)
    return Table(
        ["requirement", "verdict", *(METHODS[name] for name in shown)], rows, caption=caption_of("matrix")
    )


def _brief(requirement: Mapping[str, Any], method: str) -> str:
    """Return the note of a cell in the table: how many searches found a failure, or how many boxes."""
    if method == "search":
        return f"{requirement['search']['num_found']} of {requirement['search']['num_searches']} searches"
    if method != "bounds" or "bounds" not in requirement:
        return ""
    return f"{sum(part['num_boxes'] for part in requirement['bounds']):,} boxes"


def _requirement(
    requirement: Mapping[str, Any], tube: Illustration | None, *, has_sun: bool
) -> Iterator[Block]:
    """Yield the details on a requirement: its formula, what each method shows, and the worst case."""
    unit, methods = requirement["unit"], requirement["methods"]
    yield Heading(f"{requirement['id']} {requirement['title']}", 3, requirement["id"])
    yield Paragraph(requirement["sentence"])
    accepted = f" Accepted: {requirement['accepted']}" if requirement["accepted"] else ""
    yield Paragraph(f"Why: {requirement['reason']} Source: {requirement['source']}.{accepted}")
    if requirement["formula"]:
        yield Code(requirement["formula"])
    details: dict[str, list[Block]] = {name: [Paragraph(_full(methods[name]["why"]))] for name in methods}
    if cases := requirement.get("cases"):
        details["cases"].append(Table([], _case_facts(cases, unit)))
        for histogram in cases["histograms"]:
            drawn = draw_margins(histogram, histogram["unit"], requirement["id"])
            details["cases"].append(Figure(element("figure", drawn)))
    if splitting := requirement.get("splitting"):
        details["splitting"].append(Table([], _splitting_facts(splitting)))
    if search := requirement.get("search"):
        details["search"] += [Paragraph(_full(search["sentence"])), Table([], _search_facts(search))]
    if bounds := requirement.get("bounds"):
        boxes = f"The boxes: {artifacts.PROOF_BOXES}. Over each, interval arithmetic rules the answer out."
        parts = [f"{part['system']}: {part['sentence']} Boxes: {part['num_boxes']:,}." for part in bounds]
        details["bounds"] += [Items(parts), Paragraph(boxes)]
    if "tube" in details and requirement["methods"]["tube"]["is_proof"]:
        details["tube"].append(Paragraph(caption_of("model", tube=requirement["tube"])))
    if "tube" in details and tube:
        details["tube"].append(tube.block)
    if "safety_layer" in details:
        details["safety_layer"].append(Paragraph(caption_of("layer")))
    for name, blocks in details.items():
        yield Fold(
            f"{METHODS[name].capitalize()}: {methods[name]['word']}", blocks, f"{requirement['id']}-{name}"
        )
    if worst := requirement.get("worst"):
        is_proved = bool(proved_by(requirement))
        left = [] if is_proved else [_departure(departure) for departure in worst["left_domain"]]
        replay = Code(typed.replay(*worst.get("recordings", [worst["recording"]])))
        has_domain = not is_proved and "deputy" not in worst
        facts = Table([], _worst_facts(worst, has_domain=has_domain, has_sun=has_sun))
        yield Fold("The worst case that is known", [facts, replay, *([Items(left)] if left else [])])


def _full(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _domain(evidence: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the operational domain: the range that each input had in flights."""
    domain = evidence["domain"]
    proved = [each["id"] for each in evidence["requirements"] if proved_by(each)]
    if proved:
        yield Paragraph(caption_of("beyond", requirements=", ".join(proved)))
    if domain is None:
        none = "The controller has no fuzzy systems: there are no inputs to make a domain of."
        of_fleets = "Of fleets none is made: what a deputy senses depends on what the others tell it."
        yield Paragraph(of_fleets if "deputies" in evidence["conditions"] else none)
        return
    confidence, high = _percent(domain["confidence"]), _percent(domain["high"])
    yield Paragraph(caption_of("domain", domain=domain, confidence=confidence, high=high))
    rows = []
    for system in domain["systems"]:
        for variable in system["inputs"]:
            name = f"{variable['name']} ({variable['unit']})" if variable["unit"] else variable["name"]
            rows.append([name, system["system"], number(variable["low"]), number(variable["high"])])
    caption = f"What the systems sensed where inference decided, in {domain['num_made_from']:,} flights."
    yield Table(["input", "system", "least", "greatest"], rows, (2, 3), caption=caption)
    yield Paragraph("A monitor says when a recorded flight leaves it, in which input and by how much:")
    yield Code(typed.domain(artifacts.DOMAIN))


def _case_facts(cases: Mapping[str, Any], unit: str) -> list[list[str]]:
    """Return the rows on a requirement's random flights: failures, shares and margins."""
    allowed, needed, margin = cases["num_allowed"], cases["needed_without_failure"], cases["margin"]
    known, anytime = cases["num_known"], cases.get("is_sequential", False)
    few = "too few cases" if needed else "all cases must meet it: only a proof shows it"
    bounds = f"{_percent(cases['low'])} to {_percent(cases['high'])}"
    occurred = [[f"with {text}", f"{count:,}"] for text, count in cases["premises"].items()]
    least = [_quantity(histogram["least"], histogram["unit"]) for histogram in cases["histograms"]]
    margins = [["worst margin", " and ".join(least)]]
    if unit != "mixed":  # margins of several units have no order
        at_share = few if margin is None else f"at least {_quantity(margin, unit)}"
        median = _quantity(cases["median_margin"], unit)
        margins = [["margin, at the claim's share", at_share], ["median margin", median], *margins]
    return [
        ["flown", f"{cases['num_cases']:,}"],
        *([["flown by earlier tries, not counted again", f"{known:,}"]] if known else []),
        *occurred,
        ["failed", f"{cases['num_failed']:,}"],
        ["failures that the claim allows", f"at most {allowed:,}" if allowed >= 0 else few],
        ["cases needed without a failure", f"{needed:,}" if needed else "no number is enough"],
        ["share that meets it, " + ("for any number of flights" if anytime else "one-sided bounds"), bounds],
        *margins,
    ]


def _splitting_facts(splitting: Mapping[str, Any]) -> list[list[str]]:
    """Return the rows on how rare failures are."""
    share, low, high = (splitting[name] for name in ("share", "low", "high"))
    return [
        ["share of cases that fail it", "no estimate" if share is None else f"{share:.3g}"],
        ["one-sided bounds", "none" if high is None else f"{low:.3g} to {high:.3g}"],
        ["flights", f"{splitting['num_flights']:,}"],
        ["levels of the margin", ", ".join(f"{level:.4g}" for level in splitting["levels"])],
        ["by each population", ", ".join(f"{each:.2g}" for each in splitting["populations"])],
    ]


def _search_facts(search: Mapping[str, Any]) -> list[list[str]]:
    """Return the rows on a search for failures, compared with random flights."""
    none = "none found"
    counts = ("flights_per_find", "random_flights_per_find", "ratio")
    per_find, at_random, ratio = (search[name] for name in counts)
    return [
        ["flights of all searches", f"{search['num_flights']:,}"],
        ["flights for each failure found", none if per_find is None else f"{per_find:,.0f}"],
        ["flights at random for each failure", none if at_random is None else f"{at_random:,.0f}"],
        ["faster than at random", "no ratio" if ratio is None else f"{ratio:.1f} times"],
        ["worst margin found", _quantity(search["worst_margin"], search["worst_unit"])],
        ["worst margin at random", _quantity(search["random_worst_margin"], search["random_worst_unit"])],
    ]


def _worst_facts(worst: Mapping[str, Any], *, has_domain: bool, has_sun: bool) -> list[list[str]]:
    """Return the rows on the worst known case: its margins, start and settings."""
    start, velocity = (
        ", ".join(f"{value:.3f}" for value in worst.get(name, ())).replace("-", "−")
        for name in ("position_m", "velocity_m_s")
    )
    left = len(worst["left_domain"])
    times = "never" if not left else "once" if left == 1 else f"{left} times"
    sun = sun_at_start(worst["sun_angle_rad"], worst["sun_elevation_rad"], 2)
    return [
        ["found by", worst["found_by"]],
        ["margin", _quantity(worst["margin"], worst["unit"])],
        ["margin of the recording, read back", _quantity(worst["recorded_margin"], worst["unit"])],
        *([["deputy with this margin", f"{worst['deputy']}"]] if "deputy" in worst else []),
        ["start, Hill axes", f"({start}) m"],
        *([["velocity there", f"({velocity}) m/s"]] if any(worst.get("velocity_m_s", ())) else []),
        *([["Sun at the start", sun]] if has_sun else []),
        *([key, f"{value:.6g}"] for key, value in worst["settings"].items()),
        *([["left the operational domain", times]] if has_domain else []),
    ]


def _departure(left: Mapping[str, Any]) -> str:
    return caption_of("departure", left=left, unit=f" {left['unit']}" if left["unit"] else "")


def _provenance(evidence: Mapping[str, Any]) -> Iterator[Block]:
    """Yield what the evidence was made of and by: hashes, versions, settings, and the command."""
    controller = evidence["controller"]
    yield Table(
        [],
        [
            ["controller", controller["name"]],
            ["controller, SHA-256", controller["sha256"] or "neither fuzzy nor learned"],
            ["configuration, SHA-256", evidence["config_hash"]],
            ["revision of the sources", evidence["git_revision"] or "not in a repository"],
            ["sources, SHA-256", evidence["sources"]],
            ["compiled for", evidence["processor"]["compiled_for"]],
        ],
    )
    if settings := evidence["conditions"]["settings"]:
        yield Paragraph("Settings of the mission and the Sun that differ from the defaults:")
        rows = [[key, f"{as_yaml(value)} {unit_of(key).symbol}".strip()] for key, value in settings.items()]
        yield Table([], rows)
    yield Paragraph("The same evidence again, where RUN is the folder of the run:")
    yield Code(typed.repeat(typed.RUN, "assure"))
    yield Fold("Versions", [Table([], [list(pair) for pair in evidence["versions"].items()])])
    yield Fold("Files and their SHA-256", [Table([], [list(pair) for pair in evidence["sha256"].items()])])
    yield Paragraph(f"The same as data: {artifacts.EVIDENCE}.")


def _quantity(value: float, unit: str) -> str:
    """Format a margin with its unit and a true minus sign."""
    return f"{number(value)} {unit}".strip()


def _percent(share: float) -> str:
    """Format a share in per cent, near 100 % with more digits."""
    return f"{100.0 * share:.5g} %" if share > 0.9 else f"{100.0 * share:.3g} %"


def uncertain(conditions: Mapping[str, Any]) -> list[str]:
    """Return the uncertainties of the flights in words, besides their starts."""
    words = [] if conditions["sun"] in ("fixed", None) else ["Sun"]
    words += [] if conditions["navigation"] == "perfect" else ["errors of navigation"]
    words += [] if conditions["thrusters"] == "ideal" else ["errors of the thrusters"]
    words += [] if conditions["dynamics"] == "cw" else ["forces beyond the controller's model"]
    return words + list(conditions["dispersed"])


def _listed(words: list[str]) -> str:
    """Return what differs between cases as a phrase; the start always does."""
    *all_but_last, last = ["start", *words]
    return f"{', '.join(all_but_last)} and {last}" if all_but_last else last


def factors(evidence: Mapping[str, Any]) -> list[list[str]]:
    """Return the factors of credibility: name, scale, what this run shows for it, and what it does not.

    Levels are for a reviewer to give, and none is claimed.
    """
    conditions, requirements = evidence["conditions"], evidence["requirements"]
    domain = evidence["domain"] or {}
    is_own = any(key.partition(".")[0] in DESIGN for key in conditions["settings"])
    facts = {
        "origin": OF_RUN if is_own else OF_PAPER,
        "recorded": sum("worst" in requirement for requirement in requirements),
        "product": evidence["versions"].get("product"),
        "revision": evidence["git_revision"] or "none (not in a repository)",
        "left": domain.get("num_left"),
        "tried": domain.get("num_tried"),
        "seed": conditions["seed"],
        "num_cases": conditions["num_cases"],
        "uncertain": _listed(uncertain(conditions)),
        "searched": sum(
            requirement["search"]["num_flights"] for requirement in requirements if "search" in requirement
        ),
        "boxes": sum(
            part["num_boxes"] for requirement in requirements for part in requirement.get("bounds", ())
        ),
    }
    rows = yaml.safe_load(read("templates/credibility.yaml", "pipeline.report"))
    for row in rows:
        missing = [words for fact, words in row.get("without", {}).items() if not facts[fact]]
        row["shows"] = missing[0] if missing else row["shows"].format(**facts)
        row["not_shown"] = row["not_shown"].format(**facts)
    return [[row[name] for name in ("factor", "scale", "shows", "not_shown")] for row in rows]
