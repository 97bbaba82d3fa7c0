"""A sweep as tables and as a page: which setting is better, by how much, how sure; and the best to fly."""

from collections.abc import Sequence
from functools import reduce

import numpy as np

from pipeline.evaluation.paired_runs import METRICS, REPLICATE, Compared, Effect, Metric, common_cases
from pipeline.evaluation.statistics import Columns
from pipeline.report.evaluated_run import EvaluatedRun
from pipeline.report.figures.comparison import front_of_runs
from pipeline.report.figures.style import caption_of, illustrate, style
from pipeline.report.played import player_of_runs
from pipeline.report.played_fleets import WHY
from pipeline.report.sweep import SweepResults
from pipeline.run import typed
from plain_files.document import Block, Code, Document, Figure, Heading, Items, Paragraph, Table, html

#: heading of the shares of fuel, where a run chose pushes ahead
FUEL_SHARES = "fuel by rules / chosen ahead (%)"
#: metrics in sentences, where their labels are no nouns
NOUNS = {"success": "success rate", "violated": "flights outside the limits"}
DOTS_PER_INCH = 100
#: what is said of the flights of runs, by whether one is alone, and whether there are fleets
CAPTIONS = {
    (True, False): "flights_of_one",
    (True, True): "flights_of_fleets",
    (False, False): "side_by_side",
    (False, True): "fleets_side_by_side",
}
#: what a star means, and where p-values and intervals come from
STAR = "* shown by its test, however many are compared here (Holm's method):"
TESTS = (
    "p: Wilcoxon's signed ranks; for shares of flights McNemar's exact test. Intervals of means are "
    "Student's, those of shares Tango's by scores."
)


def _headed(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})"


def _shares(percent: float) -> str:
    """Return the shares of fuel that rules fired and that was chosen ahead; nothing where none was."""
    return f"{100.0 - percent:.1f} / {percent:.1f}" if percent > 0.0 else ""


def _with_shares(
    heads: Sequence[str], rows: Sequence[Sequence[str]], ahead: Sequence[float]
) -> tuple[list[str], list[list[str]]]:
    """Return a table with the shares of fuel as a last column, if any row has them."""
    shares = [_shares(percent) for percent in ahead]
    if not any(shares):
        return list(heads), [list(row) for row in rows]
    return [*heads, FUEL_SHARES], [[*row, cell] for row, cell in zip(rows, shares, strict=True)]


def settings_table(results: SweepResults) -> list[Block]:
    """Return the settings, a line each: their means over all cases or runs, and which are on the front."""
    if not results.settings:
        return []
    rows = []
    for setting in results.settings:
        values = [setting.estimates[metric.name].in_words(metric) for metric in METRICS]
        mark = " (front)" if setting in results.front and len(results.settings) > 1 else ""
        rows.append((setting.name + mark, f"{len(setting.runs)}, {setting.num_cases:,}", *values))
    over = "cases" if results.pools_seeds else "runs"
    title = f"{len(rows)} settings; means and {results.confidence_percent:g} % intervals over {over}:"
    heads = ["setting", "runs, cases", *map(_headed, METRICS)]
    ahead = [setting.percent_ahead for setting in results.settings]
    return [Paragraph(title), Table(*_with_shares(heads, rows, ahead))]


def runs_table(results: SweepResults) -> list[Block]:
    """Return the runs, a line each, with their means."""
    rows = []
    for run in results.runs:
        values = [
            f"{run.estimates[metric.name].value:.{metric.decimals}f}" if run.estimates else ""
            for metric in METRICS
        ]
        tags = [run.tags.get(name, "") for name in results.tags.values()]
        rows.append((run.folder, *tags, run.state, *values))
    heads = ["run", *results.tags, "state", *map(_headed, METRICS)]
    ahead = [run.percent_ahead for run in results.runs]
    return [Paragraph(f"{len(rows)} runs:"), Table(*_with_shares(heads, rows, ahead))]


def effects_table(results: SweepResults) -> list[Block]:
    """Return the effects, a sentence and a line a level, against the factor's first level, all else equal."""
    groups: dict[tuple[str, str, str], list[Effect]] = {}
    for effect in results.effects:
        groups.setdefault((effect.factor, effect.baseline, effect.level), []).append(effect)
    if not groups:
        return []
    rows, sentences = [], []
    for (factor, baseline, level), group in groups.items():
        gained = [differing(effect) for effect in group]
        pairs = f"{group[0].difference.count:,} {group[0].unit}"
        rows.append((f"{factor}: {level} against {baseline}", pairs, *gained))
        sentences.append(f"{factor}={level} against {baseline}: {_verdict(group)}.")
    title = f"Paired differences, {results.confidence_percent:g} % intervals; {STAR}"
    return [Items(sentences), Paragraph(title), Table(["setting", "pairs of", *map(_headed, METRICS)], rows)]


def _verdict(group: Sequence[Effect]) -> str:
    """Return in which metrics a level is better or worse than its baseline, and by how much."""
    words: dict[str, list[str]] = {"better": [], "worse": [], "no difference shown": []}
    for effect in group:
        metric, difference = effect.metric, effect.difference
        is_better = (difference.mean < 0.0) == metric.is_less_better
        kind = ("better" if is_better else "worse") if effect.is_shown else "no difference shown"
        unit = "percentage points" if metric.unit == "%" else metric.unit
        amount = f" by {abs(difference.mean):.{metric.decimals}f} {unit}"
        words[kind].append(NOUNS.get(metric.name, metric.label) + amount * effect.is_shown)
    return "; ".join(f"{kind} in {', '.join(names)}" for kind, names in words.items() if names)


def differing(row: Compared | Effect) -> str:
    """Write a difference with its interval; a star where it is shown."""
    return row.difference.in_words(row.metric.decimals) + ("*" if row.is_shown else "")


