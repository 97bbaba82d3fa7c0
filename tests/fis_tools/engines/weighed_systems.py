"""Systems of which some output is weighed, drawn and by hand."""

from dataclasses import replace

import numpy as np

from fis_tools.model import Consequent, FuzzySystem, Is, MembershipFunction, Rule, Variable
from fis_tools.model.fuzzylite_shapes import Arc, Concave, Ramp
from fis_tools.model.numbers import Constant, Linear
from fis_tools.model.shapes import Gaussian, Sigmoid, SShape, Triangular, ZShape
from tests.fis_tools.sample_controllers import table_system, terms
from tests.fis_tools.step_by_step import ends


def inputs(count: int = 2, num_points: int = 501) -> tuple[Variable, ...]:
    """Inputs with three terms each, of which no value belongs to none."""
    thirds = terms(low=Gaussian(0.0, 1.5), mid=Gaussian(5.0, 1.5), high=Gaussian(10.0, 1.5))
    return tuple(Variable(f"x{index}", "", 0.0, 10.0, thirds, num_points) for index in range(count))


def output(name: str, *shapes: MembershipFunction) -> Variable:
    """An output that is weighed, from -2 to 2."""
    numbered = terms(**{f"{name}_{index}": shape for index, shape in enumerate(shapes)})
    return Variable(name, "", -2.0, 2.0, numbered, default=0.25, aggregation="unbounded_sum")


def system(way: str, *shapes: MembershipFunction, and_operator: str = "product") -> FuzzySystem:
    """A full table of nine rules that conclude the terms in turn."""
    variables, y = inputs(), output("y", *shapes)
    words = [y.terms[index % len(shapes)].name for index in range(9)]
    return table_system("weighed", variables, y, words, and_operator=and_operator, defuzzifier=way)


CONSTANTS = tuple(Constant(value) for value in (-1.5, -0.2, 0.7, 1.9))
LINEARS = (Linear((0.1, -0.15), 0.5), Linear((0.0, 0.0), -1.0), Linear((-0.05, 0.2), 0.0))
RAMPS = (Ramp(-1.0, 1.0), Ramp(1.5, -0.5), Ramp(0.0, 2.0))
CURVES = (SShape(-1.0, 2.0), SShape(-2.0, -1.0), SShape(0.0, 1.0), ZShape(-2.0, 0.0), ZShape(0.5, 2.0))
MONOTONE = (*RAMPS, *CURVES, Arc(-1.0, 1.5))
SIGMOIDS = (Sigmoid(0.3, 8.0), Sigmoid(-0.2, -6.0), Sigmoid(1.0, 9.0), Sigmoid(-1.0, 7.0), Sigmoid(0.0, -8.0))
ENDLESS = (*SIGMOIDS, Concave(0.5, 1.0), Concave(0.0, -1.0), Concave(1.0, 1.5), Concave(-1.0, -1.5))


def mixed() -> FuzzySystem:
    """One output by Mamdani, one by Takagi and Sugeno, other weights than one, and gaps between rules."""
    x_terms = terms(near=Triangular(0.0, 1.0, 3.0), far=Triangular(5.0, 8.0, 9.0))
    x = Variable("x", "", 0.0, 10.0, x_terms, 1001)
    z = Variable("z", "", 0.0, 1.0, terms(up=Triangular(0.0, 0.5, 1.0)), 101, default=0.0)
    y = output("y", Constant(1.0), Constant(-1.0))
    rules = (
        Rule(Is("x", "near"), (Consequent("y", "y_0"), Consequent("z", "up", 0.5))),
        Rule(Is("x", "far"), (Consequent("y", "y_1", 0.25), Consequent("y", "y_0", 0.5))),
    )
    return FuzzySystem("mixed", (x,), (replace(y, defuzzifier="weighted_average"), z), rules)


#: one system of each kind, by name
SYSTEMS = {
    "constant": system("weighted_average", *CONSTANTS),
    "constant_sum": system("weighted_sum", *CONSTANTS, and_operator="min"),
    "linear": system("weighted_average", *LINEARS),
    "linear_sum": system("weighted_sum", *LINEARS),
    "tsukamoto": system("weighted_average", *MONOTONE),
    "tsukamoto_endless": system("weighted_average", *ENDLESS),
    "mixed": mixed(),
}


def samples(of: FuzzySystem, count: int = 200, seed: int = 0) -> np.ndarray:
    """Draw inputs from the universes and a little beyond, ends among them."""
    low, high = ends(of)
    drawn = np.random.default_rng(seed).uniform(low - 0.5, high + 0.5, (count, len(low)))
    return np.concatenate([drawn, [low, high]])
