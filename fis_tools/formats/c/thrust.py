"""The thrust logic in C: one function that a flight computer calls once in each control period.

`fis_tools.model.thrust` says what it is. The function does what `pipeline.flight.period.decide.thrust`
does, but for the safety layer, which is no part of the controller.
"""

from collections.abc import Mapping
from textwrap import wrap

from fis_tools.formats.templates import rendered
from fis_tools.model import FuzzyController, Variable
from fis_tools.model.thrust import COMPONENTS, FORESEEN, LOGIC_REASONS, REASONS, SILENT_N, ThrustLogic

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

ABOUT = (
    "Call start() once, and step() once at the beginning of each control period. step() tells what is fired "
    "until the next call, as the recorded flights fired it. It is given the signals, and of the mission what "
    "the thrust logic needs. A safety layer, where one flies, comes after it, a rehearsed push before it.",
    "A signal that is not a number asks for nothing. Signals are read only where inference decides, what "
    "coasting is decided by only where a force is decided on; members that are not read may hold anything.",
)

RULES = (
    "Written with MISRA C:2012 in mind: no recursion, no allocation, no variable but the caller's outlives a "
    "call, every loop is bounded by the size of a table, one declaration a line, no macros. The addon misra "
    "of cppcheck finds no rule broken that is required; of the advisory ones tables stand together before "
    "the functions (8.9), the order of operators is C's (12.1), and functions may return early (15.5). "
    "Numbers are compared with 0 exactly where that is meant."
)


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


def structures(controller: FuzzyController, logic: ThrustLogic) -> str:
    """Write what `step` is told and what it gives back."""
    signals = (
        (word, wrap(f"/* {_plain(', '.join(filter(None, (unit, about))))} */", 100, subsequent_indent=" * "))
        for word, unit, about in members(controller, logic).values()
    )
    axes = "in the axes that attitude turns from" if logic.is_turned else f"{logic.force_axes} axes"
    reasons = {word: REASONS[word] for word in LOGIC_REASONS}
    return rendered("c/step.h.jinja", logic=logic, signals=signals, reasons=reasons, fired_axes=_plain(axes))


def functions(controller: FuzzyController, logic: ThrustLogic, infer: Mapping[str, str]) -> str:
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


def _plain(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
