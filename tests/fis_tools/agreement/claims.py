"""What the product claims about a system's outputs, held against the plain definition at the same inputs."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from math import comb

import numpy as np

from fis_tools.analysis import arrays, contribution, shapley
from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.bounds import ask
from fis_tools.analysis.measures import completeness
from fis_tools.array_types import Floats
from fis_tools.engines import interval
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import Inference, infer, infer_outputs
from fis_tools.findings.difference import comparison
from fis_tools.findings.explanation import flips
from fis_tools.model import FuzzySystem, Rule
from fis_tools.model.intervals import has_intervals
from tests.fis_tools.agreement.nearness import (
    TOLERANCE,
    Difference,
    is_near,
    neighbours,
    sizes,
    strengths_around,
)

#: What finds where a claim is not what the definition says.
Check = Callable[[str, FuzzySystem, Floats, list[Inference]], Iterator[Difference]]
#: of shares, which are sums of many answers
SHARES_TOLERANCE = 1e-7
#: of strengths: where a set may jump, what rounding decides is anything between what these lead to
FACTORS = (1.0, 1.0 - 1e-12, 1.0 + 1e-12)
#: rows of which each rule is silenced, and how strongly a rule fires that surely does
NUM_SILENCED, LEAST_FIRING = 6, 1e-9
#: players whose coalitions are few, and whose are enumerated at all, of averages and sums and of sets
FEW_PLAYERS, MOST_AVERAGED, MOST_CUTTING = 5, 12, 7
#: of a system so many rows with few players and with more
NUM_SMALL, NUM_LARGE = 3, 1
#: boxes that a question may take, and points along an axis of a surface
NUM_BOXES, NUM_POINTS = 60, 4


def bounds(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Each output lies inside the bounds of boxes around its inputs: points, small and large ones.

    That is what compiled inference gives, and what the definition does, unless rounding decides between them.
    """
    try:
        program = interval.pack(system)
    except interval.NotBounded:
        return
    generator = np.random.default_rng(11)
    limits = np.array([system.limits_of(variable) for variable in system.inputs])
    spans = np.array([variable.span for variable in system.inputs])
    held = np.clip(rows, limits[:, 0], limits[:, 1])
    is_finite, given = np.isfinite(held).all(axis=1), compile(system)(rows)
    for width in (0.0, 1e-12, 1e-3, 0.3):
        down, up = generator.random((2, *rows.shape)) * width * spans
        least, greatest, _ = interval.bound(program, held - down, held + up)
        for index in np.flatnonzero(is_finite):
            values, box = steps[index].values, (least[index], greatest[index])
            is_broken = not _is_inside(system, given[index], *box)
            if is_broken or not _is_inside(system, values, *box):
                around = () if is_broken else neighbours(steps[index])
                if not any(_is_inside(system, near, *box) for near in around):
                    ends = [*zip(*(end.tolist() for end in box), strict=True)]
                    answers = str([given[index].tolist(), values.tolist()])
                    yield Difference(claim, system, rows[index], answers, f"{ends} of width {width}")


def _is_inside(system: FuzzySystem, values: Floats, least: Floats, greatest: Floats) -> bool:
    """Whether outputs lie between bounds, as far as rounding decides nothing; no number has none."""
    slack = 1e-12 * sizes(system, values)
    is_beyond = (least - slack > values) | (greatest + slack < values)
    return not (is_beyond | (np.isnan(least) & ~np.isnan(values))).any()


