"""Controllers scaled to another mission: every number by a rule of its unit, and what limits a mission.

Free motion about a circular orbit has no length of its own, and its time is one over the mean motion. So a
controller that flies one mission flies another in which lengths are ``size`` times as great and everything
happens ``tempo`` times as fast for its orbit, if its lengths, times, speeds and forces follow.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fis_tools.genes.stretches import rounded
from fis_tools.model import FuzzyController, FuzzySystem, Term, Variable
from fis_tools.model.membership import MembershipFunction
from fis_tools.model.numbers import Linear
from fis_tools.model.shapes import Polyline, Sampled
from pipeline.array_types import Floats
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.state.signals import CONSTANTS
from pipeline.flight.world.chief import tide_of, turn_of
from pipeline.flight.world.pack import inspection_points
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.following import sight_shell
from pipeline.settings.keys import unit_of

#: where the shipped controllers fly: the defaults of all settings
HOME: Final = Mission()
#: significant digits of scaled numbers, so that they can be read
DIGITS: Final = 3
#: units that stay as they are, and constants without a unit: counts and shares
UNCHANGED: Final = ("rad", "")
COUNTS: Final = (
    *("rehearsal_tours", "rehearsal_smallest", "rehearsal_shapes", "rehearsal_draws", "foresight_pushes"),
    *("foresight_bare", "foresight_searches"),
)
#: speeds of the whole mission, which cross the room inside its limits in a share of an orbit, however small
#: the chief is
ACROSS: Final = ("foresight_reach_m_s",)
#: the end of names of counts of points
POINTS: Final = "_points"
#: the time that must be whole control periods, those that must be so many of these, and those that must stay
#: below half an orbit
CLOCK: Final = "decision_period_s"
LOOKS_AHEAD: Final = ("rehearsal_period_s", "foresight_period_s")
HALF_ORBITS: Final = ("tour_time_s", "tour_wait_s", "rehearsal_slowest_s")
#: share of half an orbit that these are shortened to
BELOW_HALF: Final = 0.95


@dataclass(frozen=True)
class Similarity:
    """How a controller of the shipped missions is scaled to another.

    Parameters
    ----------
    mission : Mission
    size : float
        Factor on all lengths.
    tempo : float
        Factor on how fast things happen, beyond that of the orbit.
    decides_always : bool
        Whether to decide in each control period, not as often as the scaled clock says.
    """

    mission: Mission
    size: float = 1.0
    tempo: float = 1.0
    decides_always: bool = False

    @property
    def factors(self) -> Mapping[str, float]:
        """The factor on a number, by its unit.

        A force lasts a control period: it grows with the speed that it must give, and with the mass.
        """
        mission, home = self.mission, HOME
        time = home.orbit.mean_motion_rad_s / (mean_rate(mission) * self.tempo)
        speed, mass = self.size / time, mission.deputy.mass_kg / home.deputy.mass_kg
        force = speed * mass * home.control_period_s / mission.control_period_s
        scaled = {"m": self.size, "s": time, "1e6 s^2": time**2, "m/s": speed, "N": force}
        scaled[POINTS] = num_lit(mission) / num_lit(home)
        return scaled | dict.fromkeys(UNCHANGED, 1.0)

    def constant(self, name: str, value: float, clock_s: float = 0.0) -> float:
        """Return a scaled constant of a controller that decides as often as `clock_s` says, 0: always.

        Raises
        ------
        KeyError
            If there is no rule for its unit, or it has none and is not among `COUNTS`.
        """
        unit = POINTS if name.endswith(POINTS) else unit_of(name).symbol
        if name in COUNTS or value == 0.0:
            return value
        if not unit:
            raise KeyError(f"{name} has no unit and no rule by which it is scaled to another mission")
        room = self.mission.deputy.max_distance_m / HOME.deputy.max_distance_m
        factor = self.factors[unit] * (room / self.size if name in ACROSS else 1.0)
        scaled = rounded(value * factor, DIGITS)
        period = self.mission.control_period_s
        if name == CLOCK:
            return period if self.decides_always else max(period, round(scaled / period) * period)
        if name in LOOKS_AHEAD:
            decision = self.constant(CLOCK, clock_s) or period
            return max(decision, round(scaled / decision) * decision)
        return min(scaled, longest_time(self.mission, name))

    def controller(self, base: FuzzyController) -> FuzzyController:
        """Return a controller of this mission from a shipped one, under its name and with its rules."""
        attributes = dict(base.attributes)
        clock_s = float(attributes.get(CLOCK, 0.0))
        used = {name for name, kind in CONSTANTS.items() if name in attributes or kind.beside in attributes}
        for name in used:
            value = float(attributes.get(name, CONSTANTS[name].default))
            if (scaled := self.constant(name, value, clock_s)) != value:
                attributes[name] = repr(scaled)
        # a metre by which plans miss a point costs as at home, which is too little where pushes are larger
        if self.tempo > 1.0 and "foresight_pushes" in attributes and "coast_below_points" in attributes:
            attributes.setdefault("foresight_points", attributes["coast_below_points"])
        systems = tuple(self._system(system) for system in base.systems)
        return replace(base, attributes=tuple(sorted(attributes.items())), systems=systems)

    def _system(self, system: FuzzySystem) -> FuzzySystem:
        """Return a system with each variable scaled by the factor of its unit."""
        factors = {
            variable.name: exact_factor(variable, self.factors[variable.unit])
            for variable in (*system.inputs, *system.outputs)
        }
        of_inputs = [factors[variable.name] for variable in system.inputs]
        inputs, outputs = (
            tuple(scaled_variable(variable, factors[variable.name], of_inputs) for variable in variables)
            for variables in (system.inputs, system.outputs)
        )
        return replace(system, inputs=inputs, outputs=outputs)


def longest_time(mission: Mission, name: str) -> float:
    """Return the greatest value of a constant that must stay below half an orbit, s; infinity for others."""
    if name not in HALF_ORBITS:
        return math.inf
    return rounded(BELOW_HALF * math.pi / mission.orbit.mean_motion_rad_s, DIGITS)


def exact_factor(variable: Variable, factor: float) -> float:
    """Return the factor near a given one by which the end of a variable's range becomes a readable number."""
    greatest = max(abs(variable.minimum), abs(variable.maximum))
    return 1.0 if factor == 1.0 else rounded(greatest * factor, DIGITS) / greatest


