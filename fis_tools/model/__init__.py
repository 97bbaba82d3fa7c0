"""The model of a fuzzy system: variables, terms, rules, systems; their shapes, operators and checks."""

from fis_tools.model.numbers import Constant, Formula, Linear, Number
from fis_tools.model.operators import Accumulation, Aggregation, AndOperator, Defuzzifier, Hedge, OrOperator
from fis_tools.model.shape import MembershipFunction, MonotoneFunction
from fis_tools.model.shapes import (
    Arc,
    Concave,
    Cosine,
    Gaussian,
    GeneralizedBell,
    PiShape,
    Ramp,
    Sampled,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Spike,
    SShape,
    Trapezoidal,
    Triangular,
    TwoSidedGaussian,
    ZShape,
)
from fis_tools.model.systems import (
    And,
    Consequent,
    Expression,
    FuzzyController,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    canonical,
    conjunctions,
    parts_of,
    rebuilt,
    rule_table,
    statements_of,
    table_antecedents,
    table_cells,
    table_rules,
    used_terms,
    with_statements,
    with_terms,
    with_variables,
)
from fis_tools.model.variables import Term, Variable