def explain(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Shares add up to the way from the default, at each input that inference takes."""
    compiled = compile(system)
    shared = shapley.shares(compiled, rows).values.sum(axis=1)
    given = compiled(rows)
    for row, total, step, answer in zip(rows, shared, steps, given, strict=True):
        for index, variable in enumerate(system.outputs):
            silent, value = variable.default or 0.0, answer[index]
            if not np.isfinite(value) or (step.outputs[index].is_default and total[index] == 0.0):
                continue
            if not np.isfinite(total[index]) and _lacks_a_number(step, index):
                continue
            scale = max(variable.span, abs(value), abs(silent))
            summed = step.values.copy()
            summed[index] = silent + total[index]
            if not abs(summed[index] - value) <= SHARES_TOLERANCE * scale and not is_near(
                system, summed, step
            ):
                yield Difference(claim, system, row, str(value), f"shares add up to {silent + total[index]}")


def _lacks_a_number(step: Inference, index: int) -> bool:
    """Whether a formula has no value for some of the rules that fire, so that there are no shares."""
    fires = np.flatnonzero(step.firing_strengths)
    for chosen in product((0.0, 1.0), repeat=len(fires)):
        firing = step.firing_strengths.copy()
        firing[fires] *= chosen
        value = infer_outputs(step.system, firing, step.clipped)[index].value
        if not (np.isfinite(value) or (step.outputs[index].variable.default is None and not firing.any())):
            return True
    return False


def shares(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """The share of each rule is Shapley's sum over all coalitions, each inferred by the definition."""
    if has_intervals(system):
        return
    shared = shapley.shares(compile(system), rows)
    left = {False: NUM_SMALL, True: NUM_LARGE}
    for index, output in enumerate(system.outputs):
        for row, step, values, error in zip(rows, steps, shared.values, shared.error, strict=True):
            players = _players(system, step, index)
            is_large = len(players) > FEW_PLAYERS
            most = MOST_AVERAGED if system.weighs(output) else MOST_CUTTING
            if not 2 <= len(players) <= most or error[index] or not left[is_large]:
                continue
            factors = FACTORS[:1] if system.weighs(output) else FACTORS
            held = [step.firing_strengths * factor for factor in factors]
            expected = np.array([_shapley(step, index, players, firing) for firing in held])
            if not np.isfinite(expected).all():
                continue
            left[is_large] -= 1
            scale = max(output.span, np.abs(expected).max())
            slack = SHARES_TOLERANCE * scale + 3.0 * np.ptp(expected, axis=0)
            given = values[players, index]
            if (np.abs(given - expected[0]) > slack).any() and not _is_around(
                given, slack, (_shapley(step, index, players, firing) for firing in strengths_around(step))
            ):
                yield Difference(claim, system, row, str(expected[0]), str(given))
    exact = ~shared.error.any(axis=1)  # of other rows fewer orders are drawn for a mean
    yield from _mean_sizes(claim, system, rows[exact], shared.values[exact], shapley.importance)


def _is_around(values: Floats, slack: Floats, around: Iterator[Floats]) -> bool:
    """Whether values lie between those of neighbours, which jump where rounding decides."""
    near = np.array([*around])
    near[~np.isfinite(near)] = np.nan
    low, high = np.nanmin(near, axis=0) - slack, np.nanmax(near, axis=0) + slack
    return bool(((low <= values) & (values <= high) | np.isnan(low)).all())


def contributions(
    claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]
) -> Iterator[Difference]:
    """The contribution of a rule is the output less the one that the definition infers without it."""
    if has_intervals(system):
        return
    given = contribution.contributions(compile(system), rows)
    for row, step, values in zip(rows[:NUM_SILENCED], steps, given, strict=False):
        firing = step.firing_strengths
        if ((firing > 0.0) & (firing < LEAST_FIRING)).any():
            continue  # rounding decides whether such a rule fires at all
        expected = np.array([_without_each(step, firing * factor) for factor in FACTORS])
        spans = np.array([variable.span for variable in system.outputs])
        slack = SHARES_TOLERANCE * np.maximum(spans, np.abs(expected[0])) + 3.0 * np.ptp(expected, axis=0)
        slack += TOLERANCE * sizes(system, step.values)  # differences of these lose their last digits
        is_known = np.isfinite(expected).all(axis=0)
        if (is_known & ~(np.abs(values - expected[0]) <= slack)).any() and not _is_around(
            values, slack, (_without_each(step, near) for near in strengths_around(step))
        ):
            yield Difference(claim, system, row, str(expected[0].tolist()), str(values.tolist()))
    yield from _mean_sizes(claim, system, rows, given, contribution.importance)


