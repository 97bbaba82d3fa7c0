"""What a fuzzy system is: variables, terms, rules, systems; their shapes, operators and checks."""

from fis_tools.model.fuzzylite_shapes import Arc, Concave, Cosine, Ramp, SemiEllipse, Spike
from fis_tools.model.numbers import Constant, Linear, Number
from fis_tools.model.operators import Accumulation, Aggregation, AndOperator, Defuzzifier, OrOperator
from fis_tools.model.rule_tables import conjunctions, rule_table, table_antecedents, table_cells, table_rules
from fis_tools.model.rules import And, Consequent, Expression, Is, Not, Or, Rule
from fis_tools.model.shape import MembershipFunction, MonotoneFunction
from fis_tools.model.shapes import (
    Gaussian,
    GeneralizedBell,
    PiShape,
    Sampled,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SShape,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    ZShape,
)
from fis_tools.model.systems import FuzzyController, FuzzySystem
from fis_tools.model.variables import Term, Variable

__all__ = [
    "Accumulation",
    "Aggregation",
    "And",
    "AndOperator",
    "Arc",
    "Concave",
    "Consequent",
    "Constant",
    "Cosine",
    "Defuzzifier",
    "Expression",
    "FuzzyController",
    "FuzzySystem",
    "Gaussian",
    "GeneralizedBell",
    "Is",
    "Linear",
    "MembershipFunction",
    "MonotoneFunction",
    "Not",
    "Number",
    "Or",
    "OrOperator",
    "PiShape",
    "Ramp",
    "Rule",
    "SShape",
    "Sampled",
    "SemiEllipse",
    "Sigmoid",
    "SigmoidDifference",
    "SigmoidProduct",
    "Spike",
    "Term",
    "Trapezoidal",
    "Triangular",
    "TwoSidedGaussian",
    "Variable",
    "ZShape",
    "conjunctions",
    "rule_table",
    "table_antecedents",
    "table_cells",
    "table_rules",
]
