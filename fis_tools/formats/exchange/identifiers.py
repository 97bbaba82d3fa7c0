"""Names that every format takes: words of ASCII letters, digits and underscores."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable

from fis_tools.model import FuzzySystem

#: What may stand in a rule of some format and is therefore no name.
_RESERVED = {
    *(
        "if",
        "is",
        "and",
        "or",
        "not",
        "then",
        "with",
        "any",
        "very",
        "somewhat",
        "extremely",
        "seldom",
        "plus",
    ),
    *("nan", "inf", "term", "rule", "range"),
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
        self.variables = dict(
            zip((v.name for v in everything), _identifiers(v.name for v in everything), strict=True)
        )
        self.terms = {
            (variable.name, term.name): name
            for variable in everything
            for term, name in zip(
                variable.terms, _identifiers(term.name for term in variable.terms), strict=True
            )
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


def _identifiers(names: Iterable[str]) -> list[str]:
    found: list[str] = []
    for name in names:
        found.append(_free(identifier(name), set(found)))
    return found


def _free(name: str, taken: set[str]) -> str:
    count, free = 1, name
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free
