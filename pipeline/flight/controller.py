"""Which fuzzy system senses which signal and drives which axis: where both vocabularies meet.

An input of a fuzzy system is named after the signal that it senses, its output after the force component that
it commands; the controller's attribute ``force_axes`` says whether components are the deputy's body axes or
Hill's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import NotCompilable, Packed, layout_of, pack
from fis_tools.model import FuzzyController, FuzzySystem
from pipeline.flight.kernel import arrays
from pipeline.flight.kernel.arrays import Law
from pipeline.flight.log import Scenario

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """Something that a controller may sense."""

    index: int
    unit: str
    description: str


SIGNALS = {
    "distance": Signal(arrays.DISTANCE, "m", "distance from the chief's centre, |r|"),
    "velocity_body_x": Signal(
        arrays.VELOCITY_BODY,
        "m/s",
        "velocity relative to Hill along the deputy's x axis; the camera looks along -x",
    ),
    "velocity_body_y": Signal(arrays.VELOCITY_BODY + 1, "m/s", "the same along the deputy's y axis"),
    "velocity_body_z": Signal(arrays.VELOCITY_BODY + 2, "m/s", "the same along the deputy's z axis"),
    "lambda_u": Signal(
        arrays.LAMBDA_U,
        "rad",
        "angle from the deputy to the target in the i-j (orbit) plane, from -pi to pi",
    ),
    "eta_u": Signal(
        arrays.ETA_U, "rad", "angle from the deputy to the target in the i-k plane, from -pi to pi"
    ),
    "position_radial": Signal(arrays.POSITION_HILL, "m", "position along Hill i, away from the Earth"),
    "position_along_track": Signal(
        arrays.POSITION_HILL + 1, "m", "position along Hill j, the way the chief flies"
    ),
    "position_cross_track": Signal(arrays.POSITION_HILL + 2, "m", "position along Hill k, the orbit normal"),
    "velocity_radial": Signal(arrays.VELOCITY_HILL, "m/s", "velocity relative to Hill along i"),
    "velocity_along_track": Signal(arrays.VELOCITY_HILL + 1, "m/s", "velocity relative to Hill along j"),
    "velocity_cross_track": Signal(arrays.VELOCITY_HILL + 2, "m/s", "velocity relative to Hill along k"),
    "centre_radial": Signal(
        arrays.CENTRE,
        "m",
        "centre of the ellipse of free motion along i; above zero the ellipse falls behind",
    ),
    "centre_along_track": Signal(arrays.CENTRE + 1, "m", "centre of the ellipse of free motion along j"),
    "predicted_centre_along_track": Signal(
        arrays.PREDICTED_CENTRE, "m", "where that centre drifts to within prediction_time_s, along j"
    ),
    "closest_approach": Signal(
        arrays.CLOSEST_APPROACH, "m", "least distance to the chief within an orbit of free drift from here"
    ),
    "ring_error_radial": Signal(
        arrays.RING_ERROR, "m", "along i, from the place on the ring that follows the Sun to the deputy's"
    ),
    "ring_error_along_track": Signal(
        arrays.RING_ERROR + 1, "m", "along j, the same, halved as the ellipse is twice as long as high"
    ),
    "target_radial": Signal(arrays.TARGET_DIRECTION, "", "direction of the target along i, from -1 to 1"),
    "target_along_track": Signal(arrays.TARGET_DIRECTION + 1, "", "direction of the target along j"),
    "target_cross_track": Signal(arrays.TARGET_DIRECTION + 2, "", "direction of the target along k"),
    "sun_alignment": Signal(
        arrays.SUN_BEARING,
        "",
        "cosine of the angle from the deputy to the Sun in the orbit plane; 1 with the Sun behind the deputy",
    ),
    "sun_ahead": Signal(
        arrays.SUN_BEARING + 1,
        "",
        "sine of the same angle; above zero the Sun has yet to come to the deputy",
    ),
    "target_setting": Signal(
        arrays.TARGET_SETTING,
        "",
        "direction of the target across the Sun's, in the orbit plane; above zero where it soon goes dark",
    ),
    "missed": Signal(arrays.MISSED, "", "how many points coasting to the flight's end would leave unseen"),
    "coasting_nearest": Signal(
        arrays.COASTING_NEAREST,
        "m",
        "least distance from the chief while coasting to the flight's end",
    ),
    "coasting_farthest": Signal(arrays.COASTING_FARTHEST, "m", "greatest distance on the way"),
    "urgent_radial": Signal(
        arrays.URGENT,
        "",
        "direction along i, from -1 to 1, of what is lit and unseen, most of all what is soon dark for good",
    ),
    "urgent_along_track": Signal(arrays.URGENT + 1, "", "the same along j"),
    "urgent_cross_track": Signal(arrays.URGENT + 2, "", "the same along k"),
}

#: numbers that a controller may set besides its systems, as attributes, each with what it means
CONSTANTS = {
    "ring_size_m": "height of the ring that ring_error_* refer to, m",
    "ring_lead_rad": "how far the Sun is ahead of the deputy's place on the ring, rad",
    "dead_band_force_x_n": "a force_x smaller than this is not fired, N",
    "dead_band_force_y_n": "the same for force_y",
    "dead_band_force_z_n": "the same for force_z",
    "prediction_time_s": "how far ahead predicted_centre_along_track looks, s",
    "coast_below_points": "with fewer points than this missed by coasting to the end, coast",
    "coast_margin_m": "unless that would come nearer than this to a distance limit, m",
    "urgency_time_s": "time before its last light within which a point becomes urgent, for urgent_*, s",
    "skirt_distance_m": "nearer than this to the chief, urgent_* turns aside from it, m",
}

AXES = {"force_x": 0, "force_y": 1, "force_z": 2}
FORCE_AXES = {"hill": arrays.HILL, "body": arrays.BODY}


class ControllerError(ValueError):
    """A controller that cannot fly; the text says why and what to do."""


@dataclass(frozen=True)
class Controller:
    """What decides the force: fuzzy systems, a plan of forces, or who makes one for each start.

    Parameters
    ----------
    name : str
    systems : tuple of FuzzySystem
        At most three; none for a plan.
    force_axes : str
        ``body`` or ``hill``, the axes of the systems' outputs.
    plan : (K, 3) array, optional
        Forces in Hill axes, N, one row a control period; periods beyond the last row are flown without force.
    planner : callable, optional
        Makes the plan of a start, for laws that depend on position and velocity alone: these move exactly, so
        that such a law's forces are known beforehand.
    fuzzy : FuzzyController, optional
        What the systems came from, for files and reports.
    """

    name: str
    systems: tuple[FuzzySystem, ...]
    force_axes: str = "body"
    plan: Floats | None = None
    planner: Callable[[Scenario], Floats] | None = None
    fuzzy: FuzzyController | None = None


def from_fuzzy(fuzzy: FuzzyController) -> Controller:
    """Read who senses and drives what from a fuzzy controller.

    Raises
    ------
    ControllerError
        If a system senses or drives something unknown, an attribute is missing or no number, or the compiled
        flight does not cover a system.
    """
    attributes = dict(fuzzy.attributes)
    force_axes = attributes.get("force_axes", "")
    if force_axes not in FORCE_AXES:
        raise ControllerError(
            f"controller {fuzzy.name!r} has force_axes {force_axes!r}; set the attribute to body or hill"
        )
    if not fuzzy.systems:
        raise ControllerError(f"controller {fuzzy.name!r} has no system; give one to three")
    driven: dict[str, str] = {}
    for system in fuzzy.systems:
        for variable in system.inputs:
            if variable.name not in SIGNALS:
                raise ControllerError(
                    f"system {system.name!r} senses {variable.name!r}, which is no signal; "
                    f"the signals are {', '.join(SIGNALS)}"
                )
            if variable.unit != SIGNALS[variable.name].unit:
                raise ControllerError(
                    f"system {system.name!r} takes {variable.name!r} in {variable.unit!r}; "
                    f"this signal comes in {SIGNALS[variable.name].unit!r}"
                )
        names = [variable.name for variable in system.outputs]
        if len(names) != 1 or names[0] not in AXES:
            raise ControllerError(
                f"system {system.name!r} drives {', '.join(names) or 'nothing'}; "
                f"each system drives one of {', '.join(AXES)}"
            )
        if names[0] in driven:
            raise ControllerError(
                f"systems {driven[names[0]]!r} and {system.name!r} both drive {names[0]}; "
                "give each axis one system"
            )
        if system.outputs[0].unit != "N":
            raise ControllerError(
                f"output {names[0]!r} of {system.name!r} is in {system.outputs[0].unit!r}; use N"
            )
        driven[names[0]] = system.name
    try:
        pack(*fuzzy.systems)
    except NotCompilable as error:
        raise ControllerError(f"controller {fuzzy.name!r} cannot fly: {error}") from error
    controller = Controller(fuzzy.name, fuzzy.systems, force_axes, fuzzy=fuzzy)
    constants_of(controller)
    return controller


def coast() -> Controller:
    """Return the controller that never fires."""
    return Controller("coast", (), "hill", plan=np.zeros((0, 3)))


def open_loop(name: str, plan: Floats) -> Controller:
    """Return the controller that plays forces of shape (K, 3), Hill axes, N."""
    return Controller(name, (), "hill", plan=np.asarray(plan, dtype=np.float64))


def planned(name: str, planner: Callable[[Scenario], Floats]) -> Controller:
    """Return the controller that plans the forces of each start."""
    return Controller(name, (), "hill", planner=planner)


def planned_for(controller: Controller, scenario: Scenario) -> Controller:
    """Return the controller that flies a start: one that plays its plan, where the controller plans."""
    if controller.planner is None:
        return controller
    return replace(controller, plan=controller.planner(scenario), planner=None)


def law_of(controller: Controller, num_controls: int) -> Law:
    """Return what the compiled episode needs to know of a controller besides its numbers.

    Raises
    ------
    ControllerError
        If a plan is longer than the flight.
    """
    if controller.plan is not None and len(controller.plan) > num_controls:
        raise ControllerError(
            f"the plan of {controller.name!r} has {len(controller.plan)} forces, the flight {num_controls} "
            "control periods; shorten the plan or lengthen duration_s"
        )
    plan = np.zeros((num_controls if controller.plan is not None else 0, 3))
    if controller.plan is not None:
        plan[: len(controller.plan)] = controller.plan
    signals = np.zeros((len(controller.systems), 3), dtype=np.int64)
    for row, system in zip(signals, controller.systems, strict=True):
        indices = [SIGNALS[variable.name].index for variable in system.inputs]
        row[:] = (indices + [indices[-1]] * 3)[:3]
    return Law(
        axes=np.array([AXES[system.outputs[0].name] for system in controller.systems], dtype=np.int64),
        signals=signals,
        num_inputs=np.array([len(system.inputs) for system in controller.systems], dtype=np.int64),
        layout=layout_of(controller.systems)[0].ravel(),
        constants=layout_of(controller.systems)[1] if has_constants(controller) else -1,
        force_axes=FORCE_AXES[controller.force_axes],
        has_plan=controller.plan is not None,
        plan=plan,
    )


def has_constants(controller: Controller) -> bool:
    """Tell whether a controller sets any of `CONSTANTS`."""
    return controller.fuzzy is not None and any(name in CONSTANTS for name, _ in controller.fuzzy.attributes)


def constants_of(controller: Controller) -> Floats:
    """Return the constants of a controller, in the order of `CONSTANTS`; zero where it sets none.

    Raises
    ------
    ControllerError
        If one is no finite number, or negative where it measures a length, a force or a time.
    """
    attributes = dict(controller.fuzzy.attributes) if controller.fuzzy else {}
    values = np.zeros(len(CONSTANTS))
    for place, name in enumerate(CONSTANTS):
        text = attributes.get(name, "0")
        try:
            values[place] = float(text)
        except ValueError:
            values[place] = np.nan
        if not np.isfinite(values[place]) or (values[place] < 0 and name != "ring_lead_rad"):
            least = "a number" if name == "ring_lead_rad" else "a number from 0 on"
            raise ControllerError(f"controller {controller.name!r} has {name} {text!r}; give {least}")
    if senses_urgency(controller) and values[arrays.URGENCY_TIME] == 0.0:
        raise ControllerError(
            f"controller {controller.name!r} senses urgent_* but sets no urgency_time_s; give it as an "
            "attribute, the time before its last light within which a point becomes urgent, say 200 (s)"
        )
    return values


def senses_urgency(controller: Controller) -> bool:
    """Tell whether a system of a controller senses ``urgent_*``."""
    names = {variable.name for system in controller.systems for variable in system.inputs}
    return not names.isdisjoint(("urgent_radial", "urgent_along_track", "urgent_cross_track"))


def with_constants(numbers: Packed, controller: Controller) -> Packed:
    """Append a controller's constants to its numbers, or to those of a population of its structure."""
    if not has_constants(controller):
        return numbers
    rows = np.broadcast_to(constants_of(controller), (len(numbers.values), len(CONSTANTS)))
    return replace(numbers, values=np.hstack([numbers.values, rows]))


def packed(controller: Controller) -> Packed:
    """Return the numbers of a controller's systems; a plan has none."""
    if controller.systems:
        return with_constants(pack(*controller.systems), controller)
    return Packed(layout_of(())[0], np.zeros((1, 0)), np.zeros((1, 0), dtype=np.uint64), ())
