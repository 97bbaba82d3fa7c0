"""The C functions ``start`` and ``step`` of a controller's thrust logic, and their structures."""

from collections.abc import Mapping
from textwrap import wrap

from fis_tools.formats import rendered
from fis_tools.formats.c.text import WORDS, plain
from fis_tools.model import FuzzyController, Variable, thrust
from fis_tools.model.thrust import ThrustLogic

#: words that no signal may be called
TAKEN = WORDS | {"attitude", "is_complete"}
#: unit and meaning of what coasting is decided by
_FORESEEN = {
    "missed": ("", "how many points coasting to the end would leave unseen"),
    "coasting_nearest": ("m", "least distance on the way"),
    "coasting_farthest": ("m", "greatest distance on the way"),
}


def members(controller: FuzzyController, logic: ThrustLogic) -> Mapping[str, tuple[str, str, str]]:
    """Return the members of `step`'s structure of signals: member by signal, its unit, its meaning.

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
    fields: dict[str, tuple[str, str, str]] = {}
    taken: set[str] = set()
    foreseen = _FORESEEN if logic.may_coast else {}
    for name in dict.fromkeys([*sensed, *foreseen]):
        word = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name) or "_"
        if word[0].isdigit() or word in TAKEN:
            word = f"signal_{word}"
        while word in taken:
            word += "_"
        taken.add(word)
        unit, about = foreseen.get(name, ("", ""))
        if name in sensed:
            unit, about = sensed[name].unit, sensed[name].description or about
        fields[name] = (word, unit, about)
    return fields


def step_structures(controller: FuzzyController, logic: ThrustLogic) -> str:
    """Render the structures that `step` takes and returns."""
    signals = (
        (word, wrap(f"/* {plain(', '.join(filter(None, (unit, about))))} */", 100, subsequent_indent=" * "))
        for word, unit, about in members(controller, logic).values()
    )
    axes = "in the axes that attitude turns from" if logic.is_turned else f"{logic.force_axes} axes"
    reasons = {word: thrust.REASONS[word] for word in thrust.LOGIC_REASONS}
    return rendered("c/step.h.jinja", logic=logic, signals=signals, reasons=reasons, fired_axes=plain(axes))


def step_functions(controller: FuzzyController, logic: ThrustLogic, infer: Mapping[str, str]) -> str:
    """Render the functions `start` and `step`.

    Parameters
    ----------
    controller : FuzzyController
    logic : ThrustLogic
        Of the controller.
    infer : mapping of str to str
        The function that infers a system, by the system's name.
    """
    words = {name: member for name, (member, _, _) in members(controller, logic).items()}
    requested = [
        (
            thrust.COMPONENTS.index(system.outputs[0].name),
            infer[system.name],
            [words[v.name] for v in system.inputs],
        )
        for system in controller.systems
    ]
    foreseen = [words[name] for name in thrust.FORESEEN] if logic.may_coast else []
    return rendered(
        "c/step.c.jinja", logic=logic, systems=requested, foreseen=foreseen, silent_n=thrust.SILENT_N
    )
