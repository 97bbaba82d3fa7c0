"""The same controllers in several worlds: which hold, which fail, and at what cost."""

from collections.abc import Sequence

from fis_tools.document import Document, Paragraph, Table, text
from pipeline.evaluation.comparison import FLOWN, ComparisonRow
from pipeline.evaluation.monte_carlo import SUCCESS

#: contents of a cell of the table
LEGEND = "successful inside the limits (%) / delta-v (m/s) / outside (%)"


def worlds_of(rows: Sequence[ComparisonRow]) -> list[str]:
    """Return the worlds of some rows, in order; empty if all flew in the experiment's own."""
    return list(dict.fromkeys(row.world for row in rows if row.source == FLOWN and row.world))


def cell(row: ComparisonRow) -> str:
    """Return the table cell of a controller in a world, see `LEGEND`."""
    success, outside = (100 * row.summary[name]["fraction"] for name in (SUCCESS, "violated"))
    return f"{success:.0f} / {row.summary['delta_v_m_s']['mean']:.2f} / {outside:.0f}"


def matrix(rows: Sequence[ComparisonRow], sun: str, layer: str) -> list[list[str]]:
    """Return the table of one Sun and layer: names first, then a line per world, a column per controller."""
    flown = [row for row in rows if row.source == FLOWN and (row.sun, row.safety) == (sun, layer)]
    names = list(dict.fromkeys(row.controller for row in flown))
    told = {(row.world, row.controller): cell(row) for row in flown}
    lines = [[world, *(told.get((world, name), "") for name in names)] for world in worlds_of(flown)]
    return [["world", *names], *lines]


def matrices(rows: Sequence[ComparisonRow]) -> list[tuple[str, str, list[list[str]]]]:
    """Return the tables of all Suns and layers: Sun, layer, lines."""
    flown = [row for row in rows if row.source == FLOWN]
    keys = dict.fromkeys((row.sun, row.safety) for row in flown)
    return [(sun, layer, matrix(flown, sun, layer)) for sun, layer in keys]


def is_worse(row: ComparisonRow, first: ComparisonRow) -> bool:
    """Return whether a controller fails: the intervals of success or of leaving the limits do not overlap."""
    now, then = row.summary, first.summary
    return bool(
        now[SUCCESS]["high"] < then[SUCCESS]["low"] or now["violated"]["low"] > then["violated"]["high"]
    )


def verdicts(rows: Sequence[ComparisonRow]) -> list[str]:
    """Return for each controller, Sun and layer a line on where it fails, and the cost of the last world."""
    lines = []
    flown = [row for row in rows if row.source == FLOWN]
    for sun, layer, controller in dict.fromkeys((row.sun, row.safety, row.controller) for row in flown):
        first, *others = [
            row for row in flown if (row.sun, row.safety, row.controller) == (sun, layer, controller)
        ]
        if not others:
            continue
        broken = [row.world for row in others if is_worse(row, first)]
        spent, least = (row.summary["delta_v_m_s"]["mean"] for row in (others[-1], first))
        cost = f"; {others[-1].world}: {100 * (spent / least - 1):+.0f} % delta-v" if least > 0.0 else ""
        where = f"breaks in {', '.join(broken)}" if broken else "holds in all"
        lines.append(f"{controller}, Sun {sun}, layer {layer}: {where}{cost}")
    return lines


def worlds_in_words(rows: Sequence[ComparisonRow]) -> str:
    """Return the tables as plain text, and which controllers hold."""
    parts = []
    for sun, layer, lines in matrices(rows):
        heads, *rows_told = lines
        title = Paragraph(f"Sun {sun}, safety layer {layer}: {LEGEND}:")
        parts.append(text.write(Document([title, Table(heads, rows_told)])))
    return "\n".join([*parts, *verdicts(rows)])
