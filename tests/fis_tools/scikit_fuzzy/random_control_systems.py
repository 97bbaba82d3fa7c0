"""Random control systems built with scikit-fuzzy's own words, as its users build them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import skfuzzy
from numpy.typing import NDArray
from skfuzzy import control

from fis_tools.model import operators

Floats = NDArray[np.float64]

AND_FUNCTIONS = (
    *(np.fmin, np.minimum, min, np.multiply, control.accumulation_mult),
    *(operators.bounded_difference, operators.hamacher_product, operators.drastic_product),
)
OR_FUNCTIONS = (
    *(np.fmax, np.maximum, max, control.accumulation_max),
    *(operators.probabilistic_sum, operators.bounded_sum, operators.einstein_sum),
)
METHODS = ("centroid", "bisector", "mom", "som", "lom", "Centroid", "MOM")


def random_control_system(generator: np.random.Generator) -> control.ControlSystem:
    """Variables of any universe and shapes, rules joined by &, | and ~, weights, functions of each rule."""
    inputs = [
        _with_terms(generator, control.Antecedent(_universe(generator), f"in {place}"))
        for place in range(int(generator.integers(1, 4)))
    ]
    outputs = [_output(generator, f"out {place}") for place in range(int(generator.integers(1, 3)))]
    rules = [_rule(generator, inputs, outputs, number) for number in range(int(generator.integers(1, 8)))]
    if generator.random() < 0.5:
        return control.ControlSystem(rules)
    system = control.ControlSystem()
    for rule in rules:
        system.addrule(rule)
    return system


def _any_of(generator: np.random.Generator, choices: Any) -> Any:
    return choices[int(generator.integers(len(choices)))]


def _universe(generator: np.random.Generator) -> Any:
    low = int(generator.integers(-10, 10))
    match int(generator.integers(4)):
        case 0:
            return np.arange(low, low + int(generator.integers(2, 30)))
        case 1:
            return np.arange(low, low + 2.05, 0.1)
        case 2:
            return np.linspace(low, low + 10.0 ** generator.uniform(-1, 2), int(generator.integers(2, 60)))
    return np.unique(generator.normal(size=int(generator.integers(2, 40))))


def _output(generator: np.random.Generator, label: str) -> control.Consequent:
    output = control.Consequent(_universe(generator), label, _any_of(generator, METHODS))
    if generator.random() < 0.3:
        output.accumulation_method = _any_of(generator, (*OR_FUNCTIONS, control.accumulation_mult))
    return _with_terms(generator, output)


def _with_terms(generator: np.random.Generator, variable: Any) -> Any:
    if generator.random() < 0.3:
        variable.automf(_any_of(generator, (3, 5, 7)), _any_of(generator, ("quality", "quant")))
    for place in range(0 if len(variable.terms) else int(generator.integers(1, 6))):
        variable[f"term {place}"] = _membership(generator, variable.universe)
    return variable


def _membership(generator: np.random.Generator, universe: Any) -> Any:
    low, high = float(universe[0]), float(universe[-1])
    width = high - low
    # distinct corners: smf and pimf divide by the width of a flank
    a, b, c, d = np.sort(generator.uniform(low - 0.2 * width, high + 0.2 * width, 4))
    steep, slope = 10.0 ** generator.uniform(0, 2, 2) / width
    sigma, other_sigma = width * 10.0 ** generator.uniform(-1.5, 0, 2)
    shapes: list[Callable[[], Any]] = [
        lambda: skfuzzy.gaussmf(universe, b, sigma),
        lambda: skfuzzy.gauss2mf(universe, b, sigma, c, other_sigma),
        lambda: skfuzzy.trimf(universe, [a, b, c]),
        lambda: skfuzzy.trimf(universe, [b, b, c]),
        lambda: skfuzzy.trapmf(universe, [a, b, c, d]),
        lambda: skfuzzy.gbellmf(universe, sigma, generator.uniform(0.5, 5.0), b),
        lambda: skfuzzy.sigmf(universe, b, _any_of(generator, (steep, -steep))),
        lambda: skfuzzy.dsigmf(universe, a, steep, c, steep),
        lambda: skfuzzy.psigmf(universe, a, steep, c, -slope),
        lambda: skfuzzy.smf(universe, a, c),
        lambda: skfuzzy.zmf(universe, b, d),
        lambda: skfuzzy.pimf(universe, a, b, c, d),
        lambda: skfuzzy.piecemf(universe - universe.min(), [0.0, width / 2.0, width]),
        lambda: np.clip(generator.uniform(-0.5, 1.5, len(universe)), 0.0, 1.0),
        lambda: (universe > b).astype(int),
    ]
    with np.errstate(all="ignore"):
        return np.clip(_any_of(generator, shapes)(), 0, 1)


def _rule(generator: np.random.Generator, inputs: list[Any], outputs: list[Any], number: int) -> control.Rule:
    consequents = []
    for _ in range(int(generator.integers(1, 3))):
        term = _any_term(generator, outputs)
        weight = float(generator.choice([1.0, 0.0, 0.5, generator.random()]))
        consequents.append(term if generator.random() < 0.5 else term % weight)
    return control.Rule(
        _expression(generator, inputs, 0),
        consequents,
        label=None if generator.random() < 0.5 else f"rule {number}",
        and_func=np.fmin if generator.random() < 0.5 else _any_of(generator, AND_FUNCTIONS),
        or_func=np.fmax if generator.random() < 0.5 else _any_of(generator, OR_FUNCTIONS),
    )


def _any_term(generator: np.random.Generator, variables: list[Any]) -> Any:
    return _any_of(generator, list(_any_of(generator, variables).terms.values()))


def _expression(generator: np.random.Generator, inputs: list[Any], depth: int) -> Any:
    kind = generator.random()
    if depth == 4 or kind < 0.3:
        return _any_term(generator, inputs)
    if kind < 0.45:
        return ~_expression(generator, inputs, depth + 1)
    left, right = (_expression(generator, inputs, depth + 1) for _ in range(2))
    return left & right if kind < 0.75 else left | right


def distinct_inputs(system: control.ControlSystem, generator: np.random.Generator, count: int) -> Floats:
    """Inputs inside, at the ends and outside; no two that clipping makes the same, which have one cache."""
    columns, ends = [], []
    for variable in system.antecedents:
        low, high = float(variable.universe[0]), float(variable.universe[-1])
        drawn = generator.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), count)
        is_on_point = generator.random(count) < 0.2
        columns.append(np.where(is_on_point, generator.choice(variable.universe, count), drawn))
        ends.append((low, high))
    rows = np.stack(columns, axis=1)
    lows, highs = np.array(ends).T
    _, first = np.unique(np.clip(rows, lows, highs), axis=0, return_index=True)
    return rows[np.sort(first)]


def compute(system: control.ControlSystem, inputs: Floats) -> dict[str, float]:
    """Let scikit-fuzzy compute one sample; outputs that no rule gives are missing."""
    simulation = control.ControlSystemSimulation(system)
    for variable, value in zip(system.antecedents, inputs, strict=True):
        simulation.input[variable.label] = float(value)
    with np.errstate(all="ignore"):
        simulation.compute()
    return {label: float(value) for label, value in simulation.output.items()}
