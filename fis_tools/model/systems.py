"""Rules, fuzzy systems, controllers made of them, and rule bases as numbers: rule tables and conjunctions.

Chained rules use other rules' conclusions; `unchained` says them of the inputs. scikit-fuzzy and fuzzylite
pass on a degree of truth, not a number: if a rule uses a term of an output, they take the height at which
that term is cut by the rules computed so far. So the antecedents of those rules, joined by `or`, replace it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

from fis_tools.array_types import Floats
from fis_tools.errors import Mistake
from fis_tools.model.expressions import And, Expression, Is, Or, parts_of, statements_of, with_statements
from fis_tools.model.numbers import Formula, Number
from fis_tools.model.operators import WEIGHING, AndOperator, Defuzzifier, OrOperator, TypeReduction
from fis_tools.model.semantics import TOOLS, Semantics, sampling_points
from fis_tools.model.variables import Variable
from plain_files.plain_text import plain


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


Name = TypeVar("Name", bound=str)


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
        """Yield the rules' conclusions on an output, in order, each with the index of its rule."""
        for index, rule in enumerate(self.rules):
            yield from ((index, each) for each in rule.consequents if each.variable == output.name)

    def and_operator_of(self, rule: Rule) -> AndOperator:
        """Return how `and` combines in one of its rules."""
        return rule.and_operator or self.and_operator

    def or_operator_of(self, rule: Rule) -> OrOperator:
        """Return how `or` combines in one of its rules."""
        return rule.or_operator or self.or_operator

    def defuzzifier_of(self, output: Variable) -> Defuzzifier:
        """Return the defuzzifier of one of its outputs."""
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
    methods = [system.defuzzifier_of(output) for output in system.outputs]
    defuzzifier = methods[0] if methods else system.defuzzifier
    rules, outputs = [], []
    for rule, (conjunction, disjunction) in zip(system.rules, kept, strict=True):
        own_and = None if conjunction == and_operator else conjunction
        own_or = None if disjunction == or_operator else disjunction
        rules.append(replace(rule, and_operator=own_and, or_operator=own_or))
    for output, method in zip(system.outputs, methods, strict=True):
        outputs.append(replace(output, defuzzifier=None if method == defuzzifier else method))
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
        """Return a controller of the systems with these names, without wires."""
        kept = frozenset(names)
        return replace(self, systems=tuple(s for s in self.systems if s.name in kept), wires=())

    def with_provenance(self, facts: Mapping[str, str]) -> "FuzzyController":
        """Return the controller with facts added to its provenance, or replaced by key."""
        return replace(self, provenance=tuple(sorted({**dict(self.provenance), **facts}.items())))


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
    """Return the (variable, term) pairs that rules ask for or conclude."""
    used = {
        (statement.variable, statement.term) for rule in rules for statement in statements_of(rule.antecedent)
    }
    return used | {(statement.variable, statement.term) for rule in rules for statement in rule.consequents}


def with_variables(system: FuzzySystem, change: Callable[[Variable], Variable]) -> FuzzySystem:
    """Return a system with each of its variables replaced."""
    inputs, outputs = (tuple(map(change, side)) for side in (system.inputs, system.outputs))
    return replace(system, inputs=inputs, outputs=outputs)


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
            method = system.defuzzifier_of(output).replace("_", " ")
            raise Mistake(
                f"{what} is for Mamdani systems, whose rules conclude fuzzy sets, but output "
                f"{output.name!r} of {system.name!r} is a {method} of numbers; show, audit, explain, review, "
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
