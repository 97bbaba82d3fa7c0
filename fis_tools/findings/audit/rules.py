"""Findings on rules as written: duplicates, contradictions, jumps between neighbours, meaning, number."""

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations, product
from math import prod

import numpy as np

from fis_tools.analysis.measures import Measures, centre
from fis_tools.array_types import Floats, Integers
from fis_tools.findings.audit.report import Finding, Findings, Severity, Thresholds
from fis_tools.model import Constant, FuzzySystem, Rule, canonical, conjunctions
from fis_tools.words import text

#: centres closer than this, as a fraction of the output's range, are the same
SAME_LEVEL = 1e-6
#: a symmetry shows in at least so many pairs of rules
FEWEST_PAIRS = 4
_Table = tuple[Integers, Floats]


@dataclass(frozen=True)
class CellStep:
    """The change of the concluded term between neighbouring cells of a rule table.

    Parameters
    ----------
    rules : (int, int)
        Numbers of the two rules, from 1.
    change : float
        Of the consequent's centre, as a fraction of the output's range.
    """

    rules: tuple[int, int]
    change: float


#: Cells of a rule table that are looked through.
MOST_CELLS = 1_000_000


def _num_cells(system: FuzzySystem) -> int:
    return prod(len(variable.terms) for variable in system.inputs)


