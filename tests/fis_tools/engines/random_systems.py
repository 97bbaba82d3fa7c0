"""Random fuzzy systems and inputs that look for trouble: everything drawn from the generator given."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar, get_args

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import (
    ALL_SEMANTICS,
    And,
    Consequent,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    Semantics,
    shapes,
)
from fis_tools.model.fuzzylite_shapes import Arc, Concave, Cosine, Ramp, SemiEllipse, Spike
from fis_tools.model.membership import SHAPES, MembershipFunction
from fis_tools.model.numbers import Constant, Formula, Linear
from fis_tools.model.operators import (
    WEIGHING,
    Accumulation,
    AndOperator,
    Defuzzifier,
    Hedge,
    OrOperator,
    TypeReduction,
)
from fis_tools.model.rule_tables import table_rules
from fis_tools.model.variables import Term, Variable, sample

DEFUZZIFIERS: tuple[Defuzzifier, ...] = tuple(way for way in get_args(Defuzzifier) if way not in WEIGHING)
AND_OPERATORS: tuple[AndOperator, ...] = get_args(AndOperator)
OR_OPERATORS: tuple[OrOperator, ...] = get_args(OrOperator)
#: That of jFuzzyLogic's numbers alone is left out.
ACCUMULATIONS: tuple[Accumulation, ...] = tuple(w for w in get_args(Accumulation) if w != "unbounded_sum")
HEDGES: tuple[Hedge, ...] = get_args(Hedge)
#: shapes of outputs that are weighed, and of interval type-2 systems
ELSEWHERE = (shapes.Between, Constant, Formula, Linear, shapes.Polyline, Ramp)
#: those that are drawn below, and those that are not, for they have been added since
DRAWN = (
    *(shapes.Gaussian, shapes.Triangular, shapes.Trapezoidal, shapes.TwoSidedGaussian),
    *(shapes.GeneralizedBell, shapes.Sigmoid, shapes.SigmoidDifference, shapes.SigmoidProduct),
    *(shapes.SShape, shapes.ZShape, shapes.PiShape, shapes.Sampled),
    *(Spike, Cosine, Concave, SemiEllipse, Arc),
)
OTHERS = tuple(kind for kind in SHAPES.values() if kind not in {*DRAWN, *ELSEWHERE})
_Choice = TypeVar("_Choice")


def full_table_system(
    generator: np.random.Generator, num_inputs: int | None = None, *, is_smooth: bool = False
) -> FuzzySystem:
    """A full rule table of Gaussian terms, some output terms never concluded.

    Terms go from far narrower than a grid step to wider than the universe; those of a smooth system are at
    least 0.02 of the range wide, and the grid has 101 points or more.
    """
    if num_inputs is None:
        num_inputs = int(generator.integers(2, 4))
    most_terms = 7 if num_inputs == 2 else 4
    inputs = tuple(
        _gaussian_variable(generator, f"x{index}", int(generator.integers(3, most_terms + 1)), is_smooth)
        for index in range(num_inputs)
    )
    output = replace(
        _gaussian_variable(generator, "y", int(generator.integers(3, 8)), is_smooth),
        default=float(generator.normal()),
    )
    num_rules = int(np.prod([len(variable.terms) for variable in inputs]))
    # Few concluded terms make the rest of the output's terms unused.
    concluded = generator.permutation(len(output.terms))[: int(generator.integers(1, len(output.terms) + 1))]
    consequents = [output.terms[index].name for index in generator.choice(concluded, num_rules)]
    return FuzzySystem("random", inputs, (output,), table_rules(inputs, output, consequents))


def sparse_system(generator: np.random.Generator) -> FuzzySystem:
    """A full table with most cells gone and some statements too; each input is still asked for."""
    system = full_table_system(generator, is_smooth=True)
    kept = generator.permutation(len(system.rules))[: max(3, len(system.rules) // 4)]
    rules = [system.rules[index] for index in kept]
    for index in range(2, len(rules)):
        antecedent = rules[index].antecedent
        if isinstance(antecedent, And) and generator.random() < 0.5:
            chosen = antecedent.operands[int(generator.integers(len(antecedent.operands)))]
            rules[index] = replace(rules[index], antecedent=chosen)
    return replace(system, rules=tuple(rules))


def _gaussian_variable(
    generator: np.random.Generator, name: str, num_terms: int, is_smooth: bool
) -> Variable:
    # A range far from zero compared with its width loses the digits that engines are compared in.
    width = float(10.0 ** generator.uniform(-2, 3))
    low = float(generator.uniform(-1.5, 0.5) * width)
    high = low + width
    means = np.linspace(low, high, num_terms) + width / num_terms * generator.uniform(-0.45, 0.45, num_terms)
    # Far narrower than a grid step, gaps open and peaks are missed.
    widths = width * 10.0 ** generator.uniform(np.log10(0.02) if is_smooth else -3.2, 0.2, num_terms)
    num_points = int(generator.choice([101, 201] if is_smooth else [2, 11, 100, 101, 201]))
    terms = tuple(
        Term(f"t{index}", shapes.Gaussian(float(mean), float(sigma)))
        for index, (mean, sigma) in enumerate(zip(means, widths, strict=True))
    )
    return Variable(name, "", low, high, terms, num_points=num_points)


def inputs_for(system: FuzzySystem, generator: np.random.Generator, count: int) -> Floats:
    """Inputs inside, at the ends, on grid points, between them, and far outside; (count, num_inputs)."""
    columns = []
    for variable in system.inputs:
        low, high = variable.minimum, variable.maximum
        grid = variable.universe
        inside = generator.uniform(low, high, count)
        on_grid = generator.choice(grid, count)
        between = generator.choice(0.5 * (grid[1:] + grid[:-1]), count)
        ends = generator.choice([low, high, np.nextafter(low, high), np.nextafter(high, low)], count)
        outside = generator.choice([low - (high - low), high + 1e-9, -1e12, 1e12], count)
        peaks = generator.choice([_peak(variable, term) for term in variable.terms], count)
        kinds = generator.choice(6, count, p=[0.4, 0.15, 0.1, 0.1, 0.1, 0.15])
        columns.append(np.choose(kinds, [inside, on_grid, between, ends, outside, peaks]))
    return np.stack(columns, axis=1)


def _peak(variable: Variable, term: Term) -> float:
    return term.membership.mean if isinstance(term.membership, shapes.Gaussian) else variable.universe[0]


def otherwise(system: FuzzySystem, implication: str, aggregation: str) -> FuzzySystem:
    """The same system, with what its rules conclude implied and aggregated in another way."""
    outputs = (replace(v, accumulation="max", aggregation=aggregation) for v in system.outputs)  # type: ignore[arg-type]
    return replace(system, outputs=tuple(outputs), implication=implication)  # type: ignore[arg-type]


def random_general_system(generator: np.random.Generator, named: Callable[[str], str] = str) -> FuzzySystem:
    """Every shape, operator, accumulation and defuzzifier; uneven universes, rule trees, weights, outputs.

    Half of the systems are of minimum, maximum and centroid with nothing that departs from them.
    """
    is_plain = generator.random() < 0.5
    inputs = tuple(
        _any_variable(generator, f"x{index}", named) for index in range(int(generator.integers(1, 4)))
    )
    outputs = tuple(
        replace(
            _any_variable(generator, f"y{index}", named),
            default=float(generator.normal()),
            defuzzifier=None if is_plain else _maybe(generator, DEFUZZIFIERS),
            accumulation="max" if is_plain else _maybe(generator, ACCUMULATIONS) or "max",
        )
        for index in range(int(generator.integers(1, 4)))
    )
    rules = tuple(_any_rule(generator, inputs, outputs) for _ in range(int(generator.integers(1, 9))))
    if is_plain:
        return FuzzySystem("random", inputs, outputs, rules)

    def combined(rule: Rule) -> Rule:
        and_operator = _maybe(generator, AND_OPERATORS)
        or_operator = _maybe(generator, OR_OPERATORS)
        return replace(rule, and_operator=and_operator, or_operator=or_operator)

    rules = tuple(map(combined, rules))
    and_operator = _any_of(generator, AND_OPERATORS)
    or_operator = _any_of(generator, OR_OPERATORS)
    defuzzifier = _any_of(generator, DEFUZZIFIERS)
    return FuzzySystem("random", inputs, outputs, rules, and_operator, or_operator, defuzzifier)


def hedged(system: FuzzySystem, generator: np.random.Generator) -> FuzzySystem:
    """The same system, with hedges before some of what its rules ask for, at any depth."""

    def said(expression: Expression) -> Expression:
        match expression:
            case Not(operand):
                changed: Expression = Not(said(operand))
            case And(operands) | Or(operands):
                changed = type(expression)(tuple(map(said, operands)))
            case _:
                changed = expression
        return Hedged(_any_of(generator, HEDGES), changed) if generator.random() < 0.4 else changed

    return replace(system, rules=tuple(replace(r, antecedent=said(r.antecedent)) for r in system.rules))


def _any_of(generator: np.random.Generator, choices: Sequence[_Choice]) -> _Choice:
    return choices[int(generator.integers(len(choices)))]


def _maybe(generator: np.random.Generator, choices: Sequence[_Choice]) -> _Choice | None:
    return _any_of(generator, choices) if generator.random() < 0.3 else None


def _any_variable(generator: np.random.Generator, name: str, named: Callable[[str], str]) -> Variable:
    num_points = int(generator.integers(2, 60))
    low = float(generator.normal() * 10.0)
    high = low + float(10.0 ** generator.uniform(-1, 2))
    points = None
    if generator.random() < 0.3:
        inner = generator.uniform(low, high, num_points - 2)
        points = tuple(float(point) for point in np.unique([low, *inner, high]))
        num_points = len(points)
    variable = Variable(named(name), "", low, high, (), num_points=num_points, points=points)
    terms = tuple(
        Term(named(f"t{index}"), any_shape(generator, variable))
        for index in range(int(generator.integers(1, 6)))
    )
    return replace(variable, terms=terms)


def any_shape(generator: np.random.Generator, variable: Variable) -> MembershipFunction:
    """One of all shapes; corners lie inside the universe, a little outside, or on its points."""
    low, high = variable.minimum, variable.maximum
    width = high - low
    margin = 0.2 * width
    anywhere = generator.uniform(low - margin, high + margin, 4)
    drawn = generator.choice(variable.universe, 4) if generator.random() < 0.2 else anywhere
    a, b, c, d = (float(x) for x in np.sort(drawn))
    spreads = [float(width * 10.0 ** generator.uniform(-2.5, 0.0)) for _ in range(2)]
    steepness = [float(10.0 ** generator.uniform(0, 2) / width) for _ in range(2)]
    is_steep = generator.random() < 0.2
    kind = int(generator.integers(12))
    if is_steep and kind in (0, 3, 4, 5, 6) and a < c:
        return {
            0: Spike(b, spreads[0]),
            3: Cosine(b, spreads[0]),
            4: Concave(a, c),
            5: SemiEllipse(a, c),
            6: Arc(c, a),
        }[kind]
    makers: dict[int, Callable[[], MembershipFunction]] = {
        0: lambda: shapes.Gaussian(b, spreads[0]),
        1: lambda: shapes.Triangular(b if is_steep else a, b, c),
        2: lambda: shapes.Trapezoidal(a, b, c, c if is_steep else d),
        3: lambda: shapes.TwoSidedGaussian(b, spreads[0], c, spreads[1]),
        4: lambda: shapes.GeneralizedBell(spreads[0], float(generator.uniform(0.5, 6.0)), b),
        5: lambda: shapes.Sigmoid(b, steepness[0] * float(generator.choice([-1.0, 1.0]))),
        6: lambda: shapes.SigmoidDifference(b, steepness[0], c, steepness[0]),
        7: lambda: shapes.SigmoidProduct(b, steepness[0], c, -steepness[1]),
        8: lambda: shapes.SShape(a, c),
        9: lambda: shapes.ZShape(b, d),
        10: lambda: shapes.PiShape(a, b, c, d),
    }
    has_width = {8: a < c, 9: b < d, 10: a < b and c < d}
    if kind in makers and has_width.get(kind, True):
        return makers[kind]()
    values = np.clip(generator.uniform(-0.5, 1.5, variable.num_points), 0.0, 1.0)
    if OTHERS and values[0] > 0.5:  # so that a shape that is added changes no other draw
        return any_numbers(OTHERS[len(values) % len(OTHERS)], (a, b, c, d), spreads[0])
    return shapes.Sampled(tuple(float(value) for value in values))


def any_numbers(
    kind: type[MembershipFunction], corners: tuple[float, ...], spread: float
) -> MembershipFunction:
    """A shape that is added, with numbers of the kinds that it declares; `corners` rise in their order."""
    rising = iter(corners)
    values = {"width": spread, "deviation": spread, "slope": 1.0 / spread, "exponent": 2.0}
    kinds = kind.entry.kinds.items()
    return kind(**{name: next(rising) if what == "location" else values[what] for name, what in kinds})


def _any_rule(
    generator: np.random.Generator, inputs: tuple[Variable, ...], outputs: tuple[Variable, ...]
) -> Rule:
    consequents = []
    for _ in range(int(generator.integers(1, 4))):
        output = _any_of(generator, outputs)
        term = _any_of(generator, output.terms)
        weight = float(generator.choice([1.0, 0.0, generator.random()], p=[0.6, 0.1, 0.3]))
        consequents.append(Consequent(output.name, term.name, weight))
    return Rule(_any_expression(generator, inputs, 0), tuple(consequents))


def _any_expression(generator: np.random.Generator, inputs: tuple[Variable, ...], depth: int) -> Expression:
    kind = generator.random()
    if depth == 3 or kind < 0.4:
        variable = _any_of(generator, inputs)
        return Is(variable.name, _any_of(generator, variable.terms).name)
    if kind < 0.55:
        return Not(_any_expression(generator, inputs, depth + 1))
    count = int(generator.integers(1, 4))
    operands = tuple(_any_expression(generator, inputs, depth + 1) for _ in range(count))
    return And(operands) if kind < 0.8 else Or(operands)


def sampled(system: FuzzySystem, semantics: Semantics) -> FuzzySystem:
    """Return a system as another program infers it, by what that program knows."""
    outputs = []
    for output in system.outputs:
        joins = semantics == "fcl" and system.weighs(output)
        accumulation = output.accumulation if joins and output.accumulation != "product" else "max"
        outputs.append(replace(output, points=None, accumulation=accumulation))
    return replace(system, semantics=semantics, outputs=tuple(outputs))


def sampled_systems(seed: int, count: int) -> list[FuzzySystem]:
    """Draw systems of every program that samples, one after the other."""
    tools = [tool for tool in ALL_SEMANTICS if tool != "scikit-fuzzy"]
    systems = []
    for number in range(count):
        generator = np.random.default_rng([seed, number])
        system = random_general_system(generator) if number % 4 else full_table_system(generator)
        systems.append(replace(sampled(system, tools[number % len(tools)]), name=f"sampled {number}"))
    return systems


def inputs_beyond(system: FuzzySystem, generator: np.random.Generator, count: int) -> np.ndarray:
    """Draw inputs, of which about a third lie outside of the ranges."""
    low = np.array([variable.minimum for variable in system.inputs])
    span = np.array([variable.span for variable in system.inputs])
    return low + span * generator.uniform(-0.2, 1.2, (count, len(low)))


def uncertain(system: FuzzySystem, share: float = 0.6) -> FuzzySystem:
    """Return a system of MATLAB's as an interval type-2 one: sets from a share of their heights to all."""

    def between(variable: Variable, term: Term) -> Term:
        x, heights = tuple(variable.universe.tolist()), sample(variable, term)
        lower, upper = (shapes.Polyline(x, tuple((part * heights).tolist())) for part in (share, 1.0))
        return replace(term, membership=shapes.Between(lower, upper))

    def changed(variable: Variable, way: Defuzzifier | None) -> Variable:
        terms = tuple(between(variable, term) for term in variable.terms)
        return replace(variable, terms=terms, defuzzifier=way)

    inputs = tuple(changed(variable, None) for variable in system.inputs)
    outputs = tuple(changed(variable, "centroid") for variable in system.outputs)
    reduction: TypeReduction = "nie-tan" if len(system.rules) % 2 else "karnik-mendel"
    return replace(system, inputs=inputs, outputs=outputs, type_reduction=reduction)
