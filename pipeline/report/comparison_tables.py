"""What a report tells of controllers side by side: read, as lines of a table, as marks of a figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.evaluation.comparison import COLUMNS, FLOWN, ComparisonRow, in_words, lines_of, row_of
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.worlds import LEGEND, is_worse, matrices, verdicts, worlds_of
from pipeline.report.figures.by_world import Square
from pipeline.report.figures.delta_v_and_rate import Mark
from pipeline.run import artifacts


def read_comparison(folder: Path) -> list[ComparisonRow]:
    """Read what the stage compare wrote; nothing where it has not run.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the file is there and cannot be read.
    """
    if not (folder / artifacts.COMPARISON).exists():
        return []
    told = artifacts.read_json(folder, artifacts.COMPARISON)
    try:
        rows = [row_of(row) for row in told["rows"]]
        in_words(rows)  # which needs every number that is shown
    except (KeyError, TypeError, ValueError) as error:
        raise artifacts.ArtifactError(
            f"{folder / artifacts.COMPARISON} is no comparison ({type(error).__name__}: {error}); repeat the "
            "stage compare"
        ) from error
    return rows


def tables_of(rows: Sequence[ComparisonRow]) -> list[tuple[str, list[list[str]]]]:
    """Return the table of each Sun setting: its name and its lines, each of `headings` cells.

    None where the rows are of several worlds, see `world_tables_of`.
    """
    return [] if worlds_of(rows) else [(sun, lines_of(rows, sun)) for sun in suns_of(rows)]


def world_tables_of(rows: Sequence[ComparisonRow]) -> list[tuple[str, list[list[str]]]]:
    """Return the tables of controllers in several worlds: title, then lines of which the first is names."""
    if not worlds_of(rows):
        return []
    return [(f"Sun {sun}, safety layer {layer}: {LEGEND}", lines) for sun, layer, lines in matrices(rows)]


def world_verdicts(rows: Sequence[ComparisonRow]) -> list[str]:
    """Say of each controller in which worlds it breaks; nothing where there is but one."""
    return verdicts(rows) if worlds_of(rows) else []


def squares_of(rows: Sequence[ComparisonRow]) -> list[tuple[str, list[Square]]]:
    """Return the panels of the grid of worlds, one for each Sun setting and layer."""
    panels: dict[str, list[Square]] = {}
    first: dict[tuple[str, str], ComparisonRow] = {}
    for row in (row for row in rows if row.source == FLOWN):
        title = f"Sun {row.sun}, safety layer {row.safety}"
        known = first.setdefault((title, row.controller), row)
        success, spent = row.summary[SUCCESS]["fraction"], row.summary["delta_v_m_s"]["mean"]
        square = Square(row.controller, row.world, float(success), float(spent), is_worse(row, known))
        panels.setdefault(title, []).append(square)
    return list(panels.items())


def headings() -> list[str]:
    """Return the headings of the tables."""
    return [heading for heading, _ in COLUMNS]


def suns_of(rows: Sequence[ComparisonRow]) -> list[str]:
    """Return the Sun settings of some rows, in order."""
    return list(dict.fromkeys(row.sun for row in rows if row.sun))


def marks_of(rows: Sequence[ComparisonRow]) -> list[tuple[str, list[Mark]]]:
    """Return the panels of the figure: each controller under the first layer that it flew with."""
    panels = []
    for sun in suns_of(rows):
        marks: dict[str, Mark] = {}
        for row in rows:
            if row.sun in (sun, ""):
                name = row.controller if row.source == FLOWN else f"{row.controller} ({row.source})"
                marks.setdefault(
                    name,
                    Mark(
                        name, _pair(row.summary["delta_v_m_s"]), _pair(row.summary["inspection_rate_percent"])
                    ),
                )
        panels.append((f"Sun {sun}", list(marks.values())))
    return panels


def _pair(told: Mapping[str, Any]) -> tuple[float, float]:
    return float(told["mean"]), float(told["standard_deviation"])