def _mean_sizes(
    claim: str, system: FuzzySystem, rows: Floats, values: Floats, importance: Callable[..., Floats]
) -> Iterator[Difference]:
    """The importance of a rule is the mean size of what it moves, in parts of the output's range."""
    is_finite = ~np.isinf(values).any(axis=(1, 2))  # an infinite size is all that there is to tell
    rows, values = rows[is_finite], values[is_finite]
    if not len(rows):
        return
    known = [[np.abs(moved[np.isfinite(moved)]) for moved in each.T] for each in values.transpose(1, 0, 2)]
    means = np.array([[moved.sum() / max(len(moved), 1) for moved in each] for each in known])
    expected = means / np.array([variable.span for variable in system.outputs])
    given = importance(compile(system), rows)
    if not np.allclose(given, expected, rtol=SHARES_TOLERANCE, atol=SHARES_TOLERANCE):
        yield Difference(claim, system, rows[0], str(expected.tolist()), str(given.tolist()))


def _without_each(step: Inference, firing: Floats) -> Floats:
    """What each rule adds to each output, (num_rules, num_outputs), at strengths; above one they are one."""
    firing = np.minimum(firing, 1.0)

    def outputs(strengths: Floats) -> Floats:
        return np.array([each.value for each in infer_outputs(step.system, strengths, step.clipped)])

    silent = [np.where(np.arange(len(firing)) == rule, 0.0, firing) for rule in range(len(firing))]
    return outputs(firing) - np.array([outputs(strengths) for strengths in silent])


def _players(system: FuzzySystem, step: Inference, index: int) -> list[int]:
    """The rules that take part in an output: those that fire clearly, at least the strongest."""
    name, firing = system.outputs[index].name, step.firing_strengths
    concluding = [
        rule
        for rule, each in enumerate(system.rules)
        if any(consequent.variable == name and consequent.weight for consequent in each.consequents)
    ]
    least = min(FIRED, max(firing[concluding], default=0.0))
    return [rule for rule in concluding if firing[rule] > 0.0 and firing[rule] >= least]


def _shapley(step: Inference, index: int, players: list[int], firing: Floats) -> Floats:
    """Shapley's sums, (num_players,), at strengths, of which none is above one; NaN without numbers."""
    system = step.system
    output, count = system.outputs[index], len(players)
    silent = 0.0 if output.default is None else output.default
    firing = np.minimum(firing, 1.0)
    worth = np.empty(2**count)
    for coalition in range(2**count):
        absent = {rule for at, rule in enumerate(players) if not coalition >> at & 1}
        part = replace(
            system,
            rules=tuple(
                _quiet(each, output.name) if rule in absent else each
                for rule, each in enumerate(system.rules)
            ),
        )
        inferred = infer_outputs(part, firing, step.clipped)[index]
        # a formula without a value is no silence
        is_silent = output.default is None and inferred.is_default
        worth[coalition] = silent if coalition == 0 or is_silent else inferred.value
    sizes_of = np.array([coalition.bit_count() for coalition in range(2**count)])
    expected = np.empty(count)
    for at in range(count):
        without = np.flatnonzero(~(np.arange(2**count) >> at) & 1)
        weights = 1.0 / (count * np.array([comb(count - 1, size) for size in sizes_of[without]]))
        expected[at] = weights @ (worth[without | 1 << at] - worth[without])
    return expected


def _quiet(rule: Rule, output: str) -> Rule:
    """A rule that concludes nothing on an output."""
    consequents = (
        replace(each, weight=0.0) if each.variable == output else each for each in rule.consequents
    )
    return replace(rule, consequents=tuple(consequents))