def scaled_variable(variable: Variable, factor: float, of_inputs: Sequence[float] = ()) -> Variable:
    """Return a variable stretched about zero with all its terms; linear terms need the factors of inputs."""

    def stretch(value: float) -> float:
        return value if factor == 1.0 else rounded(value * factor, 12)

    return replace(
        variable,
        minimum=stretch(variable.minimum),
        maximum=stretch(variable.maximum),
        points=None if variable.points is None else tuple(stretch(point) for point in variable.points),
        default=None if variable.default is None else stretch(variable.default),
        terms=tuple(
            Term(term.name, scaled_shape(term.membership, factor, of_inputs)) for term in variable.terms
        ),
    )


def scaled_shape(
    shape: MembershipFunction, factor: float, of_inputs: Sequence[float] = ()
) -> MembershipFunction:
    """Return the shape of a term stretched about zero.

    Raises
    ------
    ControllerError
        If it is a formula, whose units are not known.
    """
    if isinstance(shape, Sampled):  # by the points of the universe, which stretch
        return shape
    if isinstance(shape, Polyline):
        return replace(shape, x=tuple(rounded(x * factor, 12) for x in shape.x))
    if isinstance(shape, Linear):
        pairs = zip(shape.coefficients, of_inputs, strict=True)
        slopes = tuple(rounded(slope * factor / of_input, 12) for slope, of_input in pairs)
        return replace(shape, coefficients=slopes, constant=rounded(shape.constant * factor, 12))
    if not shape.entry.kinds:
        raise ControllerError(
            f"a term is a {shape.entry.name}, which cannot be scaled to another mission; "
            "give its system membership functions, constants or linear terms"
        )
    powers = {"location": 1, "width": 1, "deviation": 1, "slope": -1, "exponent": 0}
    numbers = {
        name: rounded(getattr(shape, name) * factor ** powers[kind], 12)
        for name, kind in shape.entry.kinds.items()
        if factor != 1.0
    }
    return replace(shape, **numbers)


def sizes_worth_trying(mission: Mission) -> tuple[float, float]:
    """Return the least and the greatest scale that are worth trying in a mission."""
    home_lengths, lengths = _lengths(HOME), _lengths(mission)
    ratios = [length / reference for length, reference in zip(lengths, home_lengths, strict=True)]
    return 0.7 * min(ratios), 1.5 * max(ratios)


