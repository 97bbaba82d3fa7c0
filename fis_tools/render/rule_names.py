"""Rules in few words, for the side of a picture."""

from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule
from fis_tools.words.text import antecedent_words, number


def legend(system: FuzzySystem) -> str:
    """Say how the names of a system's plain rules are to be read: the inputs in order, then the outputs."""
    return f"{' · '.join(v.name for v in system.inputs)} → {', '.join(v.name for v in system.outputs)}"


def rule_names(system: FuzzySystem) -> list[str]:
    """Name each rule by its number and its words.

    A rule that asks for at most one term of each input, and for nothing else, is told by its terms in the
    order of `legend`, ``any`` for an input it does not ask for: ``4: near · still → PS``. Others are told
    with the names of their inputs.
    """
    return [f"{place}: {_name(system, rule)}" for place, rule in enumerate(system.rules, start=1)]


def plain_statements(rule: Rule) -> dict[str, str] | None:
    """Return the term that a rule asks for of each input, or None where it is not a plain conjunction."""
    statements = rule.antecedent.operands if isinstance(rule.antecedent, And) else (rule.antecedent,)
    asked = {statement.variable: statement.term for statement in statements if isinstance(statement, Is)}
    return asked if len(asked) == len(statements) else None


def conclusion(consequent: Consequent) -> str:
    """Say the term of a consequent, and its weight where that is not one."""
    weight = "" if consequent.weight == 1.0 else f" × {number(consequent.weight)}"
    return f"{consequent.term}{weight}"


def _name(system: FuzzySystem, rule: Rule) -> str:
    asked = plain_statements(rule)
    if asked is None:
        words = antecedent_words(rule.antecedent)
    else:
        words = " · ".join(asked.get(variable.name, "any") for variable in system.inputs)
    if len(system.outputs) == 1:
        return f"{words} → {conclusion(rule.consequents[0])}"
    return f"{words} → {', '.join(f'{c.variable} {conclusion(c)}' for c in rule.consequents)}"
