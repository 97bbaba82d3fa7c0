"""Edits by hand, such as a dragged term, as functions from a system to the changed system.

A result with problems is refused by `fis_tools.edit.session.Session`.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import count
from typing import Any, TypeVar

import numpy as np

from fis_tools import model
from fis_tools.formats.exchange.fll_rules import read_rules
from fis_tools.model import FuzzyController, FuzzySystem, Is, Rule, Term, Variable
from fis_tools.model.intervals import sampled_bounds
from fis_tools.model.membership import SHAPES
from fis_tools.model.operators import HEDGES
from fis_tools.words.text import listed

#: half the width of a Gaussian at half its height, in standard deviations
HALF_WIDTH = 1.1774
_Named = TypeVar("_Named", FuzzySystem, Variable, Term)


def _with(items: Sequence[_Named], name: str, *new: _Named) -> tuple[_Named, ...]:
    """Return a sequence in which the item of a name is replaced by some items, perhaps none."""
    return tuple(item for old in items for item in (new if old.name == name else (old,)))


def with_system(controller: FuzzyController, system: FuzzySystem) -> FuzzyController:
    """Return a controller with its system of the same name replaced."""
    return replace(controller, systems=_with(controller.systems, system.name, system))


def with_variable(system: FuzzySystem, variable: Variable) -> FuzzySystem:
    """Return a system with its variable of the same name replaced."""
    return model.with_variables(system, lambda old: variable if old.name == variable.name else old)


def numbers_of(shape: model.MembershipFunction) -> dict[str, str]:
    """Return the numbers of a shape as they are typed, by their names; of a formula, its text."""
    fields_in_words: dict[str, str] = {}
    for field in fields(shape):
        value = getattr(shape, field.name)
        if isinstance(value, model.MembershipFunction):  # a bound of an interval type-2 set
            fields_in_words |= {f"{field.name} {key}": typed for key, typed in numbers_of(value).items()}
            continue
        several = value if isinstance(value, tuple) else (value,)
        fields_in_words[field.name] = ", ".join(
            entry if isinstance(entry, str) else f"{entry:.12g}" for entry in several
        )
    return fields_in_words


def number(typed: str) -> float:
    """Return a number that was typed, or raise ValueError."""
    try:
        return float(typed)
    except ValueError:
        raise ValueError(f"{typed.strip()!r} is no number; type one such as 0.25") from None


def with_number(shape: model.MembershipFunction, name: str, typed: str) -> model.MembershipFunction:
    """Return a shape with one of its numbers replaced, see `numbers_of`."""
    bound, _, key = name.partition(" ")
    if key:
        return replace(shape, **{bound: with_number(getattr(shape, bound), key, typed)})
    value: Any = typed
    match getattr(shape, name):
        case tuple():
            value = tuple(map(number, typed.split(",")))
        case float():
            value = number(typed)
    return replace(shape, **{name: value})


def in_order(shape: model.MembershipFunction, key: str, value: float) -> float:
    """Return a number, held between those that it must not pass; a width stays above zero."""
    order, kinds = shape.entry.ascending, shape.entry.kinds
    if kinds[key] in ("width", "deviation"):
        return max(value, 1e-3 * float(getattr(shape, key)))
    if key in order:
        position = order.index(key)
        ends = [-np.inf, *(getattr(shape, name) for name in order), np.inf]
        return float(np.clip(value, ends[position], ends[position + 2]))
    return value


def reshaped(variable: Variable, term: Term, name: str) -> Term:
    """Return a term of another shape, about where it was."""
    inside = variable.universe[sampled_bounds(variable, term)[1] >= 0.5]
    low, high = (inside[0], inside[-1]) if len(inside) else (variable.minimum, variable.maximum)
    middle = 0.5 * float(low + high)
    width = max(float(high - low), 0.01 * variable.span)
    kinds = SHAPES[name].entry.kinds
    position_keys = [key for key, kind in kinds.items() if kind == "location"]
    spread = (
        np.linspace(middle - width, middle + width, len(position_keys))
        if len(position_keys) > 1
        else [middle]
    )
    sizes = {"width": width / 2, "deviation": width / 2 / HALF_WIDTH, "slope": 8.0 / width, "exponent": 2.0}
    numbers = {key: sizes[kind] for key, kind in kinds.items() if kind != "location"}
    numbers |= dict(zip(position_keys, map(float, spread), strict=True))
    return Term(term.name, SHAPES[name](**numbers))


def new_term(variable: Variable) -> Term:
    """Return a term to be added: in the middle of the range, with a name of its own."""
    taken = {term.name for term in variable.terms}
    name = next(name for n in range(1, len(taken) + 2) if (name := f"term_{n}") not in taken)
    if not variable.has_sets:
        return Term(name, model.Constant(0.0))
    middle, width = 0.5 * (variable.minimum + variable.maximum), 0.25 * variable.span
    return Term(name, model.Triangular(middle - width, middle, middle + width))


def with_rule(system: FuzzySystem, index: int, *rules: Rule) -> FuzzySystem:
    """Return a system with a rule replaced by one, several or none."""
    return replace(system, rules=(*system.rules[:index], *rules, *system.rules[index + 1 :]))


def turned(system: FuzzySystem, rule: int, side: str, index: int, step: int) -> FuzzySystem:
    """Return a system in which a rule's statement (``if``) or conclusion (``then``) has the next term."""
    old_rule, seen = system.rules[rule], count()

    def following(variable: str, term: str) -> str:
        terms = system.variable(variable).terms
        return terms[(system.variable(variable).term_index(term) + step) % len(terms)].name

    def stepped(clause: Is) -> Is:
        """Return the statement at `index`, of those visited in turn, with the next term; others unchanged."""
        return Is(clause.variable, following(clause.variable, clause.term)) if next(seen) == index else clause

    if side == "if":
        return with_rule(
            system, rule, replace(old_rule, antecedent=model.with_statements(old_rule.antecedent, stepped))
        )
    concluded = list(old_rule.consequents)
    clause = concluded[index]
    concluded[index] = replace(clause, term=following(clause.variable, clause.term))
    return with_rule(system, rule, replace(old_rule, consequents=tuple(concluded)))


