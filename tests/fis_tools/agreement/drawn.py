"""Random systems from the registries, so that what one adds is drawn too; inputs that look for trouble."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar, get_args

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import (
    ALL_SEMANTICS,
    TOOLS,
    And,
    Consequent,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    Term,
    Variable,
    operators,
    shapes,
)
from fis_tools.model.membership import SHAPES, MembershipFunction, MonotoneFunction
from fis_tools.model.numbers import FUNCTIONS, Constant, Formula, Linear, Number
from fis_tools.model.validate import problems
from tests.fis_tools.engines.random_systems import full_table_system

#: shapes with parameters alone, which are drawn by what kinds of numbers these are
BY_KINDS = tuple(
    kind
    for kind in SHAPES.values()
    if not issubclass(kind, Number | shapes.Between | shapes.Sampled | shapes.Polyline)
)
MONOTONE = tuple(kind for kind in BY_KINDS if issubclass(kind, MonotoneFunction))
#: of which so many fire at some inputs as are not enumerated
MANY_RULES = 12, 24
_Choice = TypeVar("_Choice")


def any_of(generator: np.random.Generator, choices: Sequence[_Choice]) -> _Choice:
    return choices[int(generator.integers(len(choices)))]


def system(generator: np.random.Generator, name: str = "drawn") -> FuzzySystem:
    """A valid system; one in ten is a table of rules with wide terms, which the kernel of flights infers."""
    while True:
        if generator.random() < 0.1:
            drawn = replace(full_table_system(generator, is_smooth=True), name=name)
        else:
            drawn = _system(generator, name)
        if not problems(drawn):
            return drawn


def _system(generator: np.random.Generator, name: str) -> FuzzySystem:
    semantics = any_of(generator, ALL_SEMANTICS)
    has_intervals = semantics == "matlab" and generator.random() < 0.2
    is_weighed = generator.random() < 0.35
    defuzzifiers = operators.WEIGHING if is_weighed else _set_defuzzifiers()
    if has_intervals:
        defuzzifiers = ("weighted_average",) if is_weighed else ("centroid",)
    inputs = tuple(
        _variable(generator, f"x{index}", semantics, has_intervals)
        for index in range(int(generator.choice([1, 2, 3, 4, 5, 6], p=[0.35, 0.3, 0.15, 0.1, 0.05, 0.05])))
    )
    outputs: list[Variable] = []
    for index in range(int(generator.choice([1, 2], p=[0.75, 0.25]))):
        plain = _variable(generator, f"y{index}", semantics, has_intervals and not is_weighed)
        if is_weighed:
            names = [variable.name for variable in (*inputs, *outputs)]
            plain = _with_numbers(generator, plain, names, len(inputs), has_intervals)
        outputs.append(_output(generator, plain, semantics, defuzzifiers))
    num_rules = int(generator.integers(1, 6))
    # shares in an average of many rules are computed in a way of their own
    if is_weighed and generator.random() < 0.15:
        num_rules = int(generator.integers(*MANY_RULES))
    rules = tuple(_rule(generator, inputs, outputs) for _ in range(num_rules))
    is_min = generator.random() < 0.5
    return FuzzySystem(
        name,
        inputs,
        tuple(outputs),
        rules,
        and_operator=any_of(generator, get_args(operators.AndOperator)),
        or_operator=any_of(generator, get_args(operators.OrOperator)),
        defuzzifier=any_of(generator, defuzzifiers),
        implication="min" if is_min else any_of(generator, get_args(operators.AndOperator)),
        semantics=semantics,
        type_reduction=any_of(generator, get_args(operators.TypeReduction)),
    )


def _set_defuzzifiers() -> tuple[operators.Defuzzifier, ...]:
    return tuple(way for way in get_args(operators.Defuzzifier) if way not in operators.WEIGHING)


def _variable(generator: np.random.Generator, name: str, semantics: str, has_intervals: bool) -> Variable:
    low = float(any_of(generator, [0.0, -1.0, float(generator.normal() * 10.0)]))
    high = low + float(any_of(generator, [1.0, 10.0 ** generator.uniform(-1, 2)]))
    num_points = int(any_of(generator, [2, 3, 11, 101, int(generator.integers(2, 60))]))
    points = None
    if semantics == "scikit-fuzzy" and generator.random() < 0.2:
        points = tuple(np.unique([low, *generator.uniform(low, high, num_points - 2), high]).tolist())
        num_points = len(points)
    variable = Variable(name, "", low, high, (), num_points=num_points, points=points)
    terms = tuple(
        Term(f"t{index}", _set(generator, variable, has_intervals))
        for index in range(int(generator.integers(1, 4)))
    )
    is_clipped = semantics != "scikit-fuzzy" and name[0] == "x" and generator.random() < 0.1
    return replace(variable, terms=terms, is_clipped=is_clipped)


def _set(generator: np.random.Generator, variable: Variable, is_interval: bool) -> MembershipFunction:
    if is_interval:  # between two of one shape, of which one is narrower
        mean = float(generator.uniform(variable.minimum, variable.maximum))
        narrow = variable.span * float(10.0 ** generator.uniform(-2, 0))
        wide = narrow * float(generator.uniform(1.0, 3.0))
        return shapes.Between(shapes.Gaussian(mean, narrow), shapes.Gaussian(mean, wide))
    kind = any_of(generator, (*BY_KINDS, shapes.Sampled, shapes.Polyline))
    levels = np.array([0.0, 1.0, 0.5, float(generator.random()), 1e-280])
    if kind is shapes.Sampled:
        return shapes.Sampled(tuple(generator.choice(levels, variable.num_points).tolist()))
    if kind is shapes.Polyline:
        corners = np.sort(_locations(generator, variable, int(generator.integers(2, 7)))).tolist()
        return shapes.Polyline(tuple(corners), tuple(generator.choice(levels, len(corners)).tolist()))
    return _by_kinds(generator, variable, kind)


def _by_kinds(
    generator: np.random.Generator, variable: Variable, kind: type[MembershipFunction]
) -> MembershipFunction:
    """A shape, by the kinds of its numbers; those that must ascend do."""
    values: dict[str, Any] = {}
    for name, what in kind.entry.kinds.items():
        size = float(variable.span * 10.0 ** generator.uniform(-2.5, 0.3))
        values[name] = {
            "location": float(_locations(generator, variable, 1)[0]),
            "slope": float(generator.choice([-3.0, 3.0])) / size,
            "exponent": float(generator.uniform(0.5, 6.0)),
        }.get(what, size)
    ascending = sorted(values[name] for name in kind.entry.ascending)
    return kind(**{**values, **dict(zip(kind.entry.ascending, ascending, strict=True))})


def _locations(generator: np.random.Generator, variable: Variable, count: int) -> Floats:
    """Numbers inside, a little outside, at the ends, or on points of the universe."""
    margin = 0.3 * variable.span
    anywhere = generator.uniform(variable.minimum - margin, variable.maximum + margin, count)
    special = generator.choice([*variable.universe, variable.minimum, variable.maximum], count)
    return np.where(generator.random(count) < 0.4, special, anywhere)


def _with_numbers(
    generator: np.random.Generator, variable: Variable, names: Sequence[str], num_inputs: int, is_plain: bool
) -> Variable:
    """The same output with what a weighted one concludes: numbers, or shapes that have an inverse."""
    kinds: list[type[MembershipFunction]] = [Constant, Linear]
    if not is_plain:
        kinds.append(Formula)
        if generator.random() < 0.3:
            kinds = list(MONOTONE)

    def number(kind: type[MembershipFunction]) -> MembershipFunction:
        if kind is Linear:
            coefficients = generator.choice([0.0, 1.0, -2.5, float(generator.normal())], num_inputs)
            return Linear(tuple(coefficients.tolist()), float(generator.normal()))
        if kind is Formula:
            function = any_of(generator, list(FUNCTIONS))
            arguments = ", ".join(any_of(generator, names) for _ in range(FUNCTIONS[function][0]))
            return Formula(
                f"{function}({arguments}) {any_of(generator, '+-*/^')} {generator.uniform(0, 3):.3f}"
            )
        return _by_kinds(generator, variable, kind)

    terms = tuple(replace(term, membership=number(any_of(generator, kinds))) for term in variable.terms)
    return replace(variable, terms=terms)


def _output(
    generator: np.random.Generator, variable: Variable, semantics: str, defuzzifiers: Sequence[Any]
) -> Variable:
    """A variable with a default, and ways to accumulate and aggregate; unfit ones are drawn anew."""
    default: float | None = float(
        any_of(generator, [0.0, variable.minimum, float(generator.normal() * 10.0)])
    )
    if TOOLS[semantics].has_outputs_without_default and generator.random() < 0.3:  # type: ignore[index]
        default = None
    is_weighed = defuzzifiers[0] in operators.WEIGHING
    aggregation = "unbounded_sum" if is_weighed else "max"
    if not is_weighed and generator.random() < 0.5:
        aggregation = any_of(generator, get_args(operators.Aggregation))
    accumulation = "max"
    if generator.random() < 0.3 and (semantics == "scikit-fuzzy" or (semantics == "fcl" and is_weighed)):
        accumulation = any_of(generator, get_args(operators.Accumulation))
    return replace(
        variable,
        default=default,
        aggregation=aggregation,  # type: ignore[arg-type]
        accumulation=accumulation,  # type: ignore[arg-type]
        defuzzifier=any_of(generator, [None, *defuzzifiers]),
    )


def _rule(generator: np.random.Generator, inputs: Sequence[Variable], outputs: Sequence[Variable]) -> Rule:
    consequents = []
    for _ in range(int(generator.choice([1, 2], p=[0.8, 0.2]))):
        output = any_of(generator, outputs)
        weight = float(generator.choice([1.0, 0.0, generator.random()], p=[0.6, 0.05, 0.35]))
        consequents.append(Consequent(output.name, any_of(generator, output.terms).name, weight))
    operators_of_rule = [
        any_of(generator, [None, *get_args(way)]) for way in (operators.AndOperator, operators.OrOperator)
    ]
    return Rule(
        _expression(generator, inputs, 0),
        tuple(consequents),
        and_operator=operators_of_rule[0],
        or_operator=operators_of_rule[1],
    )


def _expression(generator: np.random.Generator, inputs: Sequence[Variable], depth: int) -> Expression:
    kind = generator.random()
    if depth == 3 or kind < 0.35:
        variable = any_of(generator, inputs)
        return Is(variable.name, any_of(generator, variable.terms).name)
    if kind < 0.45:
        return Not(_expression(generator, inputs, depth + 1))
    if kind < 0.55:
        return Hedged(any_of(generator, get_args(operators.Hedge)), _expression(generator, inputs, depth + 1))
    count = int(generator.integers(1, 4))
    operands = tuple(_expression(generator, inputs, depth + 1) for _ in range(count))
    return And(operands) if kind < 0.8 else Or(operands)


def points(system: FuzzySystem, generator: np.random.Generator, count: int) -> Floats:
    """Inputs at ends, at knots and next to these, between points, beyond ranges, infinite; (count, n)."""
    columns = []
    for variable in system.inputs:
        low, high, span, grid = variable.minimum, variable.maximum, variable.span, variable.universe
        knots = [low, high, *grid]
        for term in variable.terms:
            knots += [v for v in _numbers(term.membership) if low - 9 * span <= v <= high + 9 * span]
        at = generator.choice(knots, count)
        chosen = [
            generator.uniform(low, high, count),
            at,
            np.nextafter(at, generator.choice([-np.inf, np.inf], count)),
            generator.choice(0.5 * (grid[1:] + grid[:-1]), count),
            generator.choice([low - span * generator.random(), high + span * generator.random()], count),
            generator.choice([low - 1e3 * span, high + 1e9 * span, -np.inf, np.inf], count),
        ]
        kinds = generator.choice(6, count, p=[0.35, 0.25, 0.1, 0.1, 0.15, 0.05])
        columns.append(np.choose(kinds, chosen))
    return np.stack(columns, axis=1)


def _numbers(shape: MembershipFunction) -> list[float]:
    """The locations of a shape."""
    if isinstance(shape, shapes.Polyline):
        return list(shape.x)
    if isinstance(shape, shapes.Between):
        return _numbers(shape.lower)
    kinds = shape.entry.kinds.items()
    return [getattr(shape, name) for name, what in kinds if what == "location"]
