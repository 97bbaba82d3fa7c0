"""Descriptions of signals, some of which depend on whether a controller sets a constant.

Descriptions name constants, not their values: they stay true as a search or a hand changes values, until one
becomes zero or no longer is.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import chain, combinations

from fis_tools.model import FuzzyController, FuzzySystem
from pipeline.flight.state.signals import CONSTANTS, HILL_AXES, SIGNALS
from plain_files.plain_text import as_number


def _ring_radial(is_set: Callable[[str], bool]) -> str:
    if is_set("ring_size_m"):
        return SIGNALS["ring_error_radial"].description
    return "height above the centre of the ellipse of free motion, along i"


def _ring_along_track(is_set: Callable[[str], bool]) -> str:
    if is_set("ring_size_m"):
        return SIGNALS["ring_error_along_track"].description
    return "half of the way along j from the centre of the ellipse of free motion to the deputy"


def _predicted_centre(is_set: Callable[[str], bool]) -> str:
    name = "predicted_centre" if is_set("prediction_time_s") else "centre"
    return SIGNALS[f"{name}_along_track"].description


def _see_push(along: str, is_set: Callable[[str], bool]) -> str:
    if is_set("see_horizon_s"):
        return f"push {along} that would still show what coasting misses and is soon dark for good"
    return f"zero: without see_horizon_s no push {along} is sought"


def _aim(along: str, is_set: Callable[[str], bool]) -> str:
    """Describe the signals of the aim along an axis, by which constants are set."""
    towards = "what is lit and unseen, most of all what is soon dark for good"
    if not is_set("see_horizon_s"):
        if not is_set("aim_urgent_m_s"):
            return f"zero: without see_horizon_s and aim_urgent_m_s nothing is aimed at {along}"
        return f"aim_urgent_m_s {along} towards {towards}"
    shows = f"push {along} that would still show what is soon dark for good"
    bias = "plus a bias towards lit, unseen points, weighted by how soon they go dark"
    return f"{shows}, {bias}" if is_set("aim_urgent_m_s") else shows


def _tour_push(along: str, is_set: Callable[[str], bool]) -> str:
    leaning = ", shifted towards lit, unseen points that soon go dark," if is_set("tour_lean_m") else ""
    waiting = ", or by the end of the shadow within tour_wait_s," if is_set("tour_wait_s") else ""
    return f"push {along} that leads in tour_time_s{waiting} to where the tour{leaning} is then"


#: signals whose meaning follows constants: these, and the description by which of them are set
FOLLOWING: dict[str, tuple[tuple[str, ...], Callable[[Callable[[str], bool]], str]]] = {
    "ring_error_radial": (("ring_size_m",), _ring_radial),
    "ring_error_along_track": (("ring_size_m",), _ring_along_track),
    "predicted_centre_along_track": (("prediction_time_s",), _predicted_centre),
    **{
        f"{name}_{axis}": (constants, partial(words, along))
        for name, constants, words in (
            ("see_push", ("see_horizon_s",), _see_push),
            ("aim", ("see_horizon_s", "aim_urgent_m_s"), _aim),
            ("tour_push", ("tour_lean_m", "tour_wait_s"), _tour_push),
        )
        for axis, along in HILL_AXES.items()
    },
}


def describe(signal: str, constants: Iterable[str]) -> str:
    """Return what a signal means to a controller that sets these constants, the others being zero."""
    if signal not in FOLLOWING:
        return SIGNALS[signal].description
    return FOLLOWING[signal][1](frozenset(constants).__contains__)


def descriptions_of(signal: str) -> frozenset[str]:
    """Return every description that a signal may have."""
    names = FOLLOWING[signal][0] if signal in FOLLOWING else ()
    choices = chain.from_iterable(combinations(names, size) for size in range(len(names) + 1))
    return frozenset(describe(signal, choice) for choice in choices) | {SIGNALS[signal].description}


def constants_set(controller: FuzzyController) -> frozenset[str]:
    """Return the names of the constants that a controller sets to another number than zero."""
    return frozenset(name for name, text in controller.attributes if name in CONSTANTS and as_number(text))


def with_descriptions(controller: FuzzyController) -> FuzzyController:
    """Return a controller whose inputs say what they mean to it; words of a user's own are kept."""
    constants = constants_set(controller)

    def described(system: FuzzySystem) -> FuzzySystem:
        """Return a system with the descriptions of its inputs."""
        inputs = [
            replace(variable, description=describe(variable.name, constants))
            if variable.name in SIGNALS and variable.description in {"", *descriptions_of(variable.name)}
            else variable
            for variable in system.inputs
        ]
        return replace(system, inputs=tuple(inputs))

    return replace(controller, systems=tuple(described(system) for system in controller.systems))
