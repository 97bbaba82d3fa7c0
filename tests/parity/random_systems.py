"""Random fuzzy systems and inputs that look for trouble: everything drawn from the generator given."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import (
    And,
    Consequent,
    Expression,
    FuzzySystem,
    Gaussian,
    Is,
    MembershipFunction,
    Not,
    Or,
    Rule,
    Sampled,
    Term,
    Trapezoidal,
    Triangular,
    Variable,
    table_rules,
)

Floats = NDArray[np.float64]
DEFUZZIFIERS = ("centroid", "bisector", "mom", "som", "lom")


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
        _gaussian_variable(generator, f"x{place}", int(generator.integers(3, most_terms + 1)), is_smooth)
        for place in range(num_inputs)
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
            asked = antecedent.operands[int(generator.integers(len(antecedent.operands)))]
            rules[index] = replace(rules[index], antecedent=asked)
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
        Term(f"t{index}", Gaussian(float(mean), float(sigma)))
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
    return term.membership.mean if isinstance(term.membership, Gaussian) else variable.universe[0]


def general_system(generator: np.random.Generator) -> FuzzySystem:
    """Rule trees with and, or, not; weights; several outputs; every shape, operator and defuzzifier."""
    inputs = tuple(_any_variable(generator, f"x{place}") for place in range(int(generator.integers(1, 4))))
    outputs = tuple(
        replace(_any_variable(generator, f"y{place}"), default=float(generator.normal()))
        for place in range(int(generator.integers(1, 4)))
    )
    rules = tuple(_any_rule(generator, inputs, outputs) for _ in range(int(generator.integers(1, 9))))
    return FuzzySystem(
        "random",
        inputs,
        outputs,
        rules,
        and_operator="min" if generator.random() < 0.5 else "product",
        or_operator="max" if generator.random() < 0.5 else "probabilistic_sum",
        defuzzifier=DEFUZZIFIERS[int(generator.integers(len(DEFUZZIFIERS)))],
    )


def _any_variable(generator: np.random.Generator, name: str) -> Variable:
    num_points = int(generator.integers(2, 60))
    low = float(generator.normal() * 10.0)
    high = low + float(10.0 ** generator.uniform(-1, 2))
    points = None
    if generator.random() < 0.3:
        inner = generator.uniform(low, high, num_points - 2)
        points = tuple(float(point) for point in np.unique([low, *inner, high]))
        num_points = len(points)
    terms = tuple(
        Term(f"t{index}", _any_shape(generator, low, high, num_points))
        for index in range(int(generator.integers(1, 6)))
    )
    return Variable(name, "", low, high, terms, num_points=num_points, points=points)


def _any_shape(
    generator: np.random.Generator, low: float, high: float, num_points: int
) -> MembershipFunction:
    margin = 0.2 * (high - low)
    corners = [float(x) for x in np.sort(generator.uniform(low - margin, high + margin, 4))]
    kind = generator.integers(4)
    if kind == 0:
        return Gaussian(corners[1], float((high - low) * 10.0 ** generator.uniform(-2.5, 0.0)))
    if kind == 1:
        left, peak, right = corners[:3]
        return Triangular(peak if generator.random() < 0.2 else left, peak, right)
    if kind == 2:
        left, left_top, right_top, right = corners
        return Trapezoidal(left, left_top, right_top, right_top if generator.random() < 0.2 else right)
    values = np.clip(generator.uniform(-0.5, 1.5, num_points), 0.0, 1.0)
    return Sampled(tuple(float(value) for value in values))


def _any_rule(
    generator: np.random.Generator, inputs: tuple[Variable, ...], outputs: tuple[Variable, ...]
) -> Rule:
    consequents = []
    for _ in range(int(generator.integers(1, 4))):
        output = outputs[int(generator.integers(len(outputs)))]
        term = output.terms[int(generator.integers(len(output.terms)))]
        weight = float(generator.choice([1.0, 0.0, generator.random()], p=[0.6, 0.1, 0.3]))
        consequents.append(Consequent(output.name, term.name, weight))
    return Rule(_any_expression(generator, inputs, 0), tuple(consequents))


def _any_expression(generator: np.random.Generator, inputs: tuple[Variable, ...], depth: int) -> Expression:
    kind = generator.random()
    if depth == 3 or kind < 0.4:
        variable = inputs[int(generator.integers(len(inputs)))]
        return Is(variable.name, variable.terms[int(generator.integers(len(variable.terms)))].name)
    if kind < 0.55:
        return Not(_any_expression(generator, inputs, depth + 1))
    count = int(generator.integers(1, 4))
    operands = tuple(_any_expression(generator, inputs, depth + 1) for _ in range(count))
    return And(operands) if kind < 0.8 else Or(operands)
