"""A system at which something differs, made as small as it still does."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import And, Expression, FuzzySystem, Hedged, Is, Not, Or, Rule
from fis_tools.model.numbers import Formula, Linear
from fis_tools.model.systems import used_terms
from fis_tools.model.validate import problems

#: Whether something still differs.
Fails = Callable[[FuzzySystem, Floats], bool]


def shrunk(system: FuzzySystem, row: Floats, fails: Fails, most: int = 300) -> tuple[FuzzySystem, Floats]:
    """Try smaller systems, one step after the other, as long as the difference stays."""
    tried, is_smaller = 0, True
    while is_smaller and tried < most:
        is_smaller = False
        for smaller, at in _steps(system, row):
            tried += 1
            if tried > most:
                break
            if not problems(smaller) and _still(fails, smaller, at):
                system, row, is_smaller = smaller, at, True
                break
    return system, row


def _still(fails: Fails, system: FuzzySystem, row: Floats) -> bool:
    try:
        return fails(system, row)
    except Exception:  # noqa: BLE001 - another fault than the one that is shrunk
        return False


def _steps(system: FuzzySystem, row: Floats) -> Iterator[tuple[FuzzySystem, Floats]]:
    for index in range(len(system.rules)):
        yield replace(system, rules=system.rules[:index] + system.rules[index + 1 :]), row
    yield from _without_variables(system, row)
    for index, rule in enumerate(system.rules):
        for simpler in _simpler_rules(rule):
            yield replace(system, rules=(*system.rules[:index], simpler, *system.rules[index + 1 :])), row
    used = used_terms(system.rules)
    for side in ("inputs", "outputs"):
        for index, variable in enumerate(getattr(system, side)):
            terms = tuple(term for term in variable.terms if (variable.name, term.name) in used)
            few = [replace(variable, terms=terms)] if 0 < len(terms) < len(variable.terms) else []
            if variable.num_points > 3 and variable.points is None:
                few += [
                    replace(variable, num_points=count) for count in (2, 3, 11) if count < variable.num_points
                ]
            for changed in few:
                variables = list(getattr(system, side))
                variables[index] = changed
                yield replace(system, **{side: tuple(variables)}), row
    for digits in (0, 1, 3):
        rounded = np.round(row, digits)
        if (rounded != row).any():
            yield system, rounded


def _without_variables(system: FuzzySystem, row: Floats) -> Iterator[tuple[FuzzySystem, Floats]]:
    """Without an output that is not needed, or an input that no rule asks for."""
    for output in system.outputs if len(system.outputs) > 1 else ():
        rules = []
        for rule in system.rules:
            kept = tuple(c for c in rule.consequents if c.variable != output.name)
            rules += [replace(rule, consequents=kept)] if kept else []
        yield (
            replace(system, outputs=tuple(v for v in system.outputs if v != output), rules=tuple(rules)),
            row,
        )
    used = {variable for variable, _ in used_terms(system.rules)}
    numbers = [term.membership for output in system.outputs for term in output.terms]
    if any(isinstance(number, Formula | Linear) for number in numbers):
        return
    for index, variable in enumerate(system.inputs):
        if variable.name not in used and len(system.inputs) > 1:
            left = system.inputs[:index] + system.inputs[index + 1 :]
            yield replace(system, inputs=left), np.delete(row, index)


def _simpler_rules(rule: Rule) -> Iterator[Rule]:
    for index in range(len(rule.consequents) if len(rule.consequents) > 1 else 0):
        yield replace(rule, consequents=rule.consequents[:index] + rule.consequents[index + 1 :])
    if any(c.weight != 1.0 for c in rule.consequents):
        yield replace(rule, consequents=tuple(replace(c, weight=1.0) for c in rule.consequents))
    for expression in _simpler(rule.antecedent):
        yield replace(rule, antecedent=expression)


def _simpler(expression: Expression) -> Iterator[Expression]:
    match expression:
        case Is():
            return
        case Not(operand) | Hedged(_, operand):
            yield operand
            for inner in _simpler(operand):
                yield replace(expression, operand=inner)
        case And(operands) | Or(operands):
            yield from operands
            for index, operand in enumerate(operands):
                if len(operands) > 1:
                    yield replace(expression, operands=operands[:index] + operands[index + 1 :])
                for inner in _simpler(operand):
                    yield replace(expression, operands=(*operands[:index], inner, *operands[index + 1 :]))
