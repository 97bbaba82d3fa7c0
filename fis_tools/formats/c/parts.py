"""The C functions that written systems share, from ``parts.c``; a file has those that it calls."""

import re
from functools import cache
from pathlib import Path

#: What the C function of a defuzzifier is called; that of any other method is called ``fuzzy_`` and its name.
DEFUZZIFIERS = {
    "centroid": "centroid",
    "bisector": "bisector",
    "mom": "mean_of_maximum",
    "som": "smallest_of_maximum",
    "lom": "largest_of_maximum",
}
_CONCLUDE = "conclude_by_IMPLICATION_and_AGGREGATION"
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CALL = re.compile(r"\b(\w+)\(")


@cache
def _functions() -> dict[str, str]:
    """Return the texts of the functions by their names."""
    text = Path(__file__).with_name("parts.c").read_text(encoding="utf-8")
    _opening, *functions = re.split(r"\n\n(?=/\*|static)", text.rstrip("\n"))
    return {_CALL.findall(_COMMENT.sub("", function))[0]: f"{function}\n" for function in functions}


def called(text: str) -> list[str]:
    """Return the functions that a text calls, and those that these call, callees first.

    Parameters
    ----------
    text : str
        C source; what its comments say calls nothing.
    """
    functions = _functions()
    found: set[str] = set()
    waiting = [text]
    while waiting:
        names = set(_CALL.findall(_COMMENT.sub("", waiting.pop())))
        new = (names & functions.keys()) - found
        found |= new
        waiting += (functions[name] for name in new)
    return [function for name, function in functions.items() if name in found]


def formula(method: str) -> str:
    """Return what an operator or a hedge returns, an expression of one degree of truth or two."""
    return _functions()[f"fuzzy_{method}"].partition("return ")[2].partition(";")[0]


def conclude(implication: str, aggregation: str) -> tuple[str, str]:
    """Return the function by which a rule adds what it implies where terms are not cut: its name and text."""

    def filled(text: str) -> str:
        return text.replace("IMPLICATION", implication).replace("AGGREGATION", aggregation)

    return filled(_CONCLUDE), filled(_functions()[_CONCLUDE])
