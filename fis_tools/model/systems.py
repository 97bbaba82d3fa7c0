"""Rules, fuzzy systems, controllers made of them, and rule bases as numbers: rule tables and conjunctions.

Chained rules use other rules' conclusions; `unchained` says them of the inputs. scikit-fuzzy and fuzzylite
pass on a degree of truth, not a number: if a rule uses a term of an output, they take the height at which
that term is cut by the rules computed so far. So the antecedents of those rules, joined by `or`, replace it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain, product
from math import inf, prod
from typing import Any, ClassVar, TypeVar

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.errors import Mistake
from fis_tools.model.numbers import Formula, Number
from fis_tools.model.operators import WEIGHING, AndOperator, Defuzzifier, Hedge, OrOperator, TypeReduction
from fis_tools.model.semantics import TOOLS, Semantics, sampling_points
from fis_tools.model.variables import Variable
from fis_tools.plain_text import plain


@dataclass(frozen=True, slots=True)
class Is:
    """The statement ``variable is term``."""

    variable: str
    term: str


@dataclass(frozen=True, slots=True)
class Not:
    """The complement of a statement."""

    operand: "Expression"


@dataclass(frozen=True, slots=True)
class Hedged:
    """A statement, or several, preceded by a hedge: ``variable is very term``."""

    hedge: Hedge
    operand: "Expression"


@dataclass(frozen=True, slots=True)
class And:
    """The conjunction of statements, combined from left to right."""

    word: ClassVar[str] = "and"
    operands: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of statements, combined from left to right."""

    word: ClassVar[str] = "or"
    operands: tuple["Expression", ...]


Expression = Is | Not | Hedged | And | Or


def parts_of(expression: Expression) -> Iterator[Expression]:
    """Yield an antecedent and all its parts, from left to right."""
    yield expression
    match expression:
        case Not(operand) | Hedged(_, operand):
            yield from parts_of(operand)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from parts_of(operand)


def statements_of(expression: Expression) -> Iterator[Is]:
    """Yield the statements of an antecedent, from left to right."""
    return (part for part in parts_of(expression) if isinstance(part, Is))


