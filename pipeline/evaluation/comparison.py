"""Controllers side by side: a row for each controller, Sun and safety layer, as data and in words."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.document import Block, Document, Heading, Table, text
from pipeline.evaluation.monte_carlo import SUCCESS, summarise
from pipeline.evaluation.statistics import Fraction, Statistic
from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import points_needed
from pipeline.optimum.solved import Solved

Column = NDArray[Any]

FLOWN, PUBLISHED, PLANNED = "flown", "published", "plans of least fuel"

#: parts of a row's summary in ``compare/table.csv``
MEANS = ("delta_v_m_s", "inspection_rate_percent", "mean_distance_m", "safety_delta_v_m_s")
SHARES = ("success", SUCCESS, "violated", "safety_acted")
HEADER = (
    *(
        "controller",
        "source",
        "world",
        "sun",
        "safety",
        "num_cases",
        "rules",
        "times_optimum_mean",
        "times_optimum_as_seen_mean",
        "solved_cases",
    ),
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
        Of `pipeline.optimum.solved.summarise_times`.
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


def rules_of(controller: Controller) -> int | None:
    """Return the number of rules of a controller; None if it has none."""
    return sum(len(system.rules) for system in controller.systems) or None


def planned_row(
    solved: Solved, sun: str, num_points: int, threshold: float, confidence: float
) -> ComparisonRow:
    """Return the row of the minimum-fuel plans."""
    cases = solved.cases
    episodes = {
        **cases,
        "success": cases["inspected_count"]
        >= points_needed(cases.get("inspectable_count", np.int64(num_points)), threshold),
        "violated": cases["outside_m"] > 0.0,
    }
    return ComparisonRow(
        "optimum", PLANNED, sun, "none", len(cases["case"]), None, summarise(episodes, confidence)
    )


def published_row(
    name: str, num_cases: int, means: Mapping[str, float], spreads: Mapping[str, float]
) -> ComparisonRow:
    """Return a row of published means and standard deviations."""
    summary = {part: {"mean": means[part], "standard_deviation": spreads[part]} for part in means}
    return ComparisonRow(name, PUBLISHED, "", "none", num_cases, None, summary)


def as_mapping(row: ComparisonRow) -> dict[str, Any]:
    """Return a row as plain data."""
    return asdict(row)


def row_of(told: Mapping[str, Any]) -> ComparisonRow:
    """Return the row from plain data.

    Raises
    ------
    KeyError, TypeError
        If it is something else.
    """
    # earlier versions had no worlds
    known = {"world": "", **told}
    return ComparisonRow(**{field.name: known[field.name] for field in fields(ComparisonRow)})


def as_cells(row: ComparisonRow) -> list[Any]:
    """Return the cells of a row of ``compare/table.csv``; empty where unknown."""
    cells: dict[str, Any] = {
        "controller": row.controller,
        "source": row.source,
        "world": row.world,
        "sun": row.sun,
        "safety": row.safety,
        "num_cases": row.num_cases,
        "rules": row.rules,
    }
    if row.times:
        cells["times_optimum_mean"] = row.times["times_optimum"]["mean"]
        cells["times_optimum_as_seen_mean"] = row.times["times_optimum_as_seen"]["mean"]
        cells["solved_cases"] = row.times["num_cases"]
    for name in (*MEANS, *SHARES):
        cells |= {f"{name}_{part}": value for part, value in row.summary.get(name, {}).items()}
    return ["" if cells.get(name) is None else cells[name] for name in HEADER]


def joined(parts: Sequence[tuple[ComparisonRow, Mapping[str, Column]]]) -> dict[str, Column]:
    """Concatenate the flights of several rows, each with its row's names."""
    names = list(parts[0][1])
    columns: dict[str, Column] = {
        key: np.concatenate([np.full(row.num_cases, getattr(row, key)) for row, _ in parts])
        for key in ("controller", "world", "sun", "safety")
    }
    return columns | {name: np.concatenate([episodes[name] for _, episodes in parts]) for name in names}


#: headings of the table in words, and whether a column is numeric
COLUMNS = (
    ("controller", False),
    ("rules", True),
    ("delta-v (m/s)", True),
    ("rate (%)", True),
    ("successful (%)", True),
    ("outside (%)", True),
    ("x optimum", True),
    ("layer: outside (%)", True),
    ("delta-v (m/s)", True),
    ("acted in (%)", True),
)


def cells_in_words(row: ComparisonRow, guarded: ComparisonRow | None) -> list[str]:
    """Return a line of the table: a row without the safety layer, and the same with it if it was flown."""
    mark = "*" if row.source == PUBLISHED else f", {row.num_cases} cases" if row.source == PLANNED else ""
    layer = ["", "", ""]
    if guarded is not None:
        layer = [share(guarded, "violated"), mean(guarded, "delta_v_m_s", 3), share(guarded, "safety_acted")]
    return [
        row.controller + mark,
        "-" if row.rules is None else str(row.rules),
        mean(row, "delta_v_m_s", 3),
        rate(row),
        share(row, SUCCESS),
        share(row, "violated"),
        f"{row.times['times_optimum']['mean']:.1f}" if row.times else "",
        *layer,
    ]


def mean(row: ComparisonRow, name: str, places: int) -> str:
    """Return a mean with its standard deviation."""
    told = row.summary[name]
    return f"{told['mean']:.{places}f} ± {told['standard_deviation']:.{places}f}"


def rate(row: ComparisonRow) -> str:
    """Return the inspection rate, and that of the points that are ever lit if some are not."""
    told, of_lit = row.summary["inspection_rate_percent"], row.summary.get("inspectable_rate_percent")
    words = mean(row, "inspection_rate_percent", 2)
    if of_lit is None or of_lit["mean"] == told["mean"]:
        return words
    return f"{words}, of lit {of_lit['mean']:.2f}"


def share(row: ComparisonRow, name: str) -> str:
    """Return a share of cases in per cent with its interval; empty if unknown."""
    told = row.summary.get(name)
    if told is None:
        return ""
    return f"{100 * told['fraction']:.1f} ({100 * told['low']:.1f}-{100 * told['high']:.1f})"


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


def in_words(rows: Sequence[ComparisonRow]) -> str:
    """Write the table as plain text, one section per Sun setting."""
    blocks: list[Block] = []
    for sun in dict.fromkeys(row.sun for row in rows if row.sun):
        lines = lines_of(rows, sun)
        used = [place for place in range(len(COLUMNS)) if any(line[place] for line in lines)]
        blocks += [
            Heading(f"Sun {sun}"),
            Table(
                [COLUMNS[place][0] for place in used],
                [[line[place] for place in used] for line in lines],
                numbers=[column for column, place in enumerate(used) if COLUMNS[place][1]],
            ),
        ]
    return text.write(Document(blocks))
