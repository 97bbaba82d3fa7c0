"""The page of a sweep: tables, parallel coordinates, the front, and how to fly the best."""

from collections.abc import Iterator

from markupsafe import Markup

from fis_tools.document import Block, Code, Document, Figure, Heading, Items, Paragraph, html
from fis_tools.document.html import element, read
from pipeline.evaluation.paired import METRICS
from pipeline.report.figures.style import save, style
from pipeline.report.figures.sweep import Line, Point, front_of_runs, parallel_coordinates
from pipeline.report.svg import inline
from pipeline.report.swept.contents import Run, Swept
from pipeline.report.swept.words import effects_table, failures_of, runs_table

DOTS_PER_INCH = 100
_EFFECTS = (
    "Each value of a setting against its first, in runs that differ in nothing else, on the cases that they "
    "share. Where several pairs of runs differ so, each pair counts once; where one does, each case."
)


def write(swept: Swept) -> str:
    """Write the page: HTML that needs no other file, asks for none, and runs no script."""
    return html.page(_document(swept), read("templates/report.css", "pipeline.report"))


def _document(swept: Swept) -> Document:
    folder = swept.folder.as_posix()
    blocks: list[Block] = [
        Heading(f"Sweep over {', '.join(swept.factors) or 'nothing'}", 1),
        Paragraph(f"{folder}: {len(swept.runs)} runs, {len(swept.evaluated)} evaluated"),
        Heading("Best, ready to fly"),
    ]
    if swept.offered:
        blocks.append(
            Paragraph(
                "No other run spends as little and inspects as much; first those that succeed most often: "
                "that inspect enough inside the limits."
            )
        )
        for run in swept.offered:
            blocks += [Heading(run.name, 3), Code(run.fly)]
    else:
        blocks.append(Paragraph("No run has been evaluated yet."))
    failures = [f"{run.name}: {run.failure}" for run in failures_of(swept)]
    if failures:
        blocks += [Heading("Failed"), Items(failures), Paragraph("To try them again:")]
        blocks.append(Code(f"python -m pipeline resume={folder}"))
    if effects := effects_table(swept):
        blocks += [Heading("Effects"), Paragraph(_EFFECTS), *effects]
    if len(swept.evaluated) > 1:
        blocks += [Heading("All runs"), *_pictures(swept)]
    return Document([*blocks, Heading("Runs"), *runs_table(swept)])


def _pictures(swept: Swept) -> Iterator[Figure]:
    runs = swept.evaluated
    told = (
        (
            "parallel",
            "Settings and outcomes, a line a run",
            "Each run is a line through its settings and its means.",
        ),
        (
            "front",
            "Mean inspection rate over mean delta-v",
            "Means with their intervals; the line joins the runs that no other surpasses.",
        ),
    )
    with style():
        figures = (
            parallel_coordinates([_line(run, swept) for run in runs]),
            front_of_runs([_point(run, swept) for run in runs]),
        )
        for figure, (name, words, caption) in zip(figures, told, strict=True):
            drawn = Markup(inline(save(figure, name, DOTS_PER_INCH).svg, name, words))  # noqa: S704 - escaped there
            yield Figure(element("figure", drawn, element("figcaption", caption)))


def _line(run: Run, swept: Swept) -> Line:
    settings = {key: run.differs.get(key, "") for key in swept.factors}
    outcomes = {f"{metric.label} ({metric.unit})": run.values[metric.name].value for metric in METRICS}
    return Line(run.name, settings, outcomes, run in swept.front)


def _point(run: Run, swept: Swept) -> Point:
    spent, rate = run.values["delta_v_m_s"], run.values["inspection_rate_percent"]
    return Point(
        run.name, (spent.value, spent.low, spent.high), (rate.value, rate.low, rate.high), run in swept.front
    )
