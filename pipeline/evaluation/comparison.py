"""Controllers side by side, in one world or several: a row for each, as data and in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation import statistics
from pipeline.evaluation.after import Aftermath
from pipeline.evaluation.beside_optimum import times_in_words
from pipeline.evaluation.monte_carlo import SUCCESS, summarise
from pipeline.evaluation.paired import shown
from pipeline.evaluation.papers import is_papers_test
from pipeline.evaluation.statistics import Fraction, Statistic
from pipeline.flight.state.log import points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.optimum.solved import Solved
from pipeline.settings.experiment import Experiment
from plain_files.document import Block, Document, Heading, Paragraph, Table, text

Column = NDArray[Any]

#: of verdicts, where a run does not say
CONFIDENCE_PERCENT = 95.0
#: whose results stand beside ours: summaries of its training and test
PAPER_NAME = "Choi, Kim and Leeghim, AAS 25-727"


@dataclass(frozen=True)
class Reported:
    """A row of the paper: means and standard deviations, by the names in our summaries."""

    label: str
    num_cases: int
    means: dict[str, float]
    standard_deviations: dict[str, float]


def _reported(label: str, num_cases: int, *measures: tuple[float, float, float]) -> Reported:
    """Return a published row: means, then standard deviations, of delta-v, rate and distance."""
    names = ("delta_v_m_s", "inspection_rate_percent", "mean_distance_m")
    return Reported(label, num_cases, *(dict(zip(names, numbers, strict=True)) for numbers in measures))


PAPER_TRAINING = _reported("training", 8, (4.799, 99.748, 67.030), (0.458, 0.468, 1.280))
PAPER_TEST = _reported("test", 1000, (5.62, 96.667, 66.629), (0.715, 3.919, 1.039))

FLOWN, PUBLISHED, PLANNED = "flown", "published", "plans of least fuel"

#: parts of a mean ratio
ENDS = ("mean", "low", "high")
#: columns of ``compare/table.csv``: of a row itself, of its times the optimum, of parts of its summary
ROW_FIELDS = ("controller", "source", "world", "sun", "safety", "num_cases", "rules")
TIMES = (
    *(
        f"{name}_{part}"
        for name in ("times_optimum", "times_optimum_as_seen", "times_bound")
        for part in ENDS
    ),
    "solved_cases",
)
MEANS = (
    "delta_v_m_s",
    "inspection_rate_percent",
    "mean_distance_m",
    "safety_delta_v_m_s",
    "ahead_delta_v_m_s",
)
SHARES = ("success", SUCCESS, "violated", "safety_acted", *Aftermath._fields)
HEADER = (
    *(*ROW_FIELDS, *TIMES),
    *(f"{name}_{field.name}" for name in MEANS for field in fields(Statistic)),
    *(f"{name}_{field.name}" for name in SHARES for field in fields(Fraction)),
)


@dataclass(frozen=True)
class ComparisonRow:
    """A controller under one Sun setting and one safety layer.

    Parameters
    ----------
    controller : str
    source : str
        `FLOWN`, `PUBLISHED` (quoted) or `PLANNED` (computed with the whole flight known, for other cases).
    sun : str
        Its setting; empty if none is stated.
    safety : str
        ``none`` or ``filter``.
    num_cases : int
    rules : int, optional
        None for controllers without rules.
    summary : mapping
        Of `pipeline.evaluation.monte_carlo.summarise`, or the known part of it.
    times : mapping, optional
        Of `pipeline.evaluation.beside_optimum.summarise_times`.
    world : str
        Its name in ``compare.worlds``; empty for the experiment's own.
    """

    controller: str
    source: str
    sun: str
    safety: str
    num_cases: int
    rules: int | None
    summary: Mapping[str, Any]
    times: Mapping[str, Any] | None = None
    world: str = ""


def planned_row(experiment: Experiment, solved: Solved) -> ComparisonRow:
    """Return the row of the minimum-fuel plans."""
    cases, mission = solved.cases, experiment.mission
    inspectable = cases.get("inspectable_count", np.int64(len(inspection_points(mission))))
    needed = points_needed(inspectable, mission.inspection_threshold_percent)
    ended = {"success": cases["inspected_count"] >= needed, "violated": cases["outside_m"] > 0.0}
    summary = summarise({**cases, **ended}, experiment.monte_carlo.confidence_percent)
    return ComparisonRow("optimum", PLANNED, experiment.sun.mode, "none", len(cases["case"]), None, summary)


def published_row(reported: Reported) -> ComparisonRow:
    """Return a row of published means and standard deviations."""
    spreads = reported.standard_deviations
    summary = {
        name: {"mean": mean, "standard_deviation": spreads[name]} for name, mean in reported.means.items()
    }
    return ComparisonRow("the paper", PUBLISHED, "", "none", reported.num_cases, None, summary)


def row_of(entry: Mapping[str, Any]) -> ComparisonRow:
    """Return the row from plain data.

    Raises
    ------
    KeyError, TypeError
        If it is something else.
    """
    # earlier versions had no worlds
    known = {"world": "", **entry}
    return ComparisonRow(**{field.name: known[field.name] for field in fields(ComparisonRow)})


def as_cells(row: ComparisonRow) -> list[Any]:
    """Return the cells of a row of ``compare/table.csv``; empty where unknown."""
    cells = {name: getattr(row, name) for name in ROW_FIELDS}
    if row.times:
        for name in ("times_optimum", "times_optimum_as_seen", "times_bound"):
            # those of earlier versions have no intervals, nor bounds
            cells |= {f"{name}_{part}": (row.times.get(name) or {}).get(part) for part in ENDS}
        cells["solved_cases"] = row.times["num_cases"]
    for name in (*MEANS, *SHARES):
        cells |= {f"{name}_{part}": value for part, value in row.summary.get(name, {}).items()}
    return ["" if cells.get(name) is None else cells[name] for name in HEADER]


def concatenate(parts: Sequence[tuple[ComparisonRow, Mapping[str, Column]]]) -> dict[str, Column]:
    """Concatenate the flights of several rows, with its names; NaN where it has no such column."""
    names = dict.fromkeys(name for _, episodes in parts for name in episodes)
    columns: dict[str, Column] = {
        key: np.concatenate([np.full(row.num_cases, getattr(row, key)) for row, _ in parts])
        for key in ("controller", "world", "sun", "safety")
    }
    for name in names:
        values = [episodes.get(name, np.full(row.num_cases, np.nan)) for row, episodes in parts]
        columns[name] = np.concatenate(values)
    return columns


#: of the table in words; all columns but the first are of numbers
HEADINGS = (
    *(
        "controller",
        "rules",
        "delta-v (m/s)",
        "rate (%)",
        "successful (%)",
        "outside (%)",
        "stays / passively safe (%)",
        "times the best plans",
        "times the bound",
    ),
    *("layer: outside (%)", "layer: delta-v (m/s)", "layer: acted in (%)"),
)


def after_in_words(row: ComparisonRow) -> str:
    """Return which flights stay an orbit without thrust, and are passively safe, in per cent; or nothing."""
    names = ("stays_orbit", "passively_safe")
    if not all(name in row.summary for name in names):  # of earlier versions, and published rows
        return ""
    return " / ".join(f"{100 * row.summary[name]['fraction']:.0f}" for name in names)


def cells_in_words(row: ComparisonRow, guarded: ComparisonRow | None) -> list[str]:
    """Return a line of the table; of a row flown with and without the safety layer, both results."""
    mark = "*" if row.source == PUBLISHED else f", {row.num_cases} cases" if row.source == PLANNED else ""
    layer = ["", "", ""]
    if guarded is not None:
        layer = [share(guarded, "violated"), fuel_in_words(guarded.summary), share(guarded, "safety_acted")]
    return [
        row.controller + mark,
        "-" if row.rules is None else str(row.rules),
        fuel_in_words(row.summary),
        rate(row),
        share(row, SUCCESS),
        share(row, "violated"),
        after_in_words(row),
        *(times_in_words((row.times or {}).get(name), 1) for name in ("times_optimum", "times_bound")),
        *layer,
    ]


def spread(measure: Mapping[str, float | None], decimals: int) -> str:
    """Return a mean with its standard deviation, of a part of a summary; of one flight, the mean alone."""
    mean, deviation = measure["mean"], measure["standard_deviation"]
    return f"{mean:.{decimals}f}" if deviation is None else f"{mean:.{decimals}f} ± {deviation:.{decimals}f}"


def fuel_in_words(summary: Mapping[str, Any]) -> str:
    """Return the delta-v of a summary, with the share that rules fired where they do not fire all."""
    return spread(summary["delta_v_m_s"], 3) + by_rules(summary)


def percent_ahead(summary: Mapping[str, Any]) -> float:
    """Return which share of the fuel was chosen ahead, by foresight or rehearsals, in per cent."""
    names = "delta_v_m_s", "ahead_delta_v_m_s"
    return statistics.percent_ahead(*(summary.get(name, {"mean": 0.0})["mean"] for name in names))


def by_rules(summary: Mapping[str, Any]) -> str:
    """Return which share of the fuel rules fired, in words; nothing where no push was chosen ahead."""
    return statistics.by_rules(percent_ahead(summary))


def rate(row: ComparisonRow) -> str:
    """Return the inspection rate, and that of the points that are ever lit if some are not."""
    measure, of_lit = row.summary["inspection_rate_percent"], row.summary.get("inspectable_rate_percent")
    words = spread(measure, 2)
    if of_lit is None or of_lit["mean"] == measure["mean"]:
        return words
    return f"{words}, of lit {of_lit['mean']:.2f}"


def share(row: ComparisonRow, name: str) -> str:
    """Return a share of cases in per cent with its interval; empty if unknown."""
    measure = row.summary.get(name)
    if measure is None:
        return ""
    return f"{100 * measure['fraction']:.1f} ({100 * measure['low']:.1f}-{100 * measure['high']:.1f})"


def lines_of(rows: Sequence[ComparisonRow], sun: str) -> list[list[str]]:
    """Return the table of one Sun setting in words: published results first, one line per controller."""
    of_sun = [row for row in rows if row.sun in (sun, "")]
    guarded = {row.controller: row for row in of_sun if row.safety != "none"}
    plain = [row for row in of_sun if row.safety == "none"]
    # controllers that were flown only with the layer
    names = {row.controller for row in plain}
    only = [row for row in of_sun if row.controller not in names]
    lines = [cells_in_words(row, guarded.get(row.controller)) for row in plain]
    for row in only:
        blank = cells_in_words(row, row)
        lines.append([*blank[:2], "", blank[3], blank[4], "", *blank[6:]])
    return lines


def table_of(rows: Sequence[ComparisonRow], sun: str) -> tuple[list[str], list[list[str]]]:
    """Return the headings and lines of one Sun setting, of the columns that tell something."""
    lines = lines_of(rows, sun)
    used = [column for column in range(len(HEADINGS)) if any(line[column] for line in lines)]
    return [HEADINGS[column] for column in used], [[line[column] for column in used] for line in lines]


def suns_of(rows: Sequence[ComparisonRow]) -> list[str]:
    """Return the Sun settings of some rows, in order."""
    return list(dict.fromkeys(row.sun for row in rows if row.sun))


def format_comparison(rows: Sequence[ComparisonRow]) -> str:
    """Write the table as plain text, one section per Sun setting."""
    blocks: list[Block] = []
    for sun in suns_of(rows):
        heads, lines = table_of(rows, sun)
        blocks += [Heading(f"Sun {sun}"), Table(heads, lines, numbers=range(1, len(heads)))]
    return text.write(Document(blocks))


def describe_columns(experiment: Experiment) -> list[str]:
    """Describe the columns of the table in a sentence or two."""
    cases, deputy = experiment.monte_carlo, experiment.mission.deputy
    flown = (
        f"{cases.num_cases:,} cases of seed {experiment.seed}; mean ± standard deviation; "
        f"shares with {cases.confidence_percent:g} % Wilson intervals; "
    )
    if experiment.mission.problem.kind == "reach":
        return [f"{flown}successful: the goal is reached; outside: a crash there, or too fast for too long."]
    judged = (
        f"{flown}successful: at least {experiment.mission.inspection_threshold_percent:g} % of the points, "
        f"inside the limits; outside: {deputy.min_distance_m:g} to {deputy.max_distance_m:g} m left; stays: "
        "inside them for an orbit after the end, if nothing more is fired; passively safe: after no failure "
        f"of all thrusters nearer than {deputy.min_distance_m:g} m within an orbit."
    )
    if (fleet := experiment.mission.fleet).deputies > 1:
        return [f"{judged} {OF_FLEETS.format(fleet.deputies)}"]
    published = f"*published ({PAPER_NAME}), with the same distance limits; its Sun is not stated. "
    return [
        judged,
        f"{published if is_papers_test(experiment) else ''}The best plans "
        "found know the whole flight beforehand, and are of other cases; the bound is what every plan burns "
        f"at least. Both ratios are means over these cases with {cases.confidence_percent:g} % bootstrap "
        "intervals.",
    ]


#: what a comparison of fleets counts
OF_FLEETS = (
    "Fleets of {} deputies: delta-v is that of all, a point counts once; outside: of one deputy at least; "
    "stays, passively safe: of all."
)
#: contents of a cell of the table
LEGEND = "successful inside the limits (%) / delta-v (m/s) / outside (%) / stays an orbit (%)"


def worlds_of(rows: Sequence[ComparisonRow]) -> list[str]:
    """Return the worlds of some rows, in order; empty if all flew in the experiment's own."""
    return list(dict.fromkeys(row.world for row in rows if row.source == FLOWN and row.world))