def find(system: FuzzySystem, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield the findings on the rules of a system."""
    yield from _weightless(system)
    yield from _repeated(system)
    yield from _overlapping(system)
    if (table := _table(system)) is not None:
        for axis in range(len(system.inputs)):
            steps = _steps(table, axis)
            yield from _jumps(system, axis, steps, thresholds)
            yield from _turns(system, axis, steps, thresholds)
        yield from _symmetry(system, table, thresholds)
    elif _num_cells(system) > MOST_CELLS and conjunctions(system) is not None:
        yield Finding(
            "neighbours-not-compared",
            Severity.NOTE,
            f"Neighbouring rules are not compared: with {len(system.inputs)} inputs a table has "
            f"{_num_cells(system):.3g} cells, and up to {MOST_CELLS} are looked through.",
            "Look at the answers along single inputs instead, which the audit has.",
        )
    yield from _consistency(system, measures, thresholds)
    yield from _many(measures, thresholds)


def _concludes(rule: Rule) -> dict[str, str]:
    return {consequent.variable: consequent.term for consequent in rule.consequents}


def _weightless(system: FuzzySystem) -> Findings:
    """Yield rules with a conclusion of weight zero."""
    for number, rule in enumerate(system.rules, start=1):
        idle = [consequent for consequent in rule.consequents if consequent.weight == 0.0]
        if idle:
            words = " and ".join(f"{consequent.variable} is {consequent.term}" for consequent in idle)
            yield Finding(
                "no-weight",
                Severity.WARNING,
                f"Rule {number} concludes {words} with weight 0, which changes nothing.",
                "Remove the conclusion, or give it the intended weight.",
                rules=(number,),
            )


def _repeated(system: FuzzySystem) -> Findings:
    """Yield pairs of rules with the same antecedent: duplicates, or contradictions."""
    alike: dict[object, list[int]] = defaultdict(list)
    for number, rule in enumerate(system.rules, start=1):
        alike[canonical(rule.antecedent)].append(number)
    for numbers in alike.values():
        for first, second in combinations(numbers, 2):
            first_conclusions, other = (
                _concludes(system.rules[first - 1]),
                _concludes(system.rules[second - 1]),
            )
            shared = [name for name in first_conclusions if name in other]
            if not shared:
                continue
            adds_up = not all(system.variable(name).counts_strongest for name in shared)
            differ = any(first_conclusions[name] != other[name] for name in shared)
            words = text.antecedent_words(system.rules[first - 1].antecedent)
            conclusions = [
                text.consequent_words(system.rules[number - 1].consequents) for number in (first, second)
            ]
            yield Finding(
                "contradicting-rules" if differ else "duplicate-rules",
                Severity.SERIOUS if differ else Severity.WARNING,
                f"Rules {first} and {second} both begin “If {words}”, but one concludes {conclusions[0]}, "
                f"the other {conclusions[1]}."
                if differ
                else f"Rules {first} and {second} say the same: if {words} then {conclusions[0]}.",
                "Decide which of the two is intended, and remove the other."
                if differ
                else f"Remove one of the two{'' if adds_up else '; it counts no more for being said twice'}.",
                rules=(first, second),
            )


def _overlapping(system: FuzzySystem) -> Findings:
    """Yield pairs of rules where one holds wherever the other does, and they conclude different terms."""
    table = conjunctions(system)
    if table is None or np.all(table[0] >= 0):
        return
    cells, consequents = table
    for wide in np.flatnonzero(np.any(cells < 0, axis=1)):
        is_constrained = cells[wide] >= 0
        narrower = np.all(cells[:, is_constrained] == cells[wide, is_constrained], axis=1) & np.any(
            cells[:, ~is_constrained] >= 0, axis=1
        )
        against = np.flatnonzero(narrower & (consequents != consequents[wide]))
        if len(against):
            narrower_rules = [
                f"rule {number + 1} ({text.consequent_words(system.rules[number].consequents)})"
                for number in against
            ]
            yield Finding(
                "overlapping-rules",
                Severity.WARNING,
                f"Rule {wide + 1} ({text.rule_words(system.rules[wide])}) holds wherever "
                f"{text.listed(narrower_rules)} does, which says otherwise: the output lies between the two.",
                "Restrict the wider rule to what the narrower ones leave, or let them conclude the same.",
                rules=(int(wide) + 1, *(int(number) + 1 for number in against)),
            )


def _table(system: FuzzySystem) -> _Table | None:
    """Lay plain conjunctions out as a table with one axis per input, terms in the order of their centres.

    Returns
    -------
    numbers : int array
        Of the rule of each cell, from 1; 0 where there is none, or several.
    levels : float array
        The centre of its consequent as a fraction of the output's range.
    """
    table = conjunctions(system)
    if table is None or _num_cells(system) > MOST_CELLS:
        return None
    cells, consequents = table
    if system.weighed and not all(isinstance(t.membership, Constant) for t in system.outputs[0].terms):
        return None
    output = system.outputs[0]
    centres = np.array([centre(output, term) for term in output.terms]) / output.span
    numbers = np.zeros([len(variable.terms) for variable in system.inputs], dtype=np.int64)
    count = np.zeros_like(numbers)
    for index, cell in enumerate(cells):
        where = tuple(slice(None) if term < 0 else int(term) for term in cell)
        numbers[where] = index + 1
        count[where] += 1
    numbers[count != 1] = 0
    for axis, variable in enumerate(system.inputs):
        order = np.argsort([centre(variable, term) for term in variable.terms], kind="stable")
        numbers = np.take(numbers, order, axis=axis)
    return numbers, centres[consequents[numbers - 1]]


def _steps(table: _Table, axis: int) -> list[CellStep]:
    """Return the steps between neighbouring cells of a table along an axis, where both have a rule."""
    numbers, levels = (np.moveaxis(part, axis, -1) for part in table)
    pairs = zip(numbers[..., :-1].ravel(), numbers[..., 1:].ravel(), np.diff(levels).ravel(), strict=True)
    return [CellStep((int(a), int(b)), float(change)) for a, b, change in pairs if a and b and a != b]


def _counted(steps: list[CellStep]) -> str:
    return f"{len(steps)} step{'' if len(steps) == 1 else 's'}"


def _step_words(system: FuzzySystem, step: CellStep) -> str:
    """Describe a step: ``from PL (rule 3) to NS (rule 8)``."""
    output = system.outputs[0].name
    words = [f"{_concludes(system.rules[rule - 1])[output]} (rule {rule})" for rule in step.rules]
    return f"from {words[0]} to {words[1]}"


def _jumps(system: FuzzySystem, axis: int, steps: list[CellStep], thresholds: Thresholds) -> Findings:
    """Yield a finding on neighbouring rules along an input whose conclusions lie far apart."""
    variable = system.inputs[axis]
    jumps = sorted((s for s in steps if abs(s.change) > thresholds.jump), key=lambda s: -abs(s.change))
    if not jumps:
        return
    output = system.outputs[0]
    jump = text.amount(output, abs(jumps[0].change) * output.span)
    yield Finding(
        "contradicting-neighbours",
        Severity.WARNING if len(jumps) > thresholds.against * len(steps) else Severity.NOTE,
        f"Along {variable.name}, {len(jumps)} of {len(steps)} steps between neighbouring rules "
        f"{'is' if len(jumps) == 1 else 'are'} more than "
        f"{text.percent(thresholds.jump)} of the range of {output.name}; the largest goes "
        f"{_step_words(system, jumps[0])}, {jump} apart.",
        "Look at these rules in the table; put a value in between unless the jump is intended.",
        variable.name,
        rules=tuple(sorted({rule for step in jumps for rule in step.rules})),
        evidence={"steps": len(steps), "jumps": [[*step.rules, step.change] for step in jumps]},
    )


def _turns(system: FuzzySystem, axis: int, steps: list[CellStep], thresholds: Thresholds) -> Findings:
    """Yield a finding on steps of the rule table along an input that go against its usual direction."""
    variable, output = system.inputs[axis], system.outputs[0]
    rising = [step for step in steps if step.change > 0]
    falling = [step for step in steps if step.change < 0]
    against, usual = (falling, rising) if len(falling) <= len(rising) else (rising, falling)
    if not against:
        return
    worst = max(against, key=lambda step: abs(step.change))
    verbs = ("rises", "falls") if usual is rising else ("falls", "rises")
    share = len(against) / (len(rising) + len(falling))
    if share <= thresholds.against:
        severity = Severity.WARNING
        sentence = (
            f"{output.name} {verbs[0]} with {variable.name} in {_counted(usual)} of the rule table, but "
            f"{verbs[1]} in {len(against)}: most of all {_step_words(system, worst)}."
        )
        cure = "Check these rules: a single step against the others is often a slip."
    else:
        severity = Severity.NOTE
        sentence = (
            f"The rule table has no direction along {variable.name}: {output.name} rises in "
            f"{_counted(rising)} and falls in {len(falling)}, for example {_step_words(system, worst)}."
        )
        cure = (
            f"Ask whether {output.name} should change with {variable.name} in one direction; if so, correct "
            "the rules."
        )
    yield Finding(
        "monotonicity-table",
        severity,
        sentence,
        cure,
        variable.name,
        rules=tuple(sorted({rule for step in against for rule in step.rules})),
        evidence={"rising": len(rising), "falling": len(falling)},
    )


def _symmetry(system: FuzzySystem, table: _Table, thresholds: Thresholds) -> Findings:
    """Yield the few pairs of rules that break a symmetry of the rest of a full rule table.

    Where all inputs, or one, are mirrored, a table may conclude the mirrored term, or the same.
    """
    numbers, levels = table
    if not numbers.all():
        return
    output, everywhere = system.outputs[0], tuple(range(numbers.ndim))
    middle = (output.minimum + output.maximum) / output.span
    ones = [(axis,) for axis in everywhere] if len(everywhere) > 1 else []
    for axes, is_odd in ((everywhere, True), *product(ones, (True, False))):
        reflected = np.flip(levels, axes)
        is_broken = np.abs(levels - (middle - reflected if is_odd else reflected)) > SAME_LEVEL
        both = np.sort([numbers.ravel(), np.flip(numbers, axes).ravel()], axis=0).T
        pairs, broken = (np.unique(rows, axis=0).tolist() for rows in (both, both[is_broken.ravel()]))
        kept = len(pairs) - len(broken)
        if kept < FEWEST_PAIRS or not 0 < len(broken) <= max(1.0, thresholds.asymmetry * len(pairs)):
            continue
        rules = sorted({number for pair in broken for number in pair})
        named = [f"{_concludes(system.rules[n - 1])[output.name]} (rule {n})" for n in rules]
        yield Finding(
            "broken-symmetry",
            Severity.WARNING,
            f"With {text.listed([system.inputs[axis].name for axis in axes])} mirrored, {output.name} is "
            f"{'mirrored too' if is_odd else 'the same'} in {kept} of {len(pairs)} pairs of rules, but not "
            f"in {text.listed(named, 2 * FEWEST_PAIRS)}.",
            "Check these rules: a single pair against the others is often a slip.",
            rules=tuple(rules),
            evidence={"pairs": len(pairs), "broken": broken},
        )


def _consistency(system: FuzzySystem, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield a finding on rules that are outvoted where they fire most strongly."""
    consistency = measures.rule_consistency
    weak = [
        int(i)
        for i in np.argsort(consistency.values, kind="stable")
        if consistency.values[i] < thresholds.consistency
    ]
    if not weak:
        return
    worst = weak[0]
    rule = system.rules[worst]
    answers = [
        f"{variable.name} = {text.amount(variable, answer)} "
        f"(the rule alone would give {text.amount(variable, rule_answer)})"
        for variable, answer, rule_answer in zip(
            system.outputs, consistency.outputs[worst], consistency.alone[worst], strict=True
        )
        if not np.isnan(rule_answer)
    ]
    yield Finding(
        "rule-consistency",
        Severity.WARNING if len(weak) > thresholds.against * len(system.rules) else Severity.NOTE,
        f"{len(weak)} of {len(system.rules)} rules {'is' if len(weak) == 1 else 'are'} outvoted even where "
        f"{'it fires' if len(weak) == 1 else 'they fire'} most strongly. The worst is "
        f"rule {worst + 1} (consistency {consistency.values[worst]:.2f}): it concludes "
        f"{text.consequent_words(rule.consequents)}, but at "
        f"{text.point_words(system, consistency.points[worst])} "
        f"the system gives {' and '.join(answers)}.",
        "Do not read these rules one by one; narrow the terms that overlap them, or make them agree.",
        rules=tuple(index + 1 for index in weak),
        evidence={
            "consistency": consistency.index,
            "values": [float(consistency.values[index]) for index in weak],
        },
    )


def _many(measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield a finding if there are more rules than a person can keep in mind."""
    counted = measures.complexity
    if counted.rules > thresholds.rules:
        yield Finding(
            "complexity",
            Severity.NOTE,
            f"{counted.rules} rules with {counted.premises} premises over {counted.input_terms} terms are "
            "more than a person can keep in mind.",
            "Remove rules that never matter and merge terms (fis_tools simplify proposes which).",
            evidence={"rules": counted.rules, "premises": counted.premises},
        )
