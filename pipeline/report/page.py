"""The page of a report: what it says in words and tables, put into the template; another one with a goal."""

from collections.abc import Iterator, Mapping
from typing import Any

from fis_tools.words.text import summary
from pipeline.evaluation import comparison
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import Columns
from pipeline.report import comparisons, fleets
from pipeline.report.contents import Contents, FlightSet
from pipeline.report.facts import facts_of, outcome_in_words
from pipeline.report.figures.style import MOST_POINTS, Illustration, caption_of
from pipeline.report.played import compared_in, player_of_comparison, shown_of
from pipeline.report.played_fleets import WHY
from pipeline.run import artifacts, typed
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.keys import TAGS
from pipeline.settings.start_table import POSITION
from plain_files.document import Block, Code, Document, Heading, Paragraph, Table
from plain_files.document.html import ScriptedPanel, page, policy, template

INSPECTABLE = "inspectable_rate_percent"
#: metrics of the summary with their decimals, and shares of flights
MEANS = (
    ("delta_v_m_s", 3, "Δv (m/s)"),
    ("inspection_rate_percent", 2, "inspection rate (%)"),
    (INSPECTABLE, 2, "of what can be inspected (%)"),
    ("mean_distance_m", 2, "mean distance (m)"),
)
#: what the manifest says of how a run was started: to be read, not to be typed
TYPED = "It was started, by whoever made this folder, with these words"
#: of many training flights only so many have a row of their own
MOST_ROWS = 64


def write(contents: Contents, illustrations: Mapping[str, Illustration], player: ScriptedPanel | None) -> str:
    """Write the page.

    Parameters
    ----------
    contents : Contents
    illustrations : mapping of str to Illustration
    player : ScriptedPanel, optional
        Of the run's flights; a comparison has one of its own.

    Returns
    -------
    str
        HTML that needs no other file, and leads to the review page beside it.
    """
    experiment, rows = contents.experiment, contents.comparison
    mission = experiment.mission
    scene = player_of_comparison(contents) if contents.is_comparison else player
    if mission.problem.kind == "reach":
        heading = Heading(experiment.report.title, 1)
        shown = [heading, *_towards_goal(contents, illustrations)]
        if words := _words_of_player(contents, scene):
            shown += [Heading("Flights", id="flights"), Paragraph(words)]
        return page(Document(shown), COLOURS, scene if isinstance(scene, ScriptedPanel) else None)
    says, scene = _words_of_player(contents, scene), scene if isinstance(scene, ScriptedPanel) else None
    has_unseen = any(has_uninspectable(flights.summary) for _, flights, _ in contents.sets)
    return template("pipeline.report", "templates", "report.html").render(
        typed=typed,
        TYPED=TYPED,
        policy=policy(scripts=scene.scripts if scene else (), flies=scene is not None),
        scene=scene,
        says=says,
        contents=contents,
        experiment=experiment,
        success=SUCCESS,
        means=_means(mission, has_unseen),
        fleet=mission.fleet if mission.has_fleet else None,
        fleets=fleets,
        shares=(("success", "inspect"), ("violated", "outside"), (SUCCESS, "success")),
        confidence=f"{experiment.monte_carlo.confidence_percent:g}",
        limits=f"{mission.deputy.min_distance_m:g} to {mission.deputy.max_distance_m:g} m",
        threshold=f"{mission.inspection_threshold_percent:g}",
        start_name="".join(flight.name for flight in contents.shown if flight.is_alone and not flight.fleet),
        flights=[facts for flight in contents.shown for facts in facts_of(flight, mission)],
        outcome_in_words=outcome_in_words,
        has_uninspectable=has_uninspectable,
        has_unseen=has_unseen,
        cases=case_rows(contents.training),
        compared=comparison,
        comparison=comparisons.tables_of(rows),
        published=any(row.source == comparison.PUBLISHED for row in rows),
        worlds=comparison.matrices(rows) if comparison.worlds_of(rows) else [],
        optimum_cases=comparisons.optimum_rows(contents.beside),
        front=front_rows(contents.front),
        has_crowd=bool(contents.training and contents.training.summary["num_cases"] > MOST_POINTS),
        summary=summary,
        illustrations=illustrations,
        artifacts=artifacts,
    )


