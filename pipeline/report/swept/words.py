"""A sweep, and two runs side by side, as tables."""

from collections.abc import Sequence

from fis_tools.document import Block, Paragraph, Table
from pipeline.evaluation.paired import METRICS, Compared, Difference, Effect, Metric
from pipeline.report.swept.contents import Run, Swept, Value


def _headed(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})"


def runs_table(swept: Swept) -> list[Block]:
    """Return the runs, a line each: what they differ in, what came out, and where they stand."""
    factors = swept.factors
    rows = [
        (
            *(run.differs.get(key, "") for key in factors),
            "on the front" if run in swept.front else run.state,
            *(_valued(run.values.get(metric.name), metric) for metric in METRICS),
        )
        for run in swept.runs
    ]
    confidence = f"{swept.confidence_percent:g} % intervals"
    heads = [*factors, "state", *map(_headed, METRICS)]
    table = Table(heads, rows, numbers=range(len(factors) + 1, len(heads)))
    return [Paragraph(f"{len(swept.runs)} runs, {confidence}:"), table]


def _valued(value: Value | None, metric: Metric) -> str:
    if value is None:
        return ""
    places = metric.places
    return f"{value.value:.{places}f} ({value.low:.{places}f} to {value.high:.{places}f})"


def effects_table(swept: Swept) -> list[Block]:
    """Return the effects, a line a level: differences from the factor's first level, all else equal."""
    found: dict[tuple[str, str, str], list[Effect]] = {}
    for effect in swept.effects:
        found.setdefault((effect.factor, effect.baseline, effect.level), []).append(effect)
    rows = [
        (
            factor,
            f"{level} against {baseline}",
            f"{told[0].difference.count:,} {told[0].unit}",
            *(differing(effect.difference, effect.metric) for effect in told),
        )
        for (factor, baseline, level), told in found.items()
    ]
    if not rows:
        return []
    title = f"Effects: paired differences, {swept.confidence_percent:g} % intervals; * where without zero:"
    heads = ["setting", "values", "pairs of", *map(_headed, METRICS)]
    return [Paragraph(title), Table(heads, rows, numbers=range(2, len(heads)))]


def differing(difference: Difference, metric: Metric) -> str:
    """Write a difference with its interval; a star where it leaves zero out."""
    places = metric.places
    if difference.count < 2:
        return f"{difference.mean:+.{places}f} (one pair)"
    star = "*" if difference.is_told else ""
    return (
        f"{difference.mean:+.{places}f} ({difference.low:+.{places}f} to {difference.high:+.{places}f}){star}"
    )


def failures_of(swept: Swept) -> list[Run]:
    """Return the runs that failed."""
    return [run for run in swept.runs if run.failure]


def compared_table(one: str, other: str, compared: Sequence[Compared], confidence: float) -> list[Block]:
    """Return two runs side by side, a line a metric."""
    count = compared[0].difference.count
    rows = [
        (
            _headed(told.metric),
            *(f"{mean:.{told.metric.places}f}" for mean in told.means),
            differing(told.difference, told.metric),
            f"{told.better:,} / {told.worse:,} / {count - told.better - told.worse:,}",
            f"{told.p_value:.2g}",
        )
        for told in compared
    ]
    title = f"{count:,} common cases; B against A, {confidence:g} % intervals; * where without zero:"
    heads = ["", f"A: {one}", f"B: {other}", "B - A", "B better / worse / equal", "p"]
    return [Paragraph(title), Table(heads, rows, numbers=range(1, len(heads)))]
