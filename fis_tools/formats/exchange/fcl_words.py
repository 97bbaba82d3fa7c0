"""The words of FCL for operators and methods, as jFuzzyLogic and fuzzylite have them."""

from fis_tools import model

#: Words of jFuzzyLogic.
AND: dict[str, model.AndOperator] = {
    "MIN": "min",
    "PROD": "product",
    "BDIF": "bounded_difference",
    "DMIN": "drastic_product",
    "NIPMIN": "nilpotent_minimum",
    "HAMACHER": "hamacher_product",
}
#: Words of fuzzylite, besides.
FUZZYLITES_AND: dict[str, model.AndOperator] = {
    **AND,
    "HPROD": "hamacher_product",
    "EPROD": "einstein_product",
    "NMIN": "nilpotent_minimum",
}
OR: dict[str, model.OrOperator] = {
    "MAX": "max",
    "ASUM": "probabilistic_sum",
    "BSUM": "bounded_sum",
    "DMAX": "drastic_sum",
    "NIPMAX": "nilpotent_maximum",
    "EINSTEIN": "einstein_sum",
}
FUZZYLITES_OR: dict[str, model.OrOperator] = {
    **OR,
    "ESUM": "einstein_sum",
    "HSUM": "hamacher_sum",
    "DSUM": "drastic_sum",
    "NMAX": "nilpotent_maximum",
    "NSUM": "bounded_sum",
}
#: What jFuzzyLogic sets the other operator to.
DUALS: dict[model.AndOperator, model.OrOperator] = {
    "min": "max",
    "product": "probabilistic_sum",
    "bounded_difference": "bounded_sum",
    "drastic_product": "drastic_sum",
    "nilpotent_minimum": "nilpotent_maximum",
    "hamacher_product": "einstein_sum",
}
ACCUMULATIONS: dict[str, model.Aggregation] = {
    "MAX": "max",
    "BSUM": "bounded_sum",
    "NSUM": "bounded_sum",
    "PROBOR": "probabilistic_sum",
    "SUM": "unbounded_sum",
}
METHODS: dict[str, model.Defuzzifier] = {
    "COG": "centroid",
    "COGS": "weighted_average",
    "COGF": "weighted_average",
    "COA": "bisector",
    "LM": "som",
    "RM": "lom",
    "MM": "mom",
}
#: Functions of its formulas, and what they are here.
FUNCTIONS: dict[str, str] = {
    "abs": "fabs",
    "cos": "cos",
    "exp": "exp",
    "ln": "log",
    "log": "log10",
    "sin": "sin",
    "tan": "tan",
}
