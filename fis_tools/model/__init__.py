"""The model of a fuzzy system: variables, terms, rules, systems; their shapes, operators and checks."""

from fis_tools.model.expressions import (
    And,
    Expression,
    Hedged,
    Is,
    Not,
    Or,
    canonical,
    parts_of,
    rebuilt,
    statements_of,
    with_statements,
)
from fis_tools.model.fuzzylite_shapes import Arc, Concave, Cosine, Ramp, SemiEllipse, Spike
from fis_tools.model.membership import MembershipFunction, MonotoneFunction
from fis_tools.model.numbers import Constant, Formula, Linear, Number
from fis_tools.model.operators import (
    Accumulation,
    Aggregation,
    AndOperator,
    Defuzzifier,
    Hedge,
    OrOperator,
    TypeReduction,
)
from fis_tools.model.rule_tables import conjunctions, rule_table, table_cells, table_rules
from fis_tools.model.semantics import ALL_SEMANTICS, TOOLS, Semantics
from fis_tools.model.shapes import (
    Between,
    Gaussian,
    GeneralizedBell,
    PiShape,
    Polyline,
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
from fis_tools.model.systems import (
    Consequent,
    FuzzyController,
    FuzzySystem,
    Rule,
    Wire,
    used_terms,
    with_semantics,
    with_terms,
    with_variables,
)
from fis_tools.model.trees import FuzzyTree, Inferable, tree, whole
from fis_tools.model.variables import (
    Term,
    Variable,
    is_unimodal,
    memberships_at,
    peak,
    sample,
    shape_values,
    with_universe,
)
