"""Findings on outputs: gaps and reversals over the input ranges; along logs, what rules and inputs did."""

import numpy as np

from fis_tools.analysis.arrays import evaluate, firing, rule_usage, spread_inputs
from fis_tools.analysis.contribution import importance
from fis_tools.analysis.measures import Measures
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.audit.report import Finding, Findings, Severity, Thresholds
from fis_tools.model import FuzzySystem
from fis_tools.words.text import NEGLIGIBLE, amount, listed, percent, point_words, rule_words

#: About how many points of the input ranges are evaluated.
NUM_POINTS = 20_000
#: Most inputs whose ranges a grid of so many points covers; of more, lines along each input are evaluated.
MOST_AXES = 14
#: Points of such a line.
LINE = 9


def find(system: FuzzySystem, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield the findings on the outputs of a system, over the whole ranges of its inputs."""
    yield from _complete(system, measures, thresholds)
    inputs = _lines(system)
    answers = evaluate(system, inputs.reshape(-1, len(system.inputs)))
    answers = answers.reshape(*inputs.shape[:-1], len(system.outputs))
    for output in range(len(system.outputs)):
        yield from _reach(system, output, answers[..., output], thresholds)
        for axis in range(len(system.inputs)):
            along = axis if len(system.inputs) <= MOST_AXES else 0
            row = slice(None) if len(system.inputs) <= MOST_AXES else axis
            lines, values = inputs[row], answers[row][..., output]
            yield from _ways_back(
                system,
                output,
                axis,
                np.moveaxis(lines, along, -2).reshape(-1, lines.shape[along], len(system.inputs)),
                np.moveaxis(values, along, -1).reshape(-1, lines.shape[along]),
                thresholds,
            )


def _lines(system: FuzzySystem) -> Floats:
    """Return inputs on lines along each input, the last axis an input.

    Of few inputs they are a grid over all ranges, whose first axes are the inputs. Of many, of which a grid
    would never end, they have the shape (num_inputs, LINE, num_lines, num_inputs): lines along each input
    through points spread over the ranges.
    """
    num_inputs = len(system.inputs)
    if num_inputs <= MOST_AXES:
        num_points = max(2, min(201, int(NUM_POINTS ** (1.0 / num_inputs))))
        axes = [np.linspace(variable.minimum, variable.maximum, num_points) for variable in system.inputs]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    base = spread_inputs(system, max(2, NUM_POINTS // (num_inputs * LINE)))
    lines = np.empty((num_inputs, LINE, *base.shape))
    lines[:] = base
    for axis, variable in enumerate(system.inputs):
        lines[axis, :, :, axis] = np.linspace(variable.minimum, variable.maximum, LINE)[:, np.newaxis]
    return lines


def _complete(system: FuzzySystem, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield a finding if at some input no rule fires, or none strongly."""
    completeness = measures.completeness
    gap = min(measures.coverage[variable.name].least for variable in system.inputs)
    is_reported = 0.0 < gap < thresholds.coverage and completeness.least >= gap
    if completeness.least >= thresholds.coverage or is_reported:
        return
    if completeness.least == 0.0:
        given = [f"{v.name} = {amount(v, v.default)}" for v in system.outputs if v.default is not None]
        answer = f"the output is the default, {', '.join(given)}" if given else "there is no output"
        sentence = f"No rule fires at {point_words(system, completeness.at)}: {answer}."
    else:
        sentence = (
            f"At {point_words(system, completeness.at)} no rule fires with a strength above "
            f"{completeness.least:.2g}: the output rests on weak evidence."
        )
    if not completeness.is_exact:
        sentence += " (The lowest of the points sampled; it may be lower elsewhere.)"
    yield Finding(
        "completeness",
        Severity.SERIOUS if completeness.least < thresholds.fired else Severity.WARNING,
        sentence,
        "Add rules for this region, or widen the terms around it.",
        evidence={
            "least": completeness.least,
            "at": completeness.at.tolist(),
            "exact": completeness.is_exact,
        },
    )


def _reach(system: FuzzySystem, output_index: int, values: Floats, thresholds: Thresholds) -> Findings:
    """Yield a finding if an output uses a small part of its range only."""
    output = system.outputs[output_index]
    if np.isnan(values).all():
        return
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    part = (high - low) / output.span
    if part >= thresholds.reach:
        return
    extent = f"{amount(output, output.minimum)} to {amount(output, output.maximum)}"
    reached = f"stays within {amount(output, low)} to {amount(output, high)}, {percent(part)} of its range,"
    is_constant = part < NEGLIGIBLE
    if is_constant:
        reached = f"is {amount(output, low)}"
    by_area = "; a centroid never reaches the ends" if system.defuzzifier_of(output) == "centroid" else ""
    yield Finding(
        "output-reach",
        Severity.SERIOUS if is_constant else Severity.WARNING,
        f"{output.name} {reached} at {values.size} points over the input ranges ({extent} is declared).",
        f"Narrow the range to what is used, or narrow the outer terms{by_area} (fis_tools bounds proves what "
        "is reached).",
        output.name,
        evidence={"low": low, "high": high, "part": part},
    )


def _ways_back(
    system: FuzzySystem, output_index: int, axis: int, inputs: Floats, lines: Floats, thresholds: Thresholds
) -> Findings:
    """Yield where an output, on (m, n) points of lines along an input, goes against its usual direction."""
    variable, output = system.inputs[axis], system.outputs[output_index]
    # a formula may have no value, or an infinite one: these have no direction
    lines = np.where(np.isfinite(lines), lines, np.nan)
    changes = np.diff(lines, axis=-1)
    up, down = float(changes[changes > 0].sum()), float(-changes[changes < 0].sum())
    if not min(up, down) > 0 or min(up, down) / (up + down) > thresholds.against:
        return
    sign = 1.0 if up >= down else -1.0
    falls = np.nan_to_num(np.fmax.accumulate(sign * lines, axis=-1) - sign * lines)
    worst = np.unravel_index(int(np.argmax(falls)), falls.shape)
    if falls[worst] < thresholds.reversal * output.span:
        return
    line, end = sign * lines[worst[0]], int(worst[-1])
    start = int(end - np.argmax(line[: end + 1][::-1] == np.nanmax(line[: end + 1])))
    points = inputs[worst[0]]
    fixed = [(v, float(points[0, n])) for n, v in enumerate(system.inputs) if n != axis]
    where = ", ".join(f"{other.name} = {amount(other, value)}" for other, value in fixed)
    verbs = ("rises", "falls") if sign > 0 else ("falls", "rises")
    fall = float(falls[worst])
    size = f"{amount(output, fall)} ({percent(fall / output.span)} of its range)"
    yield Finding(
        "monotonicity-surface",
        Severity.WARNING,
        f"{output.name} mostly {verbs[0]} with {variable.name}, but {verbs[1]} by {size} from "
        f"{variable.name} = {amount(variable, points[start, axis])} to {amount(variable, points[end, axis])}"
        + (f", where {where}." if fixed else "."),
        "Look at the output surface there; the rules for these terms work against the others.",
        variable.name,
        evidence={
            "back": fall,
            "from": float(points[start, axis]),
            "to": float(points[end, axis]),
            "held": {other.name: value for other, value in fixed},
            "rising": up,
            "falling": down,
        },
    )


#: The most samples over which the importance of rules is averaged; they are picked evenly.
MOST_SAMPLES = 2_000


def find_along(system: FuzzySystem, samples: Floats, thresholds: Thresholds) -> Findings:
    """Yield the findings on a system at the inputs that it was given, shape (n, num_inputs)."""
    if not len(samples):
        yield Finding(
            "never-asked",
            Severity.NOTE,
            f"{system.name} made no inference in these logs.",
            "Log inputs at which it is used.",
        )
        return
    yield from _clipped(system, samples, thresholds)
    strengths = firing(system, samples)
    usage = rule_usage(strengths, thresholds.fired)
    yield from _silent(strengths)
    yield from _dead(usage.fired, len(samples), thresholds)
    step = max(1, -(-len(samples) // MOST_SAMPLES))
    matters = importance(compiled(system), samples[::step]).max(axis=1)
    yield from _dominant(system, usage.leading, matters, thresholds)
    yield from _idle(usage.fired, matters, thresholds)


def _clipped(system: FuzzySystem, samples: Floats, thresholds: Thresholds) -> Findings:
    """Yield inputs that were outside their ranges."""
    for variable, column in zip(system.inputs, samples.T, strict=True):
        outside = (column < variable.minimum) | (column > variable.maximum)
        if not outside.any():
            continue
        low, high = float(column.min()), float(column.max())
        ends = [low] * (low < variable.minimum) + [high] * (high > variable.maximum)
        far_ends = [amount(variable, end) for end in ends]
        extent = f"{amount(variable, variable.minimum)} to {amount(variable, variable.maximum)}"
        part = float(outside.mean())
        yield Finding(
            "input-clipped",
            Severity.WARNING if part > thresholds.clipped else Severity.NOTE,
            f"{variable.name} was outside its range of {extent} in {percent(part)} of {len(column)} "
            f"inferences, up to {' and '.join(far_ends)}: there the system saw only the end of its range.",
            "Widen the range to the values that occur, if the output should change there.",
            variable.name,
            evidence={"part": part, "low": low, "high": high},
        )


def _silent(strengths: Floats) -> Findings:
    """Yield a finding if at some inputs no rule fired."""
    part = float(np.mean(strengths.max(axis=1) == 0.0))
    if part > 0:
        yield Finding(
            "default-taken",
            Severity.SERIOUS,
            f"No rule fired in {percent(part)} of {len(strengths)} inferences: the defaults applied.",
            "Add rules for these inputs, or widen the terms.",
            evidence={"part": part, "first": int(np.argmax(strengths.max(axis=1) == 0.0))},
        )


def _dead(fired: Floats, num_samples: int, thresholds: Thresholds) -> Findings:
    """Yield a finding on the rules that never fired."""
    dead = [int(index) + 1 for index in np.flatnonzero(fired == 0.0)]
    if not dead:
        return
    part = len(dead) / len(fired)
    yield Finding(
        "dead-rules",
        Severity.WARNING if part > thresholds.dead else Severity.NOTE,
        f"{len(dead)} of {len(fired)} rules never reached a firing strength of {thresholds.fired:g} in "
        f"{num_samples} inferences: {listed([str(number) for number in dead], 12)}.",
        "Log inputs that need them, or remove them; a rule that never fired is untested.",
        rules=tuple(dead),
        evidence={"part": part, "samples": num_samples},
    )


def _dominant(system: FuzzySystem, leading: Floats, matters: Floats, thresholds: Thresholds) -> Findings:
    """Yield rules that lead most inferences, or make up most of the effect."""
    total = float(matters.sum())
    shares = matters / total if total > 0 else np.zeros(len(matters))
    for index, rule in enumerate(system.rules):
        lead, share = float(leading[index]), float(shares[index])
        if len(system.rules) < 3 or max(lead, share) <= thresholds.dominant:
            continue
        by_share = (
            (lead, f"fires most strongly in {percent(lead)} of the inferences"),
            (share, f"makes up {percent(share)} of the effect of all rules"),
        )
        reasons = [words for part, words in by_share if part > thresholds.dominant]
        yield Finding(
            "dominant-rule",
            Severity.NOTE,
            f"Rule {index + 1} ({rule_words(rule)}) {' and '.join(reasons)}.",
            "Split its terms where most inputs lie, or accept that this one rule decides.",
            rules=(index + 1,),
            evidence={"leading": lead, "share": share},
        )


def _idle(fired: Floats, matters: Floats, thresholds: Thresholds) -> Findings:
    """Yield a finding on the rules that fired but changed the outputs hardly."""
    idle = [int(i) + 1 for i in np.flatnonzero((fired > 0.0) & (matters < thresholds.idle))]
    if idle:
        yield Finding(
            "idle-rules",
            Severity.NOTE,
            f"{len(idle)} rule{'s' if len(idle) > 1 else ''} fired, but without "
            f"{'them' if len(idle) > 1 else 'it'} the outputs would differ by less than "
            f"{percent(thresholds.idle)} of their range on average: {listed([str(n) for n in idle], 12)}.",
            "Remove them (fis_tools simplify shows the largest change), or keep them for other inputs.",
            rules=tuple(idle),
            evidence={"importance": {str(number): float(matters[number - 1]) for number in idle}},
        )
