"""Names, operators, defuzzifiers and hedges in the words of each format, one row each."""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Literal, NamedTuple, TypeVar

from fis_tools.model import Aggregation, AndOperator, Defuzzifier, FuzzySystem, Hedge, OrOperator
from fis_tools.plain_text import distinct

_Name = TypeVar("_Name", bound=str)


class Words(NamedTuple):
    """What the formats call one method."""

    fis: str
    fll: str


AND: dict[AndOperator, Words] = {
    "min": Words("min", "Minimum"),
    "product": Words("prod", "AlgebraicProduct"),
    "bounded_difference": Words("bounded_difference", "BoundedDifference"),
    "einstein_product": Words("einstein_product", "EinsteinProduct"),
    "hamacher_product": Words("hamacher_product", "HamacherProduct"),
    "drastic_product": Words("drastic_product", "DrasticProduct"),
    "nilpotent_minimum": Words("nilpotent_minimum", "NilpotentMinimum"),
}
OR: dict[OrOperator, Words] = {
    "max": Words("max", "Maximum"),
    "probabilistic_sum": Words("probor", "AlgebraicSum"),
    "bounded_sum": Words("bounded_sum", "BoundedSum"),
    "einstein_sum": Words("einstein_sum", "EinsteinSum"),
    "hamacher_sum": Words("hamacher_sum", "HamacherSum"),
    "drastic_sum": Words("drastic_sum", "DrasticSum"),
    "nilpotent_maximum": Words("nilpotent_maximum", "NilpotentMaximum"),
}
AGGREGATIONS: dict[Aggregation, Words] = {"unbounded_sum": Words("sum", "UnboundedSum")}
AGGREGATIONS.update(OR.items())
#: Words of fuzzylite for what is known by another one: from two degrees of truth both make the same.
NORMALIZED_SUMS: dict[str, OrOperator] = dict.fromkeys(("normalized_sum", "NormalizedSum"), "bounded_sum")
DEFUZZIFIERS: dict[Defuzzifier, Words] = {
    "centroid": Words("centroid", "Centroid"),
    "bisector": Words("bisector", "Bisector"),
    "mom": Words("mom", "MeanOfMaximum"),
    "som": Words("som", "SmallestOfMaximum"),
    "lom": Words("lom", "LargestOfMaximum"),
    "weighted_average": Words("wtaver", "WeightedAverage"),
    "weighted_sum": Words("wtsum", "WeightedSum"),
}
#: fuzzylite's words for hedges; the others have none. Its `extremely` is not that of MATLAB.
HEDGES: dict[Hedge, str] = {
    "very": "very",
    "somewhat": "somewhat",
    "intensely": "extremely",
    "seldom": "seldom",
}


def meanings(methods: Mapping[_Name, Words], file_format: Literal["fis", "fll"]) -> dict[str, _Name]:
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

    Attributes
    ----------
    system : str
        For the system.
    variables : dict
        By the variable's name.
    terms : dict
        By the variable's and the term's name.
    """

    def __init__(self, system: FuzzySystem) -> None:
        self.variables = _identifiers(variable.name for variable in system.variables)
        self.terms = {
            (variable.name, term): name
            for variable in system.variables
            for term, name in _identifiers(term.name for term in variable.terms).items()
        }
        self.system = identifier(system.name)

    def of(self, variable: str, term: str) -> tuple[str, str]:
        """Return what stands for a variable and one of its terms."""
        return self.variables[variable], self.terms[variable, term]


def identifier(name: str) -> str:
    """Return a word of ASCII letters, digits and underscores that stands for a name in any format."""
    ascii_name = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode("ascii")
    word = re.sub(r"\W+", "_", ascii_name, flags=re.ASCII) or "_"
    return f"_{word}" if word[0].isdigit() or word.lower() in _RESERVED else word


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return an identifier for each name, no two alike."""
    known = list(names)
    return dict(zip(known, distinct(map(identifier, known)), strict=True))
