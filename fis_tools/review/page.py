"""The page itself: words, systems and flights put into one file that needs no other."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from fis_tools import analysis, flights
from fis_tools.flights import FlownSystem
from fis_tools.inference import Floats
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.review import carried, content
from fis_tools.review.colours import BRIGHTNESS, level_styles
from fis_tools.validate import ControllerFileError

#: joined in this order
SCRIPTS = (
    *("elements", "scale", "palette", "canvases", "carried", "operators", "inference", "sign_change"),
    *("state", "tables", "memberships", "inference_view", "rules_view", "response", "heat_map", "solid"),
    *("surface_view", "flight_view", "page"),
)


@dataclass(frozen=True)
class Flight:
    """A flight by its name, and what each system did on it, by the system's name."""

    name: str
    flown: Mapping[str, FlownSystem]


def write(controller: FuzzyController, flight_paths: Sequence[Path | str] = ()) -> str:
    """Write the review page of a controller.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    flight_paths : sequence of paths
        Logged flights to review it along; without any, rules are counted over the whole input space.

    Returns
    -------
    str
        HTML that needs no other file and asks for none.

    Raises
    ------
    fis_tools.validate.ControllerFileError
        If a flight cannot be read, or its systems have other inputs than the controller's.
    """
    flown = [read_flight(path, controller) for path in flight_paths]
    data = {
        "brightness": BRIGHTNESS,
        "systems": [carried.system_data(system) for system in controller.systems],
        "flights": [
            carried.flight_data(flight.name, flight.flown, controller.systems, len(flown)) for flight in flown
        ],
    }
    style = (files(__package__) / "style.css").read_text(encoding="utf-8") + level_styles()
    script = _script()
    environment = Environment(
        loader=PackageLoader("fis_tools", "review"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        controller=controller,
        facts=content.facts((*controller.attributes, *controller.provenance)),
        fingerprint=content.fingerprint(controller),
        flights=[(flight.name, _num_inferences(flight)) for flight in flown],
        samples=_samples_words(flown),
        systems=[
            content.system_words(index, system, _usage(system, flown))
            for index, system in enumerate(controller.systems, start=1)
        ],
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704 - files of this package
        data=Markup(carried.as_json(data)),  # noqa: S704 - no character of it ends a script element
        style_hash=_source_hash(style),
        script_hash=_source_hash(script),
    )


def read_flight(path: Path | str, controller: FuzzyController) -> Flight:
    """Read a flight to review a controller along.

    Raises
    ------
    fis_tools.validate.ControllerFileError
        If it cannot be read, or its systems have other inputs than the controller's.
    """
    known = {system.name: system for system in controller.systems}
    flown = {one.system.name: one for one in flights.read_flight(path) if one.system.name in known}
    if not flown:
        names = ", ".join(known)
        raise ControllerFileError(f"{path} was flown without any of the systems {names}; give another flight")
    for name, one in flown.items():
        logged, wanted = ([v.name for v in system.inputs] for system in (one.system, known[name]))
        if logged != wanted:
            raise ControllerFileError(
                f"{path}: its system {name!r} senses {', '.join(logged)}, but the controller's senses "
                f"{', '.join(wanted)}; give flights of this controller"
            )
    return Flight(Path(path).stem, flown)


def _samples(system: FuzzySystem, flown: Sequence[Flight]) -> Floats:
    """Return the inputs that a system's rules are counted over."""
    rows = [flight.flown[system.name].inputs for flight in flown if system.name in flight.flown]
    sensed = np.concatenate([np.empty((0, len(system.inputs))), *rows])
    return sensed if len(sensed) else analysis.spread_inputs(system)


def _usage(system: FuzzySystem, flown: Sequence[Flight]) -> analysis.RuleUsage:
    return analysis.rule_usage(analysis.firing(system, _samples(system, flown)))


def _num_inferences(flight: Flight) -> int:
    return max(len(one.time_s) for one in flight.flown.values())


def _samples_words(flown: Sequence[Flight]) -> str:
    if not flown:
        return "over 4,096 points spread evenly over all inputs"
    return "along the flight" if len(flown) == 1 else f"along the {len(flown)} flights"


def _script() -> str:
    """Join the scripts into one that leaves nothing of its own behind."""
    folder = files(__package__) / "scripts"
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    return '\n"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def _source_hash(text: str) -> str:
    """Return what a content security policy allows a script or style element of this text by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
