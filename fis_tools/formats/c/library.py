"""The functions of ``parts.c``, by name: which of them a text calls, and which a system's methods need."""

import re
from functools import cache
from pathlib import Path

from fis_tools.file_access import read_shipped
from fis_tools.model import FuzzySystem

#: What the C function of a defuzzifier is called; that of any other method is called ``fuzzy_`` and its name.
DEFUZZIFIERS = {
    "centroid": "centroid",
    "bisector": "bisector",
    "mom": "mean_of_maximum",
    "som": "smallest_of_maximum",
    "lom": "largest_of_maximum",
}
#: Those that find no number in some heights; their last argument is what they return then.
MAY_FIND_NOTHING = ("sampled_bisector_fcl",)


def defuzzifiers_of(system: FuzzySystem) -> dict[str, str]:
    """Return the names of the C functions of a system's defuzzifiers."""
    if not system.is_sampled:
        return DEFUZZIFIERS
    of_tools = {"matlab": ("bisector", "som", "lom"), "fuzzylite": ("bisector",), "fcl": ("bisector",)}
    differing = of_tools[system.semantics]
    return {
        method: f"sampled_{name}" + (f"_{system.semantics}" if method in differing else "")
        for method, name in DEFUZZIFIERS.items()
    }


_CONCLUDE = "conclude_by_IMPLICATION_and_AGGREGATION"
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CALL = re.compile(r"\b(\w+)\(")


@cache
def _functions() -> dict[str, str]:
    """Return the texts of the functions by their names."""
    text = read_shipped(Path(__file__).with_name("parts.c"))
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
    reached: set[str] = set()
    waiting = [text]
    while waiting:
        names = set(_CALL.findall(_COMMENT.sub("", waiting.pop())))
        new = (names & functions.keys()) - reached
        reached |= new
        waiting += (functions[name] for name in new)
    return [function for name, function in functions.items() if name in reached]


def conclude(implication: str, aggregation: str) -> tuple[str, str]:
    """Return the name and text of the function that adds a rule's implied set to the aggregate."""

    def filled(text: str) -> str:
        return text.replace("IMPLICATION", implication).replace("AGGREGATION", aggregation)

    return filled(_CONCLUDE), filled(_functions()[_CONCLUDE])
