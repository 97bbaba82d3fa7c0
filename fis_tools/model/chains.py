"""Rules that ask for outputs of other rules, written out in terms of the inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fis_tools.model.expressions import Expression, Is, Or, statements_of, with_statements
from fis_tools.model.systems import Consequent, Name, Rule
from fis_tools.model.variables import Variable

#: Most statements in one antecedent; chains can double their number from link to link.
MOST_STATEMENTS = 10_000


class NotResolvable(ValueError):  # noqa: N818 - the sentence is the message
    """Raised for a chain that cannot be expressed by the inputs alone."""


@dataclass(frozen=True)
class Named:
    """A rule with its name in error messages."""

    name: str
    rule: Rule


def unchained(rules: Sequence[Named], outputs: Mapping[str, Variable]) -> list[Rule]:
    """Return rules in terms of the inputs only, given in the order in which they are computed.

    Raises
    ------
    NotResolvable
        If no antecedent can replace what a rule uses.
    """
    concluded: dict[Is, list[tuple[Named, Consequent]]] = {}
    replaced: list[Rule] = []
    for each in rules:
        conditioned = {statement.variable for statement in statements_of(each.rule.antecedent)}
        rule = each.rule if conditioned.isdisjoint(outputs) else _inlined(each, concluded, outputs)
        if sum(1 for _ in statements_of(rule.antecedent)) > MOST_STATEMENTS:
            raise NotResolvable(
                f"{each.name} comes to more than {MOST_STATEMENTS} statements; shorten its chain"
            )
        replaced.append(rule)
        for consequent in rule.consequents:
            key = Is(consequent.variable, consequent.term)
            concluded.setdefault(key, []).append((Named(each.name, rule), consequent))
    return replaced


def _inlined(
    each: Named, concluded: Mapping[Is, list[tuple[Named, Consequent]]], outputs: Mapping[str, Variable]
) -> Rule:
    """Return a rule whose statements on other rules' conclusions are replaced by their antecedents."""
    and_operators, or_operators = [each.rule.and_operator], [each.rule.or_operator]

    def replaced(statement: Is) -> Expression:
        """Return the antecedents of the rules that conclude a statement, joined by `or`."""
        if statement.variable not in outputs:
            return statement
        sources = concluded.get(statement, [])
        _require_plain(each, statement, sources, outputs[statement.variable])
        and_operators.extend(source.rule.and_operator for source, _ in sources)
        or_operators.extend(source.rule.or_operator for source, _ in sources)
        if len(sources) > 1:
            or_operators.append("max")
        parts = tuple(source.rule.antecedent for source, _ in sources)
        return parts[0] if len(parts) == 1 else Or(parts)

    antecedent = with_statements(each.rule.antecedent, replaced)
    return replace(
        each.rule,
        antecedent=antecedent,
        and_operator=_agreed_operator(each, "and", and_operators),
        or_operator=_agreed_operator(each, "or", or_operators),
    )


def _require_plain(
    each: Named, statement: Is, sources: Sequence[tuple[Named, Consequent]], output: Variable
) -> None:
    """Raise NotResolvable unless an antecedent can say what a statement on an output stands for."""
    if not sources:
        raise NotResolvable(
            f"{each.name} asks for {statement.variable!r} {statement.term!r}, which no rule before it "
            "concludes; put the rule that does so before it"
        )
    for source, consequent in sources:
        if consequent.weight != 1.0:
            raise NotResolvable(
                f"{each.name} asks for {statement.variable!r} {statement.term!r}, which "
                f"{source.name} concludes with weight {consequent.weight:g}, and no antecedent says "
                "that; conclude it with weight 1"
            )
    if len(sources) > 1 and not output.counts_strongest:
        joins = output.accumulation if output.accumulation != "max" else output.aggregation
        raise NotResolvable(
            f"{each.name} asks for {statement.variable!r} {statement.term!r}, where {joins} joins "
            f"{len(sources)} rules, and only the maximum can be said in an antecedent; join them by "
            "the maximum"
        )


def _agreed_operator(each: Named, word: str, operators: Sequence[Name | None]) -> Name | None:
    """Return the one operator that rules of a chain state; None if none states any."""
    operators_given = sorted({operator for operator in operators if operator is not None})
    if len(operators_given) > 1:
        raise NotResolvable(
            f"{each.name} and the rules before it in its chain combine by "
            f"{' and '.join(operators_given)}, and one antecedent has one {word!r}; give them the same"
        )
    return operators_given[0] if operators_given else None