def num_lit(mission: Mission) -> float:
    """Return how many inspection points a Sun in the orbit's plane lights at some time of a flight.

    The terminator sweeps over what is dark at first, half of a sphere, once in half an orbit.
    """
    turn = turn_of(mission)
    return len(inspection_points(mission)) * min(1.0, 0.5 + turn / (2.0 * math.pi))


def mean_rate(mission: Mission) -> float:
    """Return the mean rate at which Hill axes turn in a flight, rad/s."""
    if not mission.has_true_course:
        return mission.orbit.mean_motion_rad_s
    return turn_of(mission) / mission.duration_s


def radius_of(mission: Mission) -> float:
    """Return the distance of a chief's farthest inspection point from its centre, m."""
    return float(np.linalg.norm(inspection_points(mission), axis=1).max())


def _lengths(mission: Mission) -> tuple[float, ...]:
    """Return the lengths of a mission: body, sight shell, keep-in."""
    radius = radius_of(mission)
    near, far = sight_shell(mission.deputy, mission.sensor, radius)
    # the low orbit of the shipped champions, whose camera sees 150 m
    far = min(far, 150.0) if mission is HOME else far
    return radius, near, far, mission.deputy.max_distance_m


@dataclass(frozen=True)
class Limitation:
    """A number of a mission that limits what any controller can do there.

    Parameters
    ----------
    name : str
    formula : str
    value : float
    limit : float
        Beyond which it matters.
    is_least : bool
        Whether the value should be at least the limit, or at most.
    consequence : str
        What follows beyond it.
    """

    name: str
    formula: str
    value: float
    limit: float
    is_least: bool
    consequence: str

    @property
    def is_kept(self) -> bool:
        """Whether the value is on the good side."""
        return self.value >= self.limit if self.is_least else self.value <= self.limit

    @property
    def sentence(self) -> str:
        """The number in words, with what follows if it is beyond its limit."""
        words = f"{', '.join(filter(None, (self.name, self.formula)))}: {self.value:.3g}"
        side = "at least" if self.is_least else "at most"
        if self.is_kept:
            return f"{words} ({side} {self.limit:.3g} is fine)"
        return f"{words}, which should be {side} {self.limit:.3g}: {self.consequence}"


def limitations(mission: Mission, distances_m: Floats) -> list[Limitation]:
    """Return the numbers of a mission that limit every controller, known before any flight.

    Parameters
    ----------
    mission : Mission
    distances_m : (n,) array
        Distances of some starts from the chief.
    """
    deputy, motion, is_true = mission.deputy, mean_rate(mission), mission.has_true_course
    farthest, middle = float(distances_m.max()), float(distances_m.mean())
    force = deputy.max_force_n
    radius = radius_of(mission)
    near, far = sight_shell(deputy, mission.sensor, radius)
    outside = float(np.mean((distances_m < near) | (distances_m > far)))
    thrusters = mission.actuators
    least = thrusters.least_impulse_n_s if isinstance(thrusters, RealActuators) else 0.0
    return [
        Limitation(
            f"thrust over what holds the deputy {farthest:.0f} m above the chief",
            "F / (m (2 mu/R^3 + w^2) d) where that is least" if is_true else "F / (3 m n^2 d)",
            force / (deputy.mass_kg * tide_of(mission) * farthest),
            *(1.0, True, "a start there cannot be held against the tide"),
        ),
        Limitation(
            "radians of the orbit that a flight lasts",
            "w t, by the mean rate w" if is_true else "n t",
            turn_of(mission),
            *(math.pi, True, "less than half a turn of the Sun about the chief, and of free motion"),
        ),
        Limitation(
            f"least impulse over what moves the deputy {middle:.0f} m in an orbit",
            "I / (m w d)" if is_true else "I / (m n d)",
            least / (deputy.mass_kg * motion * middle),
            *(0.1, False, "pushes are coarser than the motion that they steer"),
        ),
        Limitation(
            f"share of starts outside the {near:.1f} to {far:.1f} m from which the whole chief is in sight",
            "",
            outside,
            *(0.5, False, "flights begin by getting there"),
        ),
    ]