def _left_out(experiment: Experiment) -> str:
    """Return in words which flights of a comparison its page has no room for; empty if it has all."""
    shown, compare = shown_of(experiment), experiment.compare
    if len(shown) == len(compare.controllers) * len(compare.safety):
        return ""
    count = f"{len(shown)} of {len(compare.controllers)} controllers"
    return f" The page has room for {count} with safety={compare.safety[0]}."


def _words_of_player(contents: Contents, player: ScriptedPanel | str | None) -> str:
    """Return what a page says of the flights that it plays, or why it plays none; empty if it has none."""
    if isinstance(player, str):
        return f"No flight opens here: {player}."
    if player is None or not (contents.is_comparison or contents.evaluation):
        return ""
    has_fleet = contents.experiment.mission.has_fleet
    if contents.is_comparison:
        world, sun = compared_in(contents.experiment)
        there = [f"in the world {world}"] if world else []
        there += [f"under the Sun {sun}"] if len(contents.experiment.compare.suns) > 1 else []
        where = f" The flights are those {' '.join(there)}." if there else ""
        words = caption_of("fleets_side_by_side" if has_fleet else "side_by_side", why=WHY)
        return words + where + _left_out(contents.experiment)
    return caption_of("flights_of_fleets" if has_fleet else "flights_to_goal", why=WHY)


def _means(mission: Mission, has_unseen: bool) -> list[tuple[str, int, str]]:
    """Return the metrics of the summary, with their decimals and words."""
    words = {"delta_v_m_s": "Δv of all (m/s)"} if mission.has_fleet else {}
    shown = (measure for measure in MEANS if has_unseen or measure[0] != INSPECTABLE)
    return [(name, decimals, words.get(name, label)) for name, decimals, label in shown]


def has_uninspectable(flown: Mapping[str, Any]) -> bool:
    """Return whether the flights of a summary had points that no flight could inspect."""
    return INSPECTABLE in flown and flown[INSPECTABLE]["mean"] != flown["inspection_rate_percent"]["mean"]


def case_rows(training: FlightSet | None) -> list[list[str]]:
    """Return the headings of a table of training flights, and their rows; nothing if there are too many."""
    if training is None or training.episodes is None or len(training.episodes["case"]) > MOST_ROWS:
        return []
    start = ", ".join(f"{{{name}:.1f}}" for name in POSITION)
    columns = {
        "case": "{case:.0f}",
        **({} if training.is_of_fleets else {"start, Hill axes (m)": start}),  # each deputy has its own
        "Sun (deg)": "{sun_deg:.1f}",
        "Δv of all (m/s)" if training.is_of_fleets else "Δv (m/s)": "{delta_v_m_s:.3f}",
        "rate (%)": "{inspection_rate_percent:.2f}",
        "distance: mean (m)": "{mean_distance_m:.2f}",
        **dict(zip(("extremes (m)", "outcome"), comparisons.ENDED, strict=True)),
    }
    numbers, cells = range(len(training.episodes["case"])), list(columns.values())
    rows = comparisons.rows_in_words(training.episodes, numbers, cells)
    return [list(columns), *([cell.replace("-", "−") for cell in row] for row in rows)]


#: of a front's table on the page: heading, and how a value is written
FRONT_HEADINGS: Mapping[str, str] = {
    "NN": "{controller:02.0f}",
    "Δv (m/s)": "{delta_v_m_s:.3f}",
    "rate (%)": "{inspection_rate_percent:.2f}",
    "success (%)": "{success_percent:.1f}",
    "outside (%)": "{outside_percent:.2f}",
    "cost (m/s)": "{fitness_m_s:.3f}",
}


def front_rows(front: Columns | None) -> list[list[str]]:
    """Return the headings of a front's table, and a row for each controller; nothing without a front."""
    if front is None:
        return []
    rows = [dict(zip(front, values, strict=True)) for values in zip(*front.values(), strict=True)]
    return [
        [*FRONT_HEADINGS, "standing"],
        *(
            [
                *(cell.format(**row) for cell in FRONT_HEADINGS.values()),
                "handed back" if row["handed_back"] else "" if row["stands"] else "beaten by another",
            ]
            for row in rows
        ),
    ]