def weakest(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Where the strongest rule is said to be weakest it fires as strongly; exactly told, nowhere less."""
    if has_intervals(system):
        return
    result = completeness(system)
    inferred = infer(system, result.at)
    around = [inferred.firing_strengths, *strengths_around(inferred)]
    strengths = [float(firing.max()) for firing in around]
    if not min(strengths) - LEAST_FIRING <= result.least <= max(strengths) + LEAST_FIRING:
        yield Difference(claim, system, result.at, str(strengths[0]), str(result.least))
    low, high = np.array([[variable.minimum, variable.maximum] for variable in system.inputs]).T
    for row, step in zip(rows, steps, strict=True):
        is_inside = bool((row >= low).all() and (row <= high).all())
        strongest = float(step.firing_strengths.max())
        if result.is_exact and is_inside and strongest < result.least - LEAST_FIRING:
            yield Difference(claim, system, row, str(strongest), f"nowhere below {result.least}")


def crossing(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """What an input is changed to takes the output across the value."""
    for row, step in zip(rows[:1], steps, strict=False):
        if not np.isfinite(step.values).all():
            continue
        for flip in flips(system, row, 0.1):
            if flip.first is None:
                continue
            changed = step.clipped.copy()
            changed[system.inputs.index(flip.input)] = flip.first
            inferred, index = infer(system, changed), system.outputs.index(flip.output)
            value = inferred.values[index]
            if np.sign(value - 0.1) == flip.side and not _may_cross(inferred, index, 0.1):
                words = f"{flip.input.name} = {flip.first} crosses 0.1"
                yield Difference(claim, system, row, f"{flip.output.name} = {value}", words)


def _may_cross(inferred: Inference, index: int, value: float) -> bool:
    """Whether an output lies on the other side for strengths that differ in their last digits."""
    around = np.array([inferred.values[index], *(values[index] for values in neighbours(inferred))])
    return bool((around <= value).any() and (around >= value).any())


def no(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """What is attained is never answered with no, and an example is one by the definition."""
    low, high = np.array([[variable.minimum, variable.maximum] for variable in system.inputs]).T
    for row, step in zip(rows, steps, strict=True):
        if not (np.isfinite(step.values).all() and (row >= low).all() and (row <= high).all()):
            continue
        for index, output in enumerate(system.outputs):
            less = float(step.values[index] - 1e-9 * sizes(system, step.values)[index])
            try:
                answer = ask(system, f"{output.name} > {less!r}", max_boxes=NUM_BOXES)
            except interval.NotBounded:
                return
            if answer.verdict == "no":
                yield Difference(claim, system, row, f"{output.name} = {step.values[index]}", str(answer))
            elif answer.verdict == "yes":
                assert answer.example is not None
                at = np.array([answer.example[variable.name] for variable in system.inputs])
                inferred, given = (
                    infer(system, at),
                    np.array([answer.example[v.name] for v in system.outputs]),
                )
                if not is_near(system, given, inferred):
                    yield Difference(claim, system, at, str(inferred.values), f"the example {given}")
        return  # one row tells enough, since a question takes many boxes


def surface(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Each cell is the output at its inputs."""
    if len(system.inputs) < 2 or not np.isfinite(rows[0]).all():
        return
    fixed = {
        variable.name: float(value) for variable, value in zip(system.inputs[2:], rows[0][2:], strict=True)
    }
    for index, output in enumerate(system.outputs):
        cells = arrays.surface(system, fixed=fixed, output=output.name, num_points=NUM_POINTS)
        for (j, i), given in np.ndenumerate(cells.values):
            at = np.array([cells.x[i], cells.y[j], *fixed.values()])
            inferred = infer(system, at)
            values = inferred.values.copy()
            values[index] = given
            if not is_near(system, values, inferred):
                yield Difference(claim, system, at, str(inferred.values), f"{output.name} = {given}")


def diff(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Where an output is said to move most, both outputs are those of their systems, and so is the change."""
    other = replace(system, rules=(*system.rules[1:], system.rules[0], system.rules[0]))
    kept = rows[np.isfinite(rows).all(axis=1)]
    for change in comparison.compare_outputs(other, system, kept):
        at = np.array([change.inputs[variable.name] for variable in system.inputs])
        index = system.outputs.index(change.output)
        for side, given in ((other, change.before), (system, change.after)):
            inferred = infer(side, at)
            values = inferred.values.copy()
            values[index] = given
            if not is_near(side, values, inferred):
                yield Difference(claim, side, at, str(inferred.values), f"{change.output.name} = {given}")
        if change.largest != abs(change.after - change.before):
            yield Difference(claim, system, at, str(abs(change.after - change.before)), str(change.largest))


CLAIMS: dict[str, Check] = {
    **{"bounds": bounds, "no": no, "explain": explain, "shares": shares},
    **{"contributions": contributions, "weakest": weakest, "crossing": crossing},
    **{"surface": surface, "diff": diff},
}
