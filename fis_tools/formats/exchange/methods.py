"""Operators and defuzzifiers in the words of each format, one row each."""

from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeVar

from fis_tools.model import Aggregation, AndOperator, Defuzzifier, Hedge, OrOperator

_Name = TypeVar("_Name", bound=str)


class Words(NamedTuple):
    """What the formats call one method. Words that IEC 61131-7 does not have are fuzzylite's for FCL."""

    fis: str
    fll: str
    fml: str
    fcl: str


AND: dict[AndOperator, Words] = {
    "min": Words("min", "Minimum", "MIN", "MIN"),
    "product": Words("prod", "AlgebraicProduct", "PROD", "PROD"),
    "bounded_difference": Words("bounded_difference", "BoundedDifference", "BDIF", "BDIF"),
    "einstein_product": Words("einstein_product", "EinsteinProduct", "EPROD", "EPROD"),
    "hamacher_product": Words("hamacher_product", "HamacherProduct", "HPROD", "HPROD"),
    "drastic_product": Words("drastic_product", "DrasticProduct", "DRP", "DPROD"),
    "nilpotent_minimum": Words("nilpotent_minimum", "NilpotentMinimum", "NILMIN", "NMIN"),
}
OR: dict[OrOperator, Words] = {
    "max": Words("max", "Maximum", "MAX", "MAX"),
    "probabilistic_sum": Words("probor", "AlgebraicSum", "PROBOR", "ASUM"),
    "bounded_sum": Words("bounded_sum", "BoundedSum", "BSUM", "BSUM"),
    "einstein_sum": Words("einstein_sum", "EinsteinSum", "ESUM", "ESUM"),
    "hamacher_sum": Words("hamacher_sum", "HamacherSum", "HSUM", "HSUM"),
    "drastic_sum": Words("drastic_sum", "DrasticSum", "DRS", "DSUM"),
    "nilpotent_maximum": Words("nilpotent_maximum", "NilpotentMaximum", "NILMAX", "NMAX"),
}
AGGREGATIONS: dict[Aggregation, Words] = {
    "unbounded_sum": Words("sum", "UnboundedSum", "custom_sum", "UnboundedSum"),
}
AGGREGATIONS.update(OR.items())
#: Words of fuzzylite for what is known by another one: from two degrees of truth both make the same.
NORMALIZED_SUMS: dict[str, OrOperator] = dict.fromkeys(
    ("normalized_sum", "NormalizedSum", "NSUM"), "bounded_sum"
)
DEFUZZIFIERS: dict[Defuzzifier, Words] = {
    "centroid": Words("centroid", "Centroid", "COG", "COG"),
    "bisector": Words("bisector", "Bisector", "COA", "COA"),
    "mom": Words("mom", "MeanOfMaximum", "MOM", "MM"),
    "som": Words("som", "SmallestOfMaximum", "LM", "LM"),
    "lom": Words("lom", "LargestOfMaximum", "RM", "RM"),
    "weighted_average": Words("wtaver", "WeightedAverage", "WA", "COGS"),
    "weighted_sum": Words("wtsum", "WeightedSum", "WS", "COGSS"),
}
#: Nothing where a format has no word. fuzzylite's `extremely` is not that of MATLAB and IEEE 1855.
HEDGES: dict[Hedge, Words] = {
    "very": Words("", "very", "very", "very"),
    "somewhat": Words("", "somewhat", "somewhat", "somewhat"),
    "extremely": Words("", "", "extremely", ""),
    "intensely": Words("", "extremely", "intensify", "extremely"),
    "seldom": Words("", "seldom", "seldom", "seldom"),
}


def meanings(
    methods: Mapping[_Name, Words], file_format: Literal["fis", "fll", "fml", "fcl"]
) -> dict[str, _Name]:
    """Return the words of a format with the methods they stand for."""
    return {getattr(words, file_format): name for name, words in methods.items()}