def compared_table(
    names: tuple[str, str],
    compared: Sequence[Compared],
    ahead: Sequence[float],
    confidence: float,
    letter: str = "B",
) -> list[Block]:
    """Return two runs side by side, a line a metric; `ahead` is how much fuel they chose ahead, per cent.

    The second is called by a letter.
    """
    count = compared[0].difference.count
    rows = []
    for row in compared:
        means = [f"{mean:.{row.metric.decimals}f}" for mean in row.means]
        counts = f"{row.better:,} / {row.worse:,} / {count - row.better - row.worse:,}"
        p_value = f"{row.difference.p_value:.2g}"
        rows.append((_headed(row.metric), *means, differing(row), counts, p_value))
    if any(ahead):
        rows.append((FUEL_SHARES, *map(_shares, ahead), "", "", ""))
    title = f"{count:,} common cases; {letter} against A, {confidence:g} % intervals; {STAR}"
    better = f"{letter} better / worse / equal"
    heads = ["", f"A: {names[0]}", f"{letter}: {names[1]}", f"{letter} - A", better, "p"]
    return [Paragraph(title), Table(heads, rows, numbers=range(1, len(heads))), Paragraph(TESTS)]


def write(results: SweepResults, played: Sequence[EvaluatedRun] = ()) -> str:
    """Write the page: HTML that needs no other file, and asks for none.

    Parameters
    ----------
    results : SweepResults
    played : sequence of EvaluatedRun
        The best runs, whose flights open side by side; the page of none runs no script.
    """
    return _with_player(_document(results), played, "sweep")


def _with_player(document: Document, played: Sequence[EvaluatedRun], name: str) -> str:
    """Write a page with the player of runs on the cases that they share."""
    style = html.read("templates/report.css", "pipeline.report")
    if not played:
        return html.page(document, style)
    rows = shared_rows([run.episodes for run in played])
    player = player_of_runs(played, rows, name) if len(rows[0]) else "no case is common to all of them"
    is_alone, has_fleets = len(played) == 1, any(run.experiment.mission.has_fleet for run in played)
    says = caption_of(CAPTIONS[is_alone, has_fleets], why=WHY)
    says = f"No flight opens here: {player}." if isinstance(player, str) else says
    heading = f"The flights of {played[0].name}" if is_alone else "The same case side by side"
    shown = [*document.blocks, Heading(heading), Paragraph(says)]
    return html.page(Document(shown), style, None if isinstance(player, str) else player)


def write_compared(runs: Sequence[EvaluatedRun], blocks: Sequence[Block]) -> str:
    """Write the page of runs that are compared: their tables, and each case's flights side by side.

    Parameters
    ----------
    runs : sequence of EvaluatedRun
    blocks : sequence of Block
        What is said of them, each against the first.
    """
    names = " and ".join([", ".join(run.name for run in runs[:-1]), runs[-1].name])
    return _with_player(Document([Heading(f"{names} compared", 1), *blocks]), runs, "compared")


def shared_rows(episodes: Sequence[Columns]) -> list[list[int]]:
    """Return the rows of the cases that all evaluations share, for each of them in one order."""
    first, *others = episodes
    if not others:
        return [[*range(len(first["delta_v_m_s"]))]]
    pairs = [common_cases(first, other) for other in others]
    common = reduce(np.intersect1d, [mine for mine, _ in pairs])
    rows = [[int(row) for row in common]]
    for mine, theirs in pairs:
        there = dict(zip(mine.tolist(), theirs.tolist(), strict=True))
        rows.append([int(there[row]) for row in rows[0]])
    return rows


def _document(results: SweepResults) -> Document:
    """Return the page on a sweep: effects, settings, the best controllers, failures, and all runs."""
    folder = results.folder.as_posix()
    factors = [key for key in results.factors if key != REPLICATE] or results.factors
    blocks: list[Block] = [
        Heading(f"Sweep over {', '.join(factors) or 'nothing'}", 1),
        Paragraph(f"{folder}: {len(results.runs)} runs, {len(results.evaluated)} evaluated"),
    ]
    if tables_of_effects := effects_table(results):
        blocks += [Heading("Which is better"), Paragraph(caption_of("effects")), *tables_of_effects]
    if settings := settings_table(results):
        note = caption_of("pooled" if results.pools_seeds else "trained")
        blocks += [Heading("Settings"), Paragraph(note), *settings]
    if len(results.settings) > 1:
        blocks.append(_picture(results))
    blocks.append(Heading("Best, ready to fly"))
    if results.offered:
        blocks.append(Paragraph(caption_of("best")))
        for run in results.offered:
            blocks += [Heading(run.folder, 3), Code(run.fly)]
    else:
        blocks.append(Paragraph("No run has been evaluated yet."))
    failures = [f"{run.folder}: {run.failure}" for run in results.failed]
    if failures:
        blocks += [Heading("Failed"), Items(failures), Paragraph("To try them again:")]
        blocks.append(Code(typed.resume(folder)))
    if left_out := [f"{run.folder}: {run.failure}" for run in results.left_out]:
        blocks += [Heading("Left out"), Items(left_out)]
    return Document([*blocks, Heading("Runs"), *runs_table(results)])


def _picture(results: SweepResults) -> Figure:
    """Draw the settings, rate over delta-v, with those on the front."""
    spent, rates = (
        np.array([setting.estimates[name] for setting in results.settings])
        for name in ("delta_v_m_s", "inspection_rate_percent")
    )
    is_on_front = np.array([setting in results.front for setting in results.settings])
    with style():
        figure = front_of_runs([setting.name for setting in results.settings], spent, rates, is_on_front)
        return illustrate("front", caption_of("front"), figure, DOTS_PER_INCH).block