def rebuilt(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """Return an antecedent with each of its parts replaced, the inner ones first."""
    match expression:
        case Not(operand):
            return change(Not(rebuilt(operand, change)))
        case Hedged(hedge, operand):
            return change(Hedged(hedge, rebuilt(operand, change)))
        case And(operands) | Or(operands):
            return change(type(expression)(tuple(rebuilt(operand, change) for operand in operands)))
    return change(expression)


def with_statements(expression: Expression, change: Callable[[Is], Expression]) -> Expression:
    """Return an antecedent with each of its statements replaced."""
    return rebuilt(expression, lambda part: change(part) if isinstance(part, Is) else part)


@lru_cache(maxsize=4096)
def canonical(expression: Expression) -> tuple[Any, ...]:
    """Return the same for antecedents that differ in the order and grouping of statements alone."""
    match expression:
        case Not(Not(operand)):
            return canonical(operand)
        case Not(operand):
            return (Not, canonical(operand))
        case Hedged(hedge, operand):
            return (hedge, canonical(operand))
        case And(operands) | Or(operands):
            kind, parts = type(expression), [canonical(operand) for operand in operands]
            inner = sorted(chain(*(part[1] if part[0] is kind else [part] for part in parts)), key=repr)
            return inner[0] if len(inner) == 1 else (kind, tuple(inner))
        case Is(variable, term):
            return (Is, variable, term)


@dataclass(frozen=True, slots=True)
class Consequent:
    """A rule's consequent: ``variable is term``, with its strength multiplied by `weight`."""

    variable: str
    term: str
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Rule:
    """If `antecedent` then all of `consequents`.

    A rule may have its own operators instead of its system's.
    """

    antecedent: Expression
    consequents: tuple[Consequent, ...]
    label: str = ""
    and_operator: AndOperator | None = None
    or_operator: OrOperator | None = None

    @property
    def has_own_operators(self) -> bool:
        """Whether it has its own operators."""
        return self.and_operator is not None or self.or_operator is not None


_Name = TypeVar("_Name", bound=str)

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
    and_operators, or_operators = [each.rule.and_operator], [each.rule.or_operator]

    def replaced(statement: Is) -> Expression:
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


def _agreed_operator(each: Named, word: str, operators: Sequence[_Name | None]) -> _Name | None:
    operators_given = sorted({operator for operator in operators if operator is not None})
    if len(operators_given) > 1:
        raise NotResolvable(
            f"{each.name} and the rules before it in its chain combine by "
            f"{' and '.join(operators_given)}, and one antecedent has one {word!r}; give them the same"
        )
    return operators_given[0] if operators_given else None


@dataclass(frozen=True)
class FuzzySystem:
    """A fuzzy inference system: each output of Mamdani, Takagi-Sugeno or Tsukamoto type.

    A Mamdani output has rules that conclude fuzzy sets, which are aggregated and defuzzified. An output is
    weighted if its defuzzifier is ``weighted_average`` or ``weighted_sum``: each rule then concludes a
    number, weighted by its firing strength. The number is a term itself (Takagi-Sugeno: `Constant`,
    `Linear`), or the point where a term's degree equals the strength (Tsukamoto: a `MonotoneFunction`).

    Parameters
    ----------
    name : str
        The system's name.
    inputs, outputs : tuple of Variable
        In the order in which values are passed and returned.
    rules : tuple of Rule
        In the order in which firing strengths are reported.
    and_operator, or_operator : str
        How statements combine, in rules without their own operators.
    defuzzifier : str
        How an aggregated output becomes a number, by scikit-fuzzy's names, unless the output has its own.
    implication : str
        How a rule's strength shapes the term that it concludes: ``min`` cuts it, ``product`` scales it;
        no effect on weighted outputs.
    semantics : str
        The program whose inference the system means, see `fis_tools.model.semantics`.
    type_reduction : str
        How interval type-2 sets become a number, see `fis_tools.model.intervals`.
    """

    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    and_operator: AndOperator = "min"
    or_operator: OrOperator = "max"
    defuzzifier: Defuzzifier = "centroid"
    implication: AndOperator = "min"
    semantics: Semantics = "scikit-fuzzy"
    type_reduction: TypeReduction = "karnik-mendel"

    @property
    def is_sampled(self) -> bool:
        """Whether outputs are sums over points, and inputs formulas that are not clipped."""
        return self.semantics != "scikit-fuzzy"

    def limits_of(self, variable: Variable) -> tuple[float, float]:
        """Return the numbers to which one of its inputs is clipped."""
        if self.is_sampled and not variable.is_clipped:
            return -inf, inf
        return float(variable.universe[0]), float(variable.universe[-1])

    def points_of(self, output: Variable) -> Floats:
        """Return the points at which one of its outputs is aggregated, ascending."""
        if not self.is_sampled:
            return output.universe
        return sampling_points(self.semantics, output.minimum, output.maximum, output.num_points)

    def cuts(self, output: Variable) -> bool:
        """Return whether an output's terms are cut and aggregated by the maximum."""
        return self.implication == "min" and output.aggregation == "max" and not self.weighs(output)

    def joins_numbers(self, output: Variable) -> bool:
        """Return whether the strengths of rules that conclude the same number join by the accumulation."""
        return self.semantics == "fcl" and self.weighs(output)

    def weighs(self, output: Variable) -> bool:
        """Return whether an output is a weighted average or sum (Takagi-Sugeno or Tsukamoto)."""
        return self.defuzzifier_of(output) in WEIGHING

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The inputs, then the outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def weighed(self) -> tuple[Variable, ...]:
        """The outputs that are weighted averages or sums."""
        return tuple(output for output in self.outputs if self.weighs(output))

    def variable(self, name: str) -> Variable:
        """Return the input or output called `name`.

        Raises
        ------
        KeyError
            If there is none.
        """
        for variable in self.variables:
            if variable.name == name:
                return variable
        known = ", ".join(v.name for v in self.variables)
        raise KeyError(f"system {self.name!r} has no variable {name!r}; its variables are {known}")

    def conclusions_on(self, output: Variable) -> Iterator[tuple[int, Consequent]]:
        """Yield what rules conclude on an output, in their order, each with the index of its rule."""
        for index, rule in enumerate(self.rules):
            yield from ((index, each) for each in rule.consequents if each.variable == output.name)

    def and_operator_of(self, rule: Rule) -> AndOperator:
        """Return how `and` combines in one of its rules."""
        return rule.and_operator or self.and_operator

    def or_operator_of(self, rule: Rule) -> OrOperator:
        """Return how `or` combines in one of its rules."""
        return rule.or_operator or self.or_operator

    def defuzzifier_of(self, output: Variable) -> Defuzzifier:
        """Return how one of its outputs becomes a number."""
        return output.defuzzifier or self.defuzzifier


def with_joint_operators(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules and outputs state only operators that differ from the system's.

    The system takes an operator from the first rule that uses it, and the defuzzifier of its first output.
    """
    kept = []
    for rule in system.rules:
        kinds = {type(part) for part in parts_of(rule.antecedent)}
        conjunction = system.and_operator_of(rule) if And in kinds else None
        kept.append((conjunction, system.or_operator_of(rule) if Or in kinds else None))
    and_operator = next((each for each, _ in kept if each is not None), system.and_operator)
    or_operator = next((each for _, each in kept if each is not None), system.or_operator)
    ways = [system.defuzzifier_of(output) for output in system.outputs]
    defuzzifier = ways[0] if ways else system.defuzzifier
    rules, outputs = [], []
    for rule, (conjunction, disjunction) in zip(system.rules, kept, strict=True):
        own_and = None if conjunction == and_operator else conjunction
        own_or = None if disjunction == or_operator else disjunction
        rules.append(replace(rule, and_operator=own_and, or_operator=own_or))
    for output, way in zip(system.outputs, ways, strict=True):
        outputs.append(replace(output, defuzzifier=None if way == defuzzifier else way))
    shared = replace(system, and_operator=and_operator, or_operator=or_operator, defuzzifier=defuzzifier)
    return replace(shared, rules=tuple(rules), outputs=tuple(outputs))


def with_semantics(system: FuzzySystem, semantics: Semantics) -> FuzzySystem:
    """Return a system with the same terms and rules, inferred as another program does.

    What that program does not know is left out: points of an output's own, inputs that are clipped by
    themselves, accumulations. An output that must have a default gets the middle of its range.
    """
    target = replace(system, semantics=semantics)
    needs_default = not TOOLS[semantics].has_outputs_without_default
    outputs = []
    for output in system.outputs:
        default = output.default
        if default is None and needs_default:
            default = 0.5 * output.minimum + 0.5 * output.maximum
        accumulation = output.accumulation if semantics == system.semantics else "max"
        if target.joins_numbers(output) and not system.joins_numbers(output):
            accumulation = "unbounded_sum"
        points = None if target.is_sampled else output.points
        outputs.append(replace(output, default=default, points=points, accumulation=accumulation))
    inputs = tuple(replace(v, is_clipped=v.is_clipped and target.is_sampled) for v in system.inputs)
    return replace(target, inputs=inputs, outputs=tuple(outputs))


@dataclass(frozen=True, slots=True)
class Wire:
    """A connection of two systems, whose ends are written ``system/variable``.

    Parameters
    ----------
    source : str
        An output whose value is passed on, or an input that shares its value.
    target : str
        The input that takes it.
    """

    source: str
    target: str


@dataclass(frozen=True)
class FuzzyController:
    """A set of fuzzy systems, with further data for their user.

    Parameters
    ----------
    name : str
        The controller's name.
    systems : tuple of FuzzySystem
        In the order in which they are shown.
    attributes : tuple of (str, str)
        Facts for the controller's user; passed on without interpretation, sorted by key.
    provenance : tuple of (str, str)
        Origin of the controller; passed on without interpretation, sorted by key.
    purpose : str
        What it is for and how it acts, in sentences for the person who uses it.
    wires : tuple of Wire
        Which inputs take the values of outputs, see `fis_tools.model.trees`.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    attributes: tuple[tuple[str, str], ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
    purpose: str = ""
    wires: tuple[Wire, ...] = ()

    def __post_init__(self) -> None:
        """Clean the facts."""
        object.__setattr__(self, "attributes", plain(self.attributes))
        object.__setattr__(self, "provenance", plain(self.provenance))

    def only_system(self, cure: str) -> FuzzySystem:
        """Return its one system; raise Mistake, which says the cure, where it has several."""
        if len(self.systems) != 1:
            names = ", ".join(system.name for system in self.systems)
            raise Mistake(f"controller {self.name!r} has several systems, {names}; {cure}")
        return self.systems[0]

    def acts_like(self, other: "FuzzyController") -> bool:
        """Return whether both have equal systems and attributes, names and purposes aside."""
        ours, theirs = ((each.systems, each.wires, each.attributes) for each in (self, other))
        return ours == theirs

    def only(self, names: Iterable[str]) -> "FuzzyController":
        """Return it with the systems of these names alone, each for itself: without wires."""
        kept = frozenset(names)
        return replace(self, systems=tuple(s for s in self.systems if s.name in kept), wires=())

    def with_provenance(self, facts: Mapping[str, str]) -> "FuzzyController":
        """Return the controller with facts added to its provenance, or replaced by key."""
        return replace(self, provenance=tuple(sorted({**dict(self.provenance), **facts}.items())))


def table_antecedents(inputs: Sequence[Variable]) -> Iterator[Expression]:
    """Yield the antecedent of every cell of a full rule table, the last input changing fastest."""
    for terms in product(*(variable.terms for variable in inputs)):
        statements = tuple(Is(v.name, t.name) for v, t in zip(inputs, terms, strict=True))
        yield statements[0] if len(statements) == 1 else And(statements)


def table_rules(inputs: Sequence[Variable], output: Variable, consequents: Sequence[str]) -> tuple[Rule, ...]:
    """Build a full rule table.

    Parameters
    ----------
    inputs : sequence of Variable
        The table's axes.
    output : Variable
        Variable of the conclusions.
    consequents : sequence of str
        The output term of each cell, the last input changing fastest.

    Raises
    ------
    ValueError
        If the number of consequents is not the number of cells.
    """
    num_cells = prod(len(variable.terms) for variable in inputs)
    if num_cells != len(consequents):
        raise ValueError(
            f"a full table over {len(inputs)} inputs has {num_cells} rules, but {len(consequents)} "
            "consequents are given; give one output term for each combination of input terms"
        )
    return tuple(
        Rule(antecedent, (Consequent(output.name, term),))
        for antecedent, term in zip(table_antecedents(inputs), consequents, strict=True)
    )


def rule_table(system: FuzzySystem) -> Integers | None:
    """Return the consequents of a full rule table as output term indices, or None for any other rule base.

    A full table has one output and one rule for each combination of input terms, in the order of
    `table_antecedents`, each with weight one and without its own operators.

    Returns
    -------
    array or None
        Shape (number of cells,), the last input changing fastest.
    """
    if prod(len(variable.terms) for variable in system.inputs) != len(system.rules):
        return None
    cells_of = conjunctions(system)
    cells = table_antecedents(system.inputs)
    is_full = all(rule.antecedent == cell for rule, cell in zip(system.rules, cells, strict=True))
    return None if cells_of is None or not is_full else cells_of[1]


def with_terms(rule: Rule, names: Mapping[tuple[str, str], str]) -> Rule:
    """Return a rule with other terms, by variable and term, in what it asks and concludes."""
    if not names:
        return rule
    return renamed(rule, lambda variable, term: (variable, names.get((variable, term), term)))


def renamed(rule: Rule, called: Callable[[str, str], tuple[str, str]]) -> Rule:
    """Return a rule with other names for variables and terms; ``called`` returns both, given both."""
    consequents = (Consequent(*called(c.variable, c.term), c.weight) for c in rule.consequents)
    antecedent = with_statements(
        rule.antecedent, lambda statement: Is(*called(statement.variable, statement.term))
    )
    return replace(rule, antecedent=antecedent, consequents=tuple(consequents))


def used_terms(rules: Iterable[Rule]) -> set[tuple[str, str]]:
    """Return what rules ask for and conclude, by variable and term."""
    used = {
        (statement.variable, statement.term) for rule in rules for statement in statements_of(rule.antecedent)
    }
    return used | {(statement.variable, statement.term) for rule in rules for statement in rule.consequents}


def with_variables(system: FuzzySystem, change: Callable[[Variable], Variable]) -> FuzzySystem:
    """Return a system with each of its variables replaced."""
    inputs, outputs = (tuple(map(change, side)) for side in (system.inputs, system.outputs))
    return replace(system, inputs=inputs, outputs=outputs)


def table_cells(inputs: Sequence[Variable]) -> Integers:
    """Return the cells of a full table as input term indices, (cells, inputs), the last input fastest."""
    counts = [len(variable.terms) for variable in inputs]
    return np.indices(counts, dtype=np.int64).reshape(len(counts), -1).T.copy()


def conjunction(antecedent: Expression) -> dict[str, str] | None:
    """Return the term that an antecedent asks for of each input; None where it is no plain conjunction."""
    statements = antecedent.operands if isinstance(antecedent, And) else (antecedent,)
    terms = {statement.variable: statement.term for statement in statements if isinstance(statement, Is)}
    return terms if len(terms) == len(statements) else None


def conjunctions(system: FuzzySystem) -> tuple[Integers, Integers] | None:
    """Return the rules of a system as numbers if each is a plain conjunction, else None.

    Such a rule base has one output, and each rule uses at most one term of each input, concludes one
    term with weight one and has no operators of its own. Full rule tables are included, as are tables with
    missing cells.

    Returns
    -------
    cells : (rules, inputs) int
        The term of each input that a rule uses; -1 for none.
    consequents : (rules,) int
        The output term that it concludes.
    """
    if len(system.outputs) != 1:
        return None
    columns = {variable.name: column for column, variable in enumerate(system.inputs)}
    cells = np.full((len(system.rules), len(system.inputs)), -1, dtype=np.int64)
    consequents = np.empty(len(system.rules), dtype=np.int64)
    for index, rule in enumerate(system.rules):
        terms = conjunction(rule.antecedent)
        if terms is None:
            return None
        for name, term in terms.items():
            cells[index, columns[name]] = system.inputs[columns[name]].term_index(term)
        if len(rule.consequents) != 1 or rule.consequents[0].weight != 1.0 or rule.has_own_operators:
            return None
        consequent = rule.consequents[0]
        consequents[index] = system.outputs[0].term_index(consequent.term)
    return cells, consequents


def require_mamdani(systems: Iterable[FuzzySystem], what: str) -> None:
    """Raise Mistake for systems with weighted outputs.

    Parameters
    ----------
    systems : iterable of FuzzySystem
    what : str
        What requires fuzzy sets, as the beginning of a sentence.

    Raises
    ------
    Mistake
        If there is such an output.
    """
    for system in systems:
        for output in system.weighed:
            way = system.defuzzifier_of(output).replace("_", " ")
            raise Mistake(
                f"{what} is for Mamdani systems, whose rules conclude fuzzy sets, but output "
                f"{output.name!r} of {system.name!r} is a {way} of numbers; show, audit, explain, review, "
                "bounds, surface, plot, diff and export take it"
            )


def reach(output: Variable, inputs: Sequence[Variable]) -> tuple[float, float]:
    """Return the least and the greatest value of an output's terms over the ranges of the inputs.

    If they are equal, a range of width one centred on them.
    """
    low, high = [], []
    for term in output.terms:
        if isinstance(term.membership, Number) and not isinstance(term.membership, Formula):
            *coefficients, constant = term.membership.row(len(inputs))
            ends = [sorted((c * v.minimum, c * v.maximum)) for c, v in zip(coefficients, inputs, strict=True)]
            low.append(constant + sum(least for least, _ in ends))
            high.append(constant + sum(greatest for _, greatest in ends))
    least, greatest = min(low, default=output.minimum), max(high, default=output.maximum)
    return (least, greatest) if least < greatest else (least - 0.5, greatest + 0.5)