def _cell(row: ComparisonRow) -> str:
    """Return a flown row as success (%), mean delta-v (m/s), and shares outside and staying (%)."""
    success, outside = (100 * row.summary[name]["fraction"] for name in (SUCCESS, "violated"))
    spent = f"{row.summary['delta_v_m_s']['mean']:.2f}{by_rules(row.summary)}"
    stays = row.summary.get("stays_orbit")  # missing in earlier versions
    return f"{success:.0f} / {spent} / {outside:.0f}" + (f" / {100 * stays['fraction']:.0f}" if stays else "")


def matrices(rows: Sequence[ComparisonRow]) -> list[tuple[str, str, list[list[str]]]]:
    """Return the tables of all Suns and layers: Sun, layer, and lines.

    The first line holds names; then there is a line per world, with a column per controller, see `LEGEND`.
    """
    flown = [row for row in rows if row.source == FLOWN]
    tables = []
    for sun, layer in dict.fromkeys((row.sun, row.safety) for row in flown):
        chosen = [row for row in flown if (row.sun, row.safety) == (sun, layer)]
        names = list(dict.fromkeys(row.controller for row in chosen))
        cells = {(row.world, row.controller): _cell(row) for row in chosen}
        lines = [[world, *(cells.get((world, name), "") for name in names)] for world in worlds_of(chosen)]
        tables.append((sun, layer, [["world", *names], *lines]))
    return tables