#: columns of an evaluation and shares of its flights, each with its words and, of columns, decimals
MEASURES: Mapping[str, tuple[str, int]] = {
    "delta_v_m_s": ("Δv until the end (m/s)", 3),
    "end_s": ("time of the end (s)", 0),
    "end_speed_m_s": ("speed at the end (m/s)", 4),
    "excess_m_s": ("greatest speed above the limit (m/s)", 4),
    "mean_distance_m": ("mean distance (m)", 1),
}
OUTCOMES = {
    SUCCESS: "the goal is reached",
    "violated": "a failure on the way",
    "held": "never above the limit",
}
COLOURS = ".document { --blue: light-dark(#0072b2, #4ea9e3); --vermilion: light-dark(#d55e00, #ff8b45); }"
#: of the columns of a comparison, those that are not about points, plans and the safety layer
OF_TABLE = (0, 1, 2, 4, 5)


def _towards_goal(contents: Contents, illustrations: Mapping[str, Illustration]) -> Iterator[Block]:
    """Return the results of flights that must reach a goal: speeds and distances."""
    experiment, summary = contents.experiment, contents.evaluation.summary if contents.evaluation else None
    who = f"The controller {contents.controller.name}" if contents.controller else "No controller"
    if summary:
        yield Paragraph(lead(who, summary, experiment.mission))
        yield from _results(summary)
    yield from (illustration.block for illustration in illustrations.values())
    for sun, _, _ in comparisons.tables_of(contents.comparison):
        lines = comparison.lines_of(contents.comparison, sun)
        heads, *rows = ([line[column] for column in OF_TABLE] for line in (comparison.HEADINGS, *lines))
        words = " ".join(comparison.describe_columns(experiment))
        yield Table(heads, rows, caption=f"Controllers from the same starts: {words}", numbers=(1, 2, 3, 4))
    if rows := front_rows(contents.front):
        yield Table(
            rows[0], rows[1:], caption=caption_of("front_of_training"), numbers=range(len(FRONT_HEADINGS))
        )
    if contents.recordings:
        yield Heading("Recorded flights", id="recordings")
        yield Paragraph("Watch one, from the folder of the run:")
        yield Code("\n".join(map(typed.replay, contents.recordings)))
    yield Heading("Provenance", id="provenance")
    yield Paragraph("The same run again, where RUN is its folder:")
    yield Code(typed.again(typed.RUN))
    if contents.command:
        yield Paragraph(f"{TYPED}:")
        yield Code(contents.command)
    for name, value in contents.manifest.items():
        if name in ("config_hash", "seed", "git_revision"):
            yield Paragraph(f"{name}: {value}")
    for name, tag in contents.manifest.get(TAGS, {}).items():
        yield Paragraph(f"{TAGS}.{name}: {tag}")


def lead(who: str, summary: Mapping[str, Any], mission: Mission) -> str:
    """Return the result of the run in a sentence or two."""
    reached, held = (100 * summary[name]["fraction"] for name in (SUCCESS, "held"))
    shares = {"reached": reached, "held": held, "spent": comparison.spread(summary["delta_v_m_s"], 3)}
    return caption_of("goal", who=who, summary=summary, problem=mission.problem, **shares)


def _results(summary: Mapping[str, Any]) -> Iterator[Block]:
    """Return means, extremes and shares of the flights."""
    yield Heading("Results", id="results")
    heads = ["", "mean ± standard deviation", "least", "greatest"]
    means = []
    for name, (words, decimals) in MEASURES.items():
        ends = (f"{summary[name][end]:.{decimals}f}" for end in ("minimum", "maximum"))
        means.append([words, comparison.spread(summary[name], decimals), *ends])
    yield Table(heads, means, numbers=(1, 2, 3))
    heads = ["of the flights", "share", f"{summary['confidence_percent']:g} % interval"]
    shares = []
    for name, words in OUTCOMES.items():
        share, low, high = (f"{100 * summary[name][part]:.2f}" for part in ("fraction", "low", "high"))
        shares.append([words, f"{share} %", f"{low} to {high} %"])
    yield Table(heads, shares, numbers=(1, 2))
