"""The review page of systems whose rules conclude numbers, such as learned ones: without scripts."""

import base64
from collections.abc import Iterator, Mapping, Sequence

from fis_tools.analysis import arrays, shapley
from fis_tools.document import Block, Document, Figure, Fold, Heading, Items, Paragraph, Table, html
from fis_tools.document.element import element, void
from fis_tools.engines.compiler import compile
from fis_tools.errors import MissingExtra
from fis_tools.findings.audit import Audit
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.review.findings import finding_counts
from fis_tools.review.flown import Samples
from fis_tools.words.outline import ranked
from fis_tools.words.text import sentences, shape_words, summary

_SHARES = (
    "share: by how much a rule moves an output on average, in parts of the output's range (a Shapley value); "
    "fires: in what part of the samples with a strength of 0.05 or more."
)


def write(
    controller: FuzzyController,
    opening: Sequence[Block],
    lead: str,
    samples: Mapping[str, Samples],
    audited: Audit,
) -> str:
    """Write the page: ``opening`` is what every review page begins with, ``lead`` its first sentences."""
    findings = [f"{one.severity.word}, {one.system}: {one.sentence} {one.cure}" for one in audited.findings]
    blocks: list[Block] = [
        Heading(f"Review: {controller.name}", 1),
        Paragraph(lead),
        Paragraph(f"SHA-256 {serialize.fingerprint(controller)}"),
        *opening,
        Heading("Findings", id="findings"),
        Fold(finding_counts(audited), [Items(findings)])
        if findings
        else Paragraph("The audit found nothing."),
        Heading("Where it comes from", id="provenance"),
        _facts(controller),
    ]
    for system in controller.systems:
        blocks += [Heading(system.name, id=f"system-{system.name}"), *_system(system, samples[system.name])]
    return html.page(Document(blocks))


def _facts(controller: FuzzyController) -> Block:
    told = [[key.replace("_", " "), value] for key, value in (*controller.provenance, *controller.attributes)]
    return Table([], told) if told else Paragraph("Its file does not say: no data, no errors, no author.")


def _system(system: FuzzySystem, samples: Samples) -> Iterator[Block]:
    yield Paragraph(f"{summary(system)}.")
    terms = [
        [variable.name, term.name, shape_words(term)]
        for variable in (*system.inputs, *system.outputs)
        for term in variable.terms
    ]
    yield Fold("Terms, and what rules conclude", [Table(["variable", "term", "function or formula"], terms)])
    yield Fold("Surfaces", [*_pictures(system)])
    usage = arrays.rule_usage(arrays.firing(system, samples.inputs))
    shares = shapley.importance(compile(system), samples.inputs)
    lines = sentences(system)
    rows = [
        [
            str(one.number),
            lines[one.number - 1],
            one.importance_words,
            f"{100 * usage.fired[one.number - 1]:.1f} %",
        ]
        for one in ranked(system, {system.name: shares})
    ]
    caption = f"{samples.words[0].upper()}{samples.words[1:]}. {_SHARES}"
    yield Fold(
        "Rules and their shares", [Table(["no.", "rule", "share", "fires"], rows, (2, 3), caption=caption)]
    )


def _pictures(system: FuzzySystem) -> Iterator[Block]:
    try:
        from fis_tools import render  # noqa: PLC0415 - the page is made without matplotlib
    except MissingExtra as error:
        yield Paragraph(str(error))
        return
    for name, figure in render.surface_figures(system):
        picture = render.encode(figure, "png", 90)
        yield Figure(element("figure", void("img", src=_address(picture), alt=f"{system.name}: {name}")))


def _address(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
