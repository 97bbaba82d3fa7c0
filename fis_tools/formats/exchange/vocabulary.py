"""Names, operators, defuzzifiers and hedges in the words of each format, one row each."""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Literal, NamedTuple, TypeVar, get_args

from fis_tools.model import Aggregation, AndOperator, Defuzzifier, FuzzySystem, Hedge, OrOperator
from plain_files.plain_text import distinct

_Name = TypeVar("_Name", bound=str)


class Words(NamedTuple):
    """The words for one method in each format."""

    fis: str
    fll: str


#: Of methods that a format calls otherwise than we do.
_OTHERWISE = {
    "min": Words("min", "Minimum"),
    "max": Words("max", "Maximum"),
    "product": Words("prod", "AlgebraicProduct"),
    "probabilistic_sum": Words("probor", "AlgebraicSum"),
    "unbounded_sum": Words("sum", "UnboundedSum"),
    "mom": Words("mom", "MeanOfMaximum"),
    "som": Words("som", "SmallestOfMaximum"),
    "lom": Words("lom", "LargestOfMaximum"),
    "weighted_average": Words("wtaver", "WeightedAverage"),
    "weighted_sum": Words("wtsum", "WeightedSum"),
}


def _worded(methods: Iterable[_Name]) -> dict[_Name, Words]:
    """Return methods with their words in each format: mostly our names, in fuzzylite like EinsteinSum."""
    return {name: _OTHERWISE.get(name, Words(name, name.title().replace("_", ""))) for name in methods}


AND: dict[AndOperator, Words] = _worded(get_args(AndOperator))
OR: dict[OrOperator, Words] = _worded(get_args(OrOperator))
AGGREGATIONS: dict[Aggregation, Words] = _worded(("unbounded_sum", *get_args(OrOperator)))
DEFUZZIFIERS: dict[Defuzzifier, Words] = _worded(get_args(Defuzzifier))
#: Words of fuzzylite for what is known by another one: from two degrees of truth both make the same.
NORMALIZED_SUMS: dict[str, OrOperator] = dict.fromkeys(("normalized_sum", "NormalizedSum"), "bounded_sum")
#: fuzzylite's words for hedges; the others have none. Its `extremely` is not that of MATLAB.
HEDGES: dict[Hedge, str] = {
    "very": "very",
    "somewhat": "somewhat",
    "intensely": "extremely",
    "seldom": "seldom",
}


def meanings(methods: Mapping[_Name, Words], file_format: Literal["fis", "fll"]) -> dict[str, _Name]:
    """Return a format's words, each with the method it stands for."""
    return {getattr(words, file_format): name for name, words in methods.items()}


#: What may stand in a rule of some format and is therefore no name.
_RESERVED = {
    *("if", "is", "and", "or", "not", "then", "with", "any", "very", "somewhat", "extremely", "seldom"),
    *("plus", "nan", "inf", "term", "rule", "range"),
}


class Names:
    """The identifiers of a system's variables and terms.

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
        """Return the identifiers of a variable and one of its terms."""
        return self.variables[variable], self.terms[variable, term]


def identifier(name: str) -> str:
    """Return an identifier of ASCII letters, digits and underscores for a name."""
    ascii_name = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode("ascii")
    word = re.sub(r"\W+", "_", ascii_name, flags=re.ASCII) or "_"
    return f"_{word}" if word[0].isdigit() or word.lower() in _RESERVED else word


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return an identifier for each name, no two alike."""
    known = list(names)
    return dict(zip(known, distinct(map(identifier, known)), strict=True))
