"""Names, operators, defuzzifiers and hedges in the words of each format, one row each."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Literal, NamedTuple, TypeVar

from fis_tools.model import Aggregation, AndOperator, Defuzzifier, FuzzySystem, Hedge, OrOperator

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
    "unbounded_sum": Words("sum", "UnboundedSum", "custom_sum", "UnboundedSum")
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
    "weighted_sum": Words("wtsum", "WeightedSum", "custom_WS", "COGSS"),
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


#: What may stand in a rule of some format and is therefore no name.
_RESERVED = {
    *("if", "is", "and", "or", "not", "then", "with", "any", "very", "somewhat", "extremely", "seldom"),
    *("plus", "nan", "inf", "term", "rule", "range"),
}


class Names:
    """Identifiers for everything that has a name.

    Parameters
    ----------
    system : FuzzySystem
        What to name.
    are_unique : bool
        Whether no two of them may be the same; otherwise only variables differ, and the terms of each.

    Attributes
    ----------
    system : str
        For the system.
    variables : dict
        By the variable's name.
    terms : dict
        By the variable's and the term's name.
    statements : dict
        By the variable's and the term's name: both of them.
    """

    def __init__(self, system: FuzzySystem, *, are_unique: bool) -> None:
        everything = (*system.inputs, *system.outputs)
        self.variables = _identifiers(variable.name for variable in everything)
        self.terms = {
            (variable.name, term): name
            for variable in everything
            for term, name in _identifiers(term.name for term in variable.terms).items()
        }
        if are_unique:
            self._make_unique()
        taken = {*self.variables.values(), *self.terms.values()} if are_unique else set()
        self.system = _free(identifier(system.name), taken)
        self.statements = {
            (variable, term): (self.variables[variable], name)
            for (variable, term), name in self.terms.items()
        }

    def _make_unique(self) -> None:
        """Put the variable before each term whose name is not the only one of its kind."""
        count = Counter((*self.variables.values(), *self.terms.values()))
        taken = {*self.variables.values(), *(name for name in self.terms.values() if count[name] == 1)}
        for (variable, term), name in self.terms.items():
            if count[name] > 1:
                self.terms[variable, term] = _free(f"{self.variables[variable]}_{name}", taken)
                taken.add(self.terms[variable, term])


def identifier(name: str) -> str:
    """Return a word of ASCII letters, digits and underscores that stands for a name in any format."""
    ascii_name = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode("ascii")
    word = re.sub(r"\W+", "_", ascii_name, flags=re.ASCII) or "_"
    return f"_{word}" if word[0].isdigit() or word.lower() in _RESERVED else word


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return an identifier for each name, no two alike."""
    found: dict[str, str] = {}
    for name in names:
        found[name] = _free(identifier(name), set(found.values()))
    return found


def _free(name: str, taken: set[str]) -> str:
    count, free = 1, name
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free
