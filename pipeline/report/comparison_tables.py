"""What a report tells of controllers side by side: read, as lines of a table, as marks of a figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.evaluation.comparison import COLUMNS, FLOWN, ComparisonRow, in_words, lines_of, row_of
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
    """Return the table of each Sun setting: its name and its lines, each of `headings` cells."""
    return [(sun, lines_of(rows, sun)) for sun in suns_of(rows)]


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