def with_sentence(system: FuzzySystem, rule: int, text: str) -> FuzzySystem:
    """Return a system in which a rule is replaced by that of a sentence; its label and operators stay.

    Raises
    ------
    ControllerFileError
        If the sentence is no rule.
    """
    old = system.rules[rule]
    words = text.strip().replace("If ", "if ", 1)
    (read,) = read_rules("the sentence", words, ("min", "max"), {hedge: hedge for hedge in HEDGES})
    return with_rule(system, rule, replace(old, antecedent=read.antecedent, consequents=read.consequents))


def repeated(system: FuzzySystem, rule: int, times: int) -> FuzzySystem:
    """Return a system that holds a rule `count` times; 0 removes it."""
    return with_rule(system, rule, *[system.rules[rule]] * times)


def term_touched(
    system: FuzzySystem, variable: Variable, what: str, term: str = "", **details: Any
) -> FuzzySystem:
    """Return a system after a change of a variable's terms, as ``terms.js`` reports it.

    Parameters
    ----------
    what : str
        ``add``, ``remove``, ``rename`` (to ``name``, in the rules too), ``reshape`` (to ``shape``),
        ``number`` (``key`` is ``value``), or ``drag``: the same, held between the other numbers.
    term : str
        The name of the term, unless one is added.

    Raises
    ------
    ValueError
        If a term is to be removed that rules use.
    """
    if what == "add":
        return with_variable(system, replace(variable, terms=(*variable.terms, new_term(variable))))
    old_term = variable.terms[variable.term_index(term)]
    shape = old_term.membership
    match what:
        case "remove":
            touched = variable.name, term
            used = [str(n) for n, rule in enumerate(system.rules, 1) if touched in model.used_terms([rule])]
            if used:
                words = f"rules {listed(used)} use" if len(used) > 1 else f"rule {used[0]} uses"
                raise ValueError(f"{words} the term {term!r}; choose other terms there, then remove it")
            return with_variable(system, replace(variable, terms=_with(variable.terms, term)))
        case "rename":
            names = {(variable.name, term): details["name"].strip()}
            system = replace(system, rules=tuple(model.with_terms(rule, names) for rule in system.rules))
            old_term = replace(old_term, name=details["name"].strip())
        case "reshape":
            old_term = reshaped(variable, old_term, details["shape"])
        case "drag":
            value = in_order(shape, details["key"], float(f"{float(details['value']):.6g}"))
            old_term = replace(old_term, membership=replace(shape, **{details["key"]: value}))
        case "number":
            old_term = replace(old_term, membership=with_number(shape, details["key"], details["value"]))
    return with_variable(system, replace(variable, terms=_with(variable.terms, term, old_term)))
