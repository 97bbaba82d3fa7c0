"""What a written C file has besides its systems: shared functions and the thrust logic.

A file has the functions of ``parts.c`` that it calls. Of the thrust logic there is one function, called
once in each control period: `fis_tools.model.thrust` says what it is. The function does what
`pipeline.flight.period.decide.thrust` does, but for the safety layer, which is no part of the controller.
"""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from textwrap import wrap

from fis_tools.formats import rendered
from fis_tools.model import FuzzyController, Variable
from fis_tools.model.thrust import COMPONENTS, FORESEEN, LOGIC_REASONS, REASONS, SILENT_N, ThrustLogic

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


def conclude(implication: str, aggregation: str) -> tuple[str, str]:
    """Return the function by which a rule adds what it implies where terms are not cut: its name and text."""

    def filled(text: str) -> str:
        return text.replace("IMPLICATION", implication).replace("AGGREGATION", aggregation)

    return filled(_CONCLUDE), filled(_functions()[_CONCLUDE])


#: words that no member of a structure may be called
_KEYWORDS = frozenset(
    {
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum"),
        *("extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void"),
        *("volatile", "while", "attitude", "is_complete"),
    }
)

#: unit and meaning of what coasting is decided by
_FORESEEN = {
    "missed": ("", "how many points coasting to the end would leave unseen"),
    "coasting_nearest": ("m", "least distance on the way"),
    "coasting_farthest": ("m", "greatest distance on the way"),
}


def members(controller: FuzzyController, logic: ThrustLogic) -> Mapping[str, tuple[str, str, str]]:
    """Return what `step` is told as signals: member of the structure by signal, its unit, what it is.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.

    Returns
    -------
    mapping of str to (str, str, str)
        In the order of the members.
    """
    sensed: dict[str, Variable] = {v.name: v for system in controller.systems for v in system.inputs}
    found: dict[str, tuple[str, str, str]] = {}
    taken: set[str] = set()
    foreseen = _FORESEEN if logic.may_coast else {}
    for name in dict.fromkeys([*sensed, *foreseen]):
        word = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name) or "_"
        if word[0].isdigit() or word in _KEYWORDS:
            word = f"signal_{word}"
        while word in taken:
            word += "_"
        taken.add(word)
        unit, about = foreseen.get(name, ("", ""))
        if name in sensed:
            unit, about = sensed[name].unit, sensed[name].description or about
        found[name] = (word, unit, about)
    return found


def step_structures(controller: FuzzyController, logic: ThrustLogic) -> str:
    """Write what `step` is told and what it gives back."""
    signals = (
        (word, wrap(f"/* {plain(', '.join(filter(None, (unit, about))))} */", 100, subsequent_indent=" * "))
        for word, unit, about in members(controller, logic).values()
    )
    axes = "in the axes that attitude turns from" if logic.is_turned else f"{logic.force_axes} axes"
    reasons = {word: REASONS[word] for word in LOGIC_REASONS}
    return rendered("c/step.h.jinja", logic=logic, signals=signals, reasons=reasons, fired_axes=plain(axes))


def step_functions(controller: FuzzyController, logic: ThrustLogic, infer: Mapping[str, str]) -> str:
    """Write `start` and `step`.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.
    infer : mapping of str to str
        The function that infers a system, by the system's name.
    """
    words = {name: member for name, (member, _, _) in members(controller, logic).items()}
    asked = [
        (COMPONENTS.index(system.outputs[0].name), infer[system.name], [words[v.name] for v in system.inputs])
        for system in controller.systems
    ]
    foreseen = [words[name] for name in FORESEEN] if logic.may_coast else []
    return rendered("c/step.c.jinja", logic=logic, systems=asked, foreseen=foreseen, silent_n=SILENT_N)


def plain(text: str) -> str:
    """Keep a text from ending its comment, from opening another and from spelling a trigraph."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
