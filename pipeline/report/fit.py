"""The page of a fit: what limits the mission, how the controllers fly, and what to do next."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pipeline.report.figures.style import caption_of
from pipeline.run import typed
from plain_files.document import Block, Code, Document, Heading, Items, Paragraph, Table
from plain_files.document.html import ScriptedPanel, page, read

#: rows of the table of flights, by their keys in the summary
ROWS = {"shipped": "", "fitted": "fitted", "layered": "with safety=filter", "planned": "planning"}
ROWS |= {"tuned": "tuned"}
HEADS = ("", "flights", "success", "outside", "points missed", "delta-v (m/s)")
#: heading of a further column, where a controller chose pushes ahead
BY_RULES = "fuel by rules (%)"


def render_fit(name: str, result: Mapping[str, Any], player: ScriptedPanel | None = None) -> str:
    """Render the page.

    Parameters
    ----------
    name : str
        Of the controller.
    result : mapping
        Of `fit/summary.json`.
    player : ScriptedPanel, optional
        The player of the flights that no choice has seen.
    """
    blocks = list(_blocks(name, result))
    if player:
        what = caption_of("fitted_flights")
        blocks += [Heading("The flights that no choice has seen"), Paragraph(what)]
    style = read("templates/report.css", "pipeline.report")
    return page(Document(blocks), style, player)


def _blocks(name: str, result: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the page on a fitted controller: its success, what limits the mission, how to fly it."""
    last, is_layered = result["last"], result["safety"] != "none"
    yield Heading(name, 1)
    tuned = ", tuned" if result["tuned"] else ""
    yield Paragraph(
        f"{_percent(last['success'])} of {last['num_cases']} flights succeed, from starts that no choice "
        f"has seen. {last['exits']['count']} left the limits, {last['misses']['count']} missed points inside "
        f"them. It is {result['words']}{tuned}{', under the safety layer' if is_layered else ''}."
    )
    goal, low = result["goal_percent"], 100 * last["success"]["low"]
    verb = "reaches" if low >= goal else "misses"
    yield Paragraph(f"The lower bound, {low:.1f} %, {verb} the goal of {goal:g} %.")
    yield Heading("What limits the mission")
    yield Items([limit["sentence"] for limit in result["limits"]])
    yield Heading("How they fly")
    yield _table([(what, result[key]) for key, what in ROWS.items() if result[key]])
    if result["layer_refused"]:
        yield Paragraph(f"The safety layer could not be tried: {result['layer_refused']}.")
    yield Heading("Fly it")
    yield Paragraph("Where RUN is the folder of this run:")
    yield Code(typed.fly(typed.RUN))
    yield Heading("The last round of the competition")
    yield _table([("", rival) for rival in result["rivals"]])


def _table(rows: Sequence[tuple[str, Mapping[str, Any]]]) -> Table:
    """Return a table of tallies, each with what it is."""
    cells = [[": ".join(filter(None, (what, row["words"]))), *_cells(row)] for what, row in rows]
    heads, ahead = [*HEADS], [row["ahead_percent"] for _, row in rows]
    if any(ahead):
        heads.append(BY_RULES)
        cells = [[*line, f"{100.0 - percent:.1f}"] for line, percent in zip(cells, ahead, strict=True)]
    return Table(heads, cells, numbers=range(1, len(heads)))


def _cells(tally: Mapping[str, Any]) -> list[str]:
    ends = (tally[end] for end in ("success", "exits", "misses"))
    return [str(tally["num_cases"]), *(_percent(end) for end in ends), f"{tally['delta_v']:.3f}"]


def _percent(share: Mapping[str, Any]) -> str:
    """Return a share and its interval in words, in per cent, each of which stays on one line."""
    rate = f"{100 * share['fraction']:.1f} %"
    interval = f"({100 * share['low']:.1f} to {100 * share['high']:.1f})"
    return " ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in (rate, interval))
