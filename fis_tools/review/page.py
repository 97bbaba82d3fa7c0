"""The review page: words, systems and flights in one self-contained file."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from fis_tools.analysis import arrays, shapley
from fis_tools.engines.compiler import compile
from fis_tools.errors import MissingExtra
from fis_tools.findings.audit import Audit, audit, report
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Inferable, tree
from fis_tools.model.intervals import require_type_1
from fis_tools.model.trees import require_unwired
from fis_tools.review import carried, content, flown, transcribed
from fis_tools.words.text import sentences, shape_words, summary, wires_in_words
from plain_files.document import Block, Document, Figure, Fold, Heading, Items, Paragraph, Table, html
from plain_files.document.html import as_script_data, element, png_address, read, template, void

#: what the reviewer ticks before signing, by key
CHECKS = {
    "flights": "I have looked at how it {did}, and the {noun}s stand for how it will be used.",
    "constants": "Every constant has the value that it should have.",
    "terms": "The terms mean what their names say.",
    "rules": "I have read the rules with the greatest shares of each system, and they say the right thing.",
    "findings": "Every serious finding and every warning is accepted, or waived for the reason given.",
}

_DID = {"flight": "flew", "log": "answered"}

#: joined in this order
SCRIPTS = (
    *("elements", "scale", "palette", "pointing", "canvases", "systems", "carried", "inference"),
    *("shares", "sign_change", "state", "tables", "memberships", "inference_view", "rules_view"),
    *("response", "heat_map", "solid", "surface_view", "flight_view", "signature", "page"),
)


def write(
    controller: FuzzyController,
    flight_paths: Sequence[Path | str] = (),
    part: str | None = None,
    evidence: Path | str | None = None,
    all_periods: bool = False,
    panel: html.ScriptedPanel | None = None,
) -> str:
    """Write the review page of a controller.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    flight_paths : sequence of paths
        Logged flights and tables to review it along, and folders of runs with some; without any, rules are
        counted over the whole input space.
    part : str, optional
        The system's name, where the controller is only that part of a larger one.
    evidence : path, optional
        A file that tells what became of the requirements.
    all_periods : bool
        Count every inference along flights, not only those whose force was fired.
    panel : ScriptedPanel, optional
        Shown before the findings by a caller that can draw what the controller controls.

    Returns
    -------
    str
        HTML that needs no other file and asks for none; with outputs that are weighted averages or sums of
        numbers it has no inference to play with.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If a flight cannot be read, or its systems have other inputs than the controller's; if the evidence
        cannot be read, or is about another controller.
    """
    systems = controller.systems
    require_type_1(systems, "a review page")
    require_unwired([controller] if flight_paths else [], "a review along a log")
    paths = flown.recordings(flight_paths)
    logged = flown.read_flights(paths, controller, all_periods)
    ended = [flight for flight in logged if flight.outcome is not None]
    noun = "flight" if ended else "log"
    went = [flight.outcome for flight in ended if flight.outcome is not None]
    meanings = {name: meaning for evaluation in went for name, meaning in evaluation.constants.items()}
    fingerprint = serialize.fingerprint(controller)
    samples = {system.name: flown.samples_of(system, logged, noun) for system in systems}
    sensed = {name: some.inputs for name, some in samples.items() if some.are_flown}
    audited = audit(controller, sensed if logged else None)
    evaluated = flown.evaluations(flight_paths, fingerprint)
    names = [flight.name for flight in ended]
    evidenced, requirements = (None, []) if evidence is None else content.read_evidence(evidence, fingerprint)
    title = "How it flew" if noun == "flight" else "How it answered"
    opening_blocks: list[Block] = [
        *(content.verdicts(evidenced, requirements) if evidenced and requirements else []),
        Heading("What it does", id="does"),
        *content.rules(controller),
        Heading("Inputs", 3),
        content.inputs(controller, samples, logged),
        *_wired(controller),
        Heading(title, id="logged"),
        *(Paragraph(flown.failures(evaluation)) for evaluation in evaluated),
        *flown.flown_table(evaluated, names, went),
        Paragraph(content.along(logged, noun)),
        Heading("What is not covered", id="uncovered"),
        Items(content.not_covered(evidenced, evaluated, samples, noun)),
    ]
    lead = content.lead(controller)
    checks = {key: words.format(noun=noun, did=_DID[noun]) for key, words in CHECKS.items()}
    if any(system.weighed for system in systems):
        last = _sign_off(controller, part, checks.values())
        return _without_scripts(controller, opening_blocks, lead, samples, audited, last)
    carried_systems = [carried.system_data(system) for system in systems]
    data = {
        "brightness": content.BRIGHTNESS,
        "sha256": fingerprint,
        "name": controller.name,
        "quadrature": carried.quadrature_data(systems),
        "systems": carried_systems,
        "noun": noun,
        "flights": [carried.flight_data(flight, systems, len(logged)) for flight in logged],
    }
    return _assemble(
        data,
        _script(carried_systems),
        panel,
        controller=controller,
        facts=content.facts(controller.provenance),
        constants=content.constants(controller, meanings),
        others=content.facts(content.texts(controller)),
        lead=lead,
        opening=html.body(Document(opening_blocks)),
        sections=[block for block in opening_blocks if isinstance(block, Heading) and block.id],
        part=part,
        option=f" --system {shlex.quote(part)}" if part else "",
        fingerprint=fingerprint,
        checks=checks,
        noun=noun,
        flights=logged,
        findings=content.finding_rows(audited, controller),
        counted=audited.counted(),
        measure_words=report.MEASURE_WORDS,
        **content.CALLED,
        systems=[
            content.system_words(number, system, samples[system.name], measured.measures)
            | {"findings": audited.counted(system.name) or "none"}
            for number, (system, measured) in enumerate(zip(systems, audited.systems, strict=True), start=1)
        ],
    )


def _assemble(data: object, script: str, panel: html.ScriptedPanel | None, **words: object) -> str:
    """Render the template with words, data, style sheet and scripts."""
    # joined: where a panel's markup were added, the selectors before it would be escaped
    style = "".join((read("style.css", __package__), content.level_styles(), panel.style if panel else ""))
    scripts = (script, *(panel.scripts if panel else ()))
    return template("fis_tools", "review", "page.html").render(
        words,
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704 - files of this package
        data=Markup(as_script_data(data)),  # noqa: S704 - no character of it ends a script element
        # what plays sets styles of single elements
        policy=html.policy("" if panel else style, scripts, flies=panel is not None),
        panel=panel,
    )


def _script(systems: list[dict[str, Any]]) -> str:
    """Join the scripts into one that leaves nothing of its own behind."""
    parts = [transcribed.script(systems), *(read(f"scripts/{name}.js", __package__) for name in SCRIPTS)]
    return '\n"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


_SHARES = (
    "share: by how much a rule moves an output on average, in parts of the output's range (a Shapley value); "
    "fires: in what part of the samples with a strength of 0.05 or more."
)


def _without_scripts(
    controller: FuzzyController,
    opening: Sequence[Block],
    lead: str,
    samples: Mapping[str, flown.SensedInputs],
    audited: Audit,
    last: Sequence[Block],
) -> str:
    """Render the static page; ``opening`` begins every review page, ``lead`` are its first sentences."""
    findings = [
        f"{finding.severity.word}, {finding.system}: {finding.sentence} {finding.cure}"
        for finding in audited.findings
    ]
    blocks: list[Block] = [
        Heading(f"Review: {controller.name}", 1),
        Paragraph(lead),
        Paragraph(f"SHA-256 {serialize.fingerprint(controller)}"),
        *opening,
        Heading("Findings", id="findings"),
        Fold(audited.counted(), [Items(findings)]) if findings else Paragraph("The audit found nothing."),
        Heading("Where it comes from", id="provenance"),
        _facts(controller),
    ]
    for system in controller.systems:
        blocks += [Heading(system.name, id=f"system-{system.name}"), *_blocks(system, samples[system.name])]
    return html.page(Document([*blocks, *last]))


def _sign_off(controller: FuzzyController, part: str | None, checks: Iterable[str]) -> list[Block]:
    """Return the checklist and signature fields for paper."""
    alone, option = (f"the system {part} alone of ", f" --system {shlex.quote(part)}") if part else ("", "")
    return [
        Heading("Sign-off", id="sign-off"),
        Paragraph(
            f"A signature here is for {alone}the controller {controller.name} with the SHA-256 "
            f"{serialize.fingerprint(controller)}, which is that of what python -m fis_tools export "
            f"CONTROLLER{option} --format json prints."
        ),
        Table([], [["☐", words] for words in checks]),
        Table([], [[label, "\u00a0" * 60] for label in ("decision", "name", "date", "signature", "remarks")]),
    ]


def _facts(controller: FuzzyController) -> Block:
    rows = [[key.replace("_", " "), value] for key, value in (*controller.provenance, *controller.attributes)]
    return Table([], rows) if rows else Paragraph("Its file does not say: no data, no errors, no author.")


def _blocks(system: FuzzySystem, samples: flown.SensedInputs) -> Iterator[Block]:
    """Yield what a static page shows of a system: terms, surfaces, and rules with their shares."""
    yield Paragraph(f"{summary(system)}.")
    terms = [
        [variable.name, term.name, shape_words(term)]
        for variable in system.variables
        for term in variable.terms
    ]
    yield Fold("Terms, and what rules conclude", [Table(["variable", "term", "function or formula"], terms)])
    yield Fold("Surfaces", [*_pictures(system)])
    usage = arrays.rule_usage(arrays.firing(system, samples.inputs))
    shares = shapley.importance(compile(system), samples.inputs).max(axis=1)
    lines = sentences(system)
    rows = [
        [str(index + 1), lines[index], _share(shares[index]), f"{100 * usage.fired[index]:.1f} %"]
        for index in np.argsort(-shares, kind="stable")
    ]
    caption = f"{samples.words[0].upper()}{samples.words[1:]}. {_SHARES}"
    yield Fold(
        "Rules and their shares", [Table(["no.", "rule", "share", "fires"], rows, (2, 3), caption=caption)]
    )


def _share(share: float) -> str:
    words = f"{100 * share:.2f}"
    return "< 0.01 %" if words == "0.00" and share > 0 else f"{words} %"


def _wired(controller: FuzzyController) -> Iterator[Block]:
    """Yield how the systems of a controller are wired, and the surfaces of the whole."""
    if not controller.wires:
        return
    yield Heading("Wires", 3)
    yield Items([*wires_in_words(controller)])
    yield Paragraph("Below, each system stands by itself: what a wire passes on is set there by hand.")
    yield Fold("Surfaces of the whole", [*_pictures(tree(controller))])


def _pictures(system: Inferable) -> Iterator[Block]:
    """Yield the surfaces as pictures; without matplotlib, what to install."""
    try:
        from fis_tools import render  # noqa: PLC0415 - the page is made without matplotlib
    except MissingExtra as error:
        yield Paragraph(str(error))
        return
    for name, figure in render.surface_figures(system):
        picture = render.encode(figure, "png", 90)
        yield Figure(element("figure", void("img", src=png_address(picture), alt=f"{system.name}: {name}")))
