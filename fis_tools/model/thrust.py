"""The thrust logic: the steps from the rules' outputs to the force that is fired.

Fuzzy systems whose outputs are force components command a force; whether and how it is fired
depends on attributes of their controller, as `ThrustLogic` lists them. `REASONS` is what a recording says
about each component in each control period: of the command, and of what thrusters that are not ideal fire of
it.
"""

from dataclasses import dataclass
from math import inf
from typing import Final

from fis_tools.model.systems import FuzzyController
from plain_files.plain_text import as_number

#: what became of a component of the force: the word in a recording, and in a sentence
REASONS: Final = {
    "fired": "it was fired",
    "silent": "nothing was asked for or fired",
    "dead_band": "less than the dead band, it was not fired",
    "waiting": "between two decisions nothing is inferred or fired",
    "coasting": "coasting to the end shows enough: nothing was inferred or fired",
    "complete": "every point is inspected: nothing was inferred or fired",
    "clipped": "it was fired as far as the greatest force goes",
    "safety": "the safety layer commanded something else",
    "rehearsed": "it was chosen by flights ahead: nothing was inferred",
    "below_least_impulse": "less than the thrusters' least impulse, it was not fired",
    "delayed": "the thrusters had yet to fire it",
    "empty_tank": "the tank was empty, it was not fired",
    "parked": "it leads onto a closed ellipse inside the limits: nothing was inferred",
}
#: those that the thrust logic gives: the others come before it, or after it
LOGIC_REASONS: Final = ("fired", "silent", "dead_band", "waiting", "coasting", "complete", "clipped")

#: commands below this count as zero, N: an output that should be zero may differ by rounding
SILENT_N: Final = 1e-12
#: reasons with which a system's output takes effect: it was commanded and fired, up to the thrust limit
COUNTED: Final = ("fired", "clipped")
#: for recordings without reasons
UNKNOWN: Final = "unknown"

#: components that a system's output may be named after
COMPONENTS: Final = ("force_x", "force_y", "force_z")
#: the quantities that decide on coasting, in the order of the comparisons
FORESEEN: Final = ("missed", "coasting_nearest", "coasting_farthest")


@dataclass(frozen=True)
class ThrustLogic:
    """The steps between inference and the force that is fired, in their order.

    Parameters
    ----------
    decision_period_s : float
        From one decision to the next; a force lasts one control period, and in the others nothing is fired.
        Zero: a decision in each control period.
    coast_below_points : float
        With fewer points than this missed by coasting to the end, nothing is inferred or fired; zero: never.
    coast_margin_m : float
        Exception: coasting would come closer than this to a distance limit.
    dead_bands_n : tuple of float, shape (3,)
        A component smaller than this is not fired.
    force_axes : str
        The axes of the components. Commands in ``body`` axes are rotated to the axes in which the
        force is fired; any others are those axes. Each component there is clipped; a safety layer may follow.
    plans_ahead : bool
        Whether pushes that are planned ahead, and not inferred, come first.
    parks : bool
        Whether a push that ends the motion in a closed path, and is not inferred, comes first.
    """

    decision_period_s: float
    coast_below_points: float
    coast_margin_m: float
    dead_bands_n: tuple[float, float, float]
    force_axes: str
    plans_ahead: bool = False
    parks: bool = False

    @property
    def is_turned(self) -> bool:
        """Whether the components are in other axes than those in which the force is fired."""
        return self.force_axes == "body"

    @property
    def may_coast(self) -> bool:
        """Whether the controller coasts before every point is inspected."""
        return self.coast_below_points > 0.0


def thrust_logic(controller: FuzzyController) -> ThrustLogic | None:
    """Return the thrust logic of a controller; None if it commands no force.

    Raises
    ------
    ValueError
        If an attribute is not a nonnegative number.
    """
    attributes = dict(controller.attributes)
    names = [output.name for system in controller.systems for output in system.outputs]
    if "force_axes" not in attributes or not names or not set(names) <= set(COMPONENTS):
        return None

    def number(name: str) -> float:
        text = attributes.get(name, "0")
        value = as_number(text)
        if value is None or not 0.0 <= value < inf:
            raise ValueError(f"controller {controller.name!r} has {name} {text!r}; give a number from 0 on")
        return value

    x, y, z = (number(f"dead_band_{name}_n") for name in COMPONENTS)
    return ThrustLogic(
        decision_period_s=number("decision_period_s"),
        coast_below_points=number("coast_below_points"),
        coast_margin_m=number("coast_margin_m"),
        dead_bands_n=(x, y, z),
        force_axes=attributes["force_axes"],
        plans_ahead=number("foresight_pushes") > 0.0,
        parks=number("park_below_points") > 0.0,
    )
