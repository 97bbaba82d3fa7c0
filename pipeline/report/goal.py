"""The page of a run whose flights must reach a goal, and its picture: how fast they are, and how near."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from fis_tools.document import Block, Code, Document, Figure, Heading, Paragraph, Table
from fis_tools.document.html import element, page
from pipeline.evaluation import comparison
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.goals.reach import ends, limit_at
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.report import comparisons
from pipeline.report.contents import Contents
from pipeline.report.figures import style
from pipeline.settings.experiment import Mission

#: columns of an evaluation and shares of its flights, each with its words and, of columns, decimals
MEASURES: Mapping[str, tuple[str, int]] = {
    "delta_v_m_s": ("Δv until the end (m/s)", 3),
    "end_s": ("time of the end (s)", 0),
    "end_speed_m_s": ("speed at the end (m/s)", 4),
    "excess_m_s": ("greatest speed above the limit (m/s)", 4),
    "mean_distance_m": ("mean distance (m)", 1),
}
SHARES = {SUCCESS: "the goal is reached", "violated": "a failure on the way", "held": "never above the limit"}
COLOURS = ".document { --blue: light-dark(#0072b2, #4ea9e3); --vermilion: light-dark(#d55e00, #ff8b45); }"
#: of the columns of a comparison, those that are not about points, plans and the safety layer
OF_TABLE = (0, 1, 2, 4, 5)
#: flights in the picture
MOST_DRAWN = 200
CAPTION = (
    "Speed over distance of the first flights of the evaluation, each up to its end at the goal (dotted); "
    "the dashed line is the limit. Flights come from the right; above the line they are too fast."
)


def write(contents: Contents, illustrations: Mapping[str, style.Illustration]) -> str:
    """Write the page."""
    title = contents.experiment.report.title
    return page(Document([Heading(title, 1), *_blocks(contents, illustrations)]), COLOURS)


def _blocks(contents: Contents, illustrations: Mapping[str, style.Illustration]) -> Iterator[Block]:
    experiment, summary = contents.experiment, contents.evaluation.summary if contents.evaluation else None
    who = f"The controller {contents.controller.name}" if contents.controller else "No controller"
    if summary:
        yield Paragraph(lead(who, summary, experiment.mission))
        yield Heading("Results", id="results")
        heads = ["", "mean ± standard deviation", "least", "greatest"]
        yield Table(heads, list(_means(summary)), numbers=(1, 2, 3))
        heads = ["of the flights", "share", f"{summary['confidence_percent']:g} % interval"]
        yield Table(heads, list(_shares(summary)), numbers=(1, 2))
    for illustration in illustrations.values():
        caption = element("figcaption", illustration.caption)
        yield Figure(element("figure", Markup(illustration.element), caption))  # noqa: S704 - drawn here
    for sun, lines in comparisons.tables_of(contents.comparison):
        heads, *rows = ([line[place] for place in OF_TABLE] for line in (comparison.HEADINGS, *lines))
        yield Table(
            heads, rows, caption=f"Controllers from the same starts, Sun {sun}.", numbers=(1, 2, 3, 4)
        )
    if contents.recordings:
        yield Heading("Recorded flights", id="recordings")
        yield Paragraph("Watch one, from the folder of the run:")
        yield Code("\n".join(f"python -m telemetry replay {name}" for name in contents.recordings))
    yield Heading("Provenance", id="provenance")
    if contents.command:
        yield Code(contents.command)
    for name, value in (contents.manifest or {}).items():
        if name in ("config_hash", "seed", "git_revision"):
            yield Paragraph(f"{name}: {value}")


def lead(who: str, summary: Mapping[str, Any], mission: Mission) -> str:
    """Say in a sentence or two what came out."""
    problem, spent, end, speed = mission.problem, *(summary[name] for name in list(MEASURES)[:3])
    reached, held = (100 * summary[name]["fraction"] for name in (SUCCESS, "held"))
    return (
        f"{who}, flown from {summary['num_cases']:,} starts, comes within {problem.goal_radius_m:g} m of the "
        f"chief, no faster than {problem.goal_speed_m_s:g} m/s, in {reached:.1f} % of the flights. They end "
        f"after {end['mean']:.0f} s in the mean, at {speed['mean']:.4f} m/s, and spend {spent['mean']:.3f} ± "
        f"{spent['standard_deviation']:.3f} m/s. {held:.1f} % are never above the limit on the speed after "
        "their start."
    )


def _means(summary: Mapping[str, Any]) -> Iterator[list[str]]:
    for name, (words, places) in MEASURES.items():
        of = summary[name]
        ends_at = (f"{of[end]:.{places}f}" for end in ("minimum", "maximum"))
        yield [words, f"{of['mean']:.{places}f} ± {of['standard_deviation']:.{places}f}", *ends_at]


def _shares(summary: Mapping[str, Any]) -> Iterator[list[str]]:
    for name, words in SHARES.items():
        of = summary[name]
        between = f"{100 * of['low']:.2f} to {100 * of['high']:.2f} %"
        yield [words, f"{100 * of['fraction']:.2f} %", between]


def draw(contents: Contents) -> Iterator[style.Illustration]:
    """Draw speed over distance of the first flights of an evaluation."""
    experiment, controller = contents.experiment, contents.controller
    if contents.evaluation is None or controller is None:
        return
    shown = range(min(MOST_DRAWN, experiment.monte_carlo.num_cases))
    starts = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed, shown)
    mission = experiment.mission
    tracks = np.empty((len(starts), mission.num_controls + 1, NUM_TRACKED), dtype=np.float32)
    fly_all(mission, controller, starts, experiment.monte_carlo.workers, tracks)
    distance, speed = (
        np.linalg.norm(tracks[..., first : first + 3], axis=-1).astype(np.float64) for first in (0, 3)
    )
    last, _, _ = ends(mission.problem, distance, speed)
    with style.style():
        figure = style.Figure(figsize=(8.0, 4.4), layout="constrained")
        ax = figure.add_subplot()
        for row, end in enumerate(last):
            ax.plot(
                distance[row, : end + 1], speed[row, : end + 1], color=style.BLUE, linewidth=0.6, alpha=0.5
            )
        far = np.geomspace(mission.problem.goal_radius_m, distance[:, 0].max())
        ax.plot(far, limit_at(mission.problem, far), color=style.VERMILION, linestyle="--", label="limit")
        ax.axvline(mission.problem.goal_radius_m, color=style.INK, linestyle=style.DOTS, label="goal")
        ax.set(xlabel="distance from the chief (m)", ylabel="speed (m/s)", xscale="log", ylim=(0.0, None))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.legend(loc="upper left")
        yield style.illustrate("approach", CAPTION, figure, experiment.report.dots_per_inch)
