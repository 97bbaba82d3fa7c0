"""The page of a sweep: tables, parallel coordinates, the front, and how to fly the best."""

from markupsafe import Markup

from fis_tools.document.page import read, source_hash, template
from pipeline.evaluation.paired import METRICS
from pipeline.report.figures.style import save, style
from pipeline.report.figures.sweep import Line, Point, front_of_runs, parallel_coordinates
from pipeline.report.svg import inline
from pipeline.report.swept.contents import Run, Swept
from pipeline.report.swept.words import effects_table, failures_of, runs_table

DOTS_PER_INCH = 100


def write(swept: Swept) -> str:
    """Write the page.

    Returns
    -------
    str
        HTML that needs no other file, asks for none, and runs no script.
    """
    css = read("templates/report.css", "pipeline.report")
    return template("pipeline.report", "templates", "sweep.html").render(
        folder=swept.folder.as_posix(),
        num_runs=len(swept.runs),
        num_evaluated=len(swept.evaluated),
        factors=swept.factors,
        runs=runs_table(swept),
        effects=effects_table(swept),
        pictures=_pictures(swept),
        offered=swept.offered,
        failures=failures_of(swept),
        style=Markup(css),  # noqa: S704 - a file of this package
        style_hash=source_hash(css),
    )


def _pictures(swept: Swept) -> dict[str, Markup]:
    """Draw the sweep; nothing where fewer than two runs were evaluated."""
    runs = swept.evaluated
    if len(runs) < 2:
        return {}
    with style():
        figures = {
            "parallel": (
                parallel_coordinates([_line(run, swept) for run in runs]),
                "Settings and outcomes, a line a run",
            ),
            "front": (
                front_of_runs([_point(run, swept) for run in runs]),
                "Mean inspection rate over mean delta-v",
            ),
        }
        drawn = {
            name: inline(save(figure, name, DOTS_PER_INCH).svg, name, words)
            for name, (figure, words) in figures.items()
        }
    return {name: Markup(element) for name, element in drawn.items()}  # noqa: S704 - escaped where it is drawn


def _line(run: Run, swept: Swept) -> Line:
    settings = {key: run.differs.get(key, "") for key in swept.factors}
    outcomes = {f"{metric.label} ({metric.unit})": run.values[metric.name].value for metric in METRICS}
    return Line(run.name, settings, outcomes, run in swept.front)


def _point(run: Run, swept: Swept) -> Point:
    spent, rate = run.values["delta_v_m_s"], run.values["inspection_rate_percent"]
    return Point(
        run.name, (spent.value, spent.low, spent.high), (rate.value, rate.low, rate.high), run in swept.front
    )
