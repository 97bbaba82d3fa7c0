"""Touches: what a hand does to a system, as functions from one system to the next.

They check nothing: a result with problems is refused by `fis_tools.edit.session.Session`.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import count
from typing import Any

import numpy as np

from fis_tools.formats.exchange.fll_rules import read_own
from fis_tools.model import (
    Consequent,
    Constant,
    Formula,
    FuzzyController,
    FuzzySystem,
    Is,
    MembershipFunction,
    Rule,
    Term,
    Triangular,
    Variable,
    with_statements,
)
from fis_tools.model.shape import SHAPES
from fis_tools.model.systems import has_sets
from fis_tools.model.variables import sample

#: half the width of a Gaussian at half its height, in standard deviations
HALF_WIDTH = 1.1774


def with_system(controller: FuzzyController, system: FuzzySystem) -> FuzzyController:
    """Return a controller with its system of the same name replaced."""
    systems = tuple(system if one.name == system.name else one for one in controller.systems)
    return replace(controller, systems=systems)


def with_variable(system: FuzzySystem, variable: Variable) -> FuzzySystem:
    """Return a system with its variable of the same name replaced."""

    def put(variables: Sequence[Variable]) -> tuple[Variable, ...]:
        return tuple(variable if one.name == variable.name else one for one in variables)

    return replace(system, inputs=put(system.inputs), outputs=put(system.outputs))


def with_term(variable: Variable, name: str, term: Term | None) -> Variable:
    """Return a variable with one of its terms replaced, or without it."""
    kept = [(term if one.name == name else one) for one in variable.terms]
    return replace(variable, terms=tuple(one for one in kept if one is not None))


def numbers_of(shape: MembershipFunction) -> dict[str, float | str]:
    """Return the numbers of a shape by their keys, such as ``coefficients.0``; of a formula, its text."""
    if isinstance(shape, Formula):
        return {"text": shape.text}
    found: dict[str, float | str] = {key: getattr(shape, key) for key in shape.entry.kinds}
    if coefficients := getattr(shape, "coefficients", ()):
        found |= {f"coefficients.{place}": value for place, value in enumerate(coefficients)}
    return found


def with_number(shape: MembershipFunction, key: str, value: float | str) -> MembershipFunction:
    """Return a shape with one of its numbers replaced; keys are those of `numbers_of`."""
    name, _, place = key.partition(".")
    if name not in {field.name for field in fields(shape)}:
        raise ValueError(f"{shape.entry.name} has no number {key!r}")
    if place:
        values = list(getattr(shape, name))
        values[int(place)] = value
        return replace(shape, **{name: tuple(values)})
    return replace(shape, **{name: value})


def in_order(shape: MembershipFunction, key: str, value: float) -> float:
    """Return a number, held between those that it must not pass; a width stays above zero."""
    order, kinds = shape.entry.ascending, shape.entry.kinds
    if kinds[key] in ("width", "deviation"):
        return max(value, 1e-3 * float(getattr(shape, key)))
    if key in order:
        place = order.index(key)
        ends = [-np.inf, *(getattr(shape, name) for name in order), np.inf]
        return float(np.clip(value, ends[place], ends[place + 2]))
    return value


def reshaped(variable: Variable, term: Term, name: str) -> Term:
    """Return a term of another shape, about where it was."""
    inside = variable.universe[sample(variable, term) >= 0.5]
    low, high = (inside[0], inside[-1]) if len(inside) else (variable.minimum, variable.maximum)
    middle = 0.5 * float(low + high)
    width = max(float(high - low), 0.01 * (variable.maximum - variable.minimum))
    kinds = SHAPES[name].entry.kinds
    places = [key for key, kind in kinds.items() if kind == "place"]
    spread = np.linspace(middle - width, middle + width, len(places)) if len(places) > 1 else [middle]
    sizes = {"width": width / 2, "deviation": width / 2 / HALF_WIDTH, "slope": 8.0 / width, "exponent": 2.0}
    numbers = {key: sizes[kind] for key, kind in kinds.items() if kind != "place"}
    numbers |= dict(zip(places, map(float, spread), strict=True))
    return Term(term.name, SHAPES[name](**numbers))


def new_term(variable: Variable) -> Term:
    """Return a term to be added: in the middle of the range, with a name of its own."""
    taken = {term.name for term in variable.terms}
    name = next(name for n in range(1, len(taken) + 2) if (name := f"term_{n}") not in taken)
    if not has_sets(variable):
        return Term(name, Constant(0.0))
    middle, width = 0.5 * (variable.minimum + variable.maximum), 0.25 * (variable.maximum - variable.minimum)
    return Term(name, Triangular(middle - width, middle, middle + width))


def renamed(system: FuzzySystem, variable: Variable, old: str, new: str) -> FuzzySystem:
    """Return a system with a term renamed, in its rules too."""

    def asked(one: Is) -> Is:
        return Is(one.variable, new) if one == Is(variable.name, old) else one

    def concluded(one: Consequent) -> Consequent:
        return replace(one, term=new) if (one.variable, one.term) == (variable.name, old) else one

    rules = tuple(
        replace(
            rule,
            antecedent=with_statements(rule.antecedent, asked),
            consequents=tuple(map(concluded, rule.consequents)),
        )
        for rule in system.rules
    )
    term = replace(variable.terms[variable.term_index(old)], name=new)
    return replace(with_variable(system, with_term(variable, old, term)), rules=rules)


def with_rule(system: FuzzySystem, place: int, *rules: Rule) -> FuzzySystem:
    """Return a system with a rule replaced by one, several or none."""
    return replace(system, rules=(*system.rules[:place], *rules, *system.rules[place + 1 :]))


def turned(system: FuzzySystem, rule: int, side: str, place: int, step: int) -> FuzzySystem:
    """Return a system where a statement (``if``) or a conclusion (``then``) of a rule has the next term."""
    held, seen = system.rules[rule], count()

    def following(variable: str, term: str) -> str:
        terms = system.variable(variable).terms
        return terms[(system.variable(variable).term_index(term) + step) % len(terms)].name

    def asked(one: Is) -> Is:
        return Is(one.variable, following(one.variable, one.term)) if next(seen) == place else one

    if side == "if":
        return with_rule(system, rule, replace(held, antecedent=with_statements(held.antecedent, asked)))
    concluded = list(held.consequents)
    one = concluded[place]
    concluded[place] = replace(one, term=following(one.variable, one.term))
    return with_rule(system, rule, replace(held, consequents=tuple(concluded)))


def said(system: FuzzySystem, rule: int, text: str) -> FuzzySystem:
    """Return a system whose rule is what a sentence says; it keeps its label and its operators.

    Raises
    ------
    ControllerFileError
        If the sentence is no rule.
    """
    held = system.rules[rule]
    (read,) = read_own("the sentence", text.strip().replace("If ", "if ", 1))
    return with_rule(system, rule, replace(held, antecedent=read.antecedent, consequents=read.consequents))


def repeated(system: FuzzySystem, rule: int, times: int) -> FuzzySystem:
    """Return a system that has a rule so many times; none removes it."""
    return with_rule(system, rule, *[system.rules[rule]] * times)


def term_touched(
    system: FuzzySystem, variable: Variable, what: str, term: str = "", **told: Any
) -> FuzzySystem:
    """Return a system after a touch of a variable's terms, as ``terms.js`` tells of it.

    Parameters
    ----------
    what : str
        ``add``, ``remove``, ``rename`` (to ``name``), ``reshape`` (to ``shape``), ``number`` (``key`` is
        ``value``), or ``drag``: the same, held between the other numbers.
    term : str
        The name of the term, unless one is added.
    """
    if what == "add":
        terms = (*variable.terms, new_term(variable))
        return with_variable(system, replace(variable, terms=terms))
    if what == "rename":
        return renamed(system, variable, term, told["name"].strip())
    held = variable.terms[variable.term_index(term)]
    if what == "remove":
        return with_variable(system, with_term(variable, term, None))
    if what == "reshape":
        return with_variable(system, with_term(variable, term, reshaped(variable, held, told["shape"])))
    key, value = told["key"], told["value"]
    if what == "drag":
        value = in_order(held.membership, key, float(f"{float(value):.6g}"))
    elif key != "text":
        value = float(value)
    changed = replace(held, membership=with_number(held.membership, key, value))
    return with_variable(system, with_term(variable, term, changed))