def worse_p_values(row: ComparisonRow, first: ComparisonRow) -> list[float]:
    """Return the p-values of not succeeding less often than in another world, and of not leaving more often.

    By Fisher's exact test of two shares, one-sided (J. R. Stat. Soc. 98, 1935).
    """
    from scipy.stats import hypergeom  # noqa: PLC0415 - slower to import than a thousand flights

    total = row.num_cases + first.num_cases
    (won, left), (won_first, left_first) = (
        [int(of.summary[name]["count"]) for name in (SUCCESS, "violated")] for of in (row, first)
    )
    fewer = hypergeom.cdf(won, total, won + won_first, row.num_cases)
    more = hypergeom.sf(left - 1, total, left + left_first, row.num_cases)
    return [float(fewer), float(more)]


def broken_worlds(
    rows: Sequence[ComparisonRow], confidence_percent: float = CONFIDENCE_PERCENT
) -> set[tuple[str, str, str, str]]:
    """Return the Suns, layers, controllers and worlds in which they are shown to do worse than in the first.

    However many are compared, none of them is due to chance alone, with the confidence (Holm's method).
    """
    of_controllers: dict[tuple[str, str, str], list[ComparisonRow]] = {}
    for row in (row for row in rows if row.source == FLOWN):
        of_controllers.setdefault((row.sun, row.safety, row.controller), []).append(row)
    pairs = [(row, group[0]) for group in of_controllers.values() for row in group[1:]]
    p_values = [p_value for pair in pairs for p_value in worse_p_values(*pair)]
    is_shown = iter(shown(p_values, confidence_percent))
    are_broken = [any(both) for both in zip(is_shown, is_shown, strict=True)]
    return {place_of(row) for (row, _), is_broken in zip(pairs, are_broken, strict=True) if is_broken}


def place_of(row: ComparisonRow) -> tuple[str, str, str, str]:
    """Return the Sun, layer, controller and world of a row."""
    return row.sun, row.safety, row.controller, row.world


def verdicts(rows: Sequence[ComparisonRow], confidence_percent: float = CONFIDENCE_PERCENT) -> list[str]:
    """Return for each controller, Sun and layer a line on where it fails, and the cost of the last world."""
    lines, are_broken = [], broken_worlds(rows, confidence_percent)
    flown = [row for row in rows if row.source == FLOWN]
    for sun, layer, controller in dict.fromkeys((row.sun, row.safety, row.controller) for row in flown):
        first, *others = [
            row for row in flown if (row.sun, row.safety, row.controller) == (sun, layer, controller)
        ]
        if not others:
            continue
        broken = [f'"{row.world}"' for row in others if place_of(row) in are_broken]
        spent, least = (row.summary["delta_v_m_s"]["mean"] for row in (others[-1], first))
        cost = f'; "{others[-1].world}": {100 * (spent / least - 1):+.0f} % delta-v' if least > 0.0 else ""
        none = f"no break shown by {first.num_cases:,} cases"
        where = f"breaks in {', '.join(broken)}" if broken else none
        lines.append(f"{controller}, Sun {sun}, layer {layer}: {where}{cost}")
    return lines


def format_worlds(rows: Sequence[ComparisonRow], confidence_percent: float = CONFIDENCE_PERCENT) -> str:
    """Return the tables as plain text, and which controllers hold."""
    parts = []
    for sun, layer, lines in matrices(rows):
        heads, *rows_told = lines
        title = Paragraph(f"Sun {sun}, safety layer {layer}: {LEGEND}:")
        parts.append(text.write(Document([title, Table(heads, rows_told)])))
    return "\n".join([*parts, *verdicts(rows, confidence_percent)])
