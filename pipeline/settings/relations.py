"""Relations between settings of a mission: one table, a row for each, by which a mission is accepted.

A row says what must hold, of which settings, and has a function that yields, of a mission that breaks it,
what is wrong and the cure. Values of single settings are checked where they are defined.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from pipeline.settings import checks
from pipeline.settings.checks import SettingError
from pipeline.settings.orbit import FASTEST_RAD_S, GRAVITY_TOLERANCE, SLOWEST_RAD_S, MeanMotionOrbit

#: `pipeline.settings.mission.Mission`, which imports this module
Mission = Any

#: standard gravity: the exhaust speed is the specific impulse times this
STANDARD_GRAVITY_M_S2: Final = 9.80665
#: beyond these a flight fills a computer's memory
MOST_CONTROLS, MOST_POINTS_SAMPLED, MOST_ATTITUDES = 100_000, 20_000_000, 5_000_000
#: greatest eccentricity beside which Clohessy and Wiltshire's equations, with its mean motion, are of use
MOST_CIRCULAR = 0.02
#: beyond this many control periods of free drift the safety layer takes longer than the flight
MOST_HORIZONS = 10_000


@dataclass(frozen=True)
class Relation:
    """A relation between settings.

    Parameters
    ----------
    sentence : str
        What must hold.
    keys : tuple of str
        The settings, dotted.
    refusals : callable
        Yields sentences on a mission that breaks it, or raises a `SettingError`.
    """

    sentence: str
    keys: tuple[str, ...]
    refusals: Callable[[Mission], Iterator[str]]


#: in the order in which they are checked
RELATIONS: list[Relation] = []


Refusals = Callable[[Mission], Iterator[str]]


def relation(sentence: str, *keys: str) -> Callable[[Refusals], Refusals]:
    """Add a function to the table, with what must hold and the keys that it relates."""

    def add(refusals: Refusals) -> Refusals:
        RELATIONS.append(Relation(sentence, keys, refusals))
        return refusals

    return add


def check_relations(mission: Mission) -> None:
    """Raise SettingError for the first relation that a mission breaks.

    Raises
    ------
    SettingError
    """
    for row in RELATIONS:
        for words in row.refusals(mission):
            raise SettingError(words)


@relation(
    "A mean motion and a radius, where both are given, are those of one planet.",
    *("orbit.mean_motion_rad_s", "orbit.radius_m", "orbit.gravity_m3_s2"),
)
def _gravity(mission: Mission) -> Iterator[str]:
    orbit = mission.orbit
    if not isinstance(orbit, MeanMotionOrbit) or orbit.radius_m is None:
        return
    gravity = orbit.mean_motion_rad_s**2 * orbit.radius_m**3
    if not abs(gravity / orbit.gravity_m3_s2 - 1.0) <= GRAVITY_TOLERANCE:
        yield (
            f"orbit.radius_m is {orbit.radius_m:g} and orbit.mean_motion_rad_s {orbit.mean_motion_rad_s:g}, "
            f"an orbit about {gravity / orbit.gravity_m3_s2:.4g} of orbit.gravity_m3_s2="
            f"{orbit.gravity_m3_s2:g}; give one of them, as with orbit=radius, or name the planet's gravity"
        )


@relation(
    "A size of an orbit, and its planet's gravity, make a mean motion that orbits have.",
    *("orbit.kind", "orbit.radius_m", "orbit.semi_major_axis_m", "orbit.altitude_m", "orbit.gravity_m3_s2"),
)
def _motion(mission: Mission) -> Iterator[str]:
    motion, kind = mission.orbit.mean_motion_rad_s, mission.orbit.kind
    if not SLOWEST_RAD_S <= motion <= FASTEST_RAD_S:
        yield (
            f"orbit.kind is {kind}, and what it gives makes a mean motion of {motion:.3g} rad/s; it must be "
            f"from {SLOWEST_RAD_S:g} to {FASTEST_RAD_S:g}: check the size, in m, and orbit.gravity_m3_s2"
        )


@relation(
    "Shadow, oblateness and the Sun at an epoch are the Earth's.",
    *("orbit.gravity_m3_s2", "light.shadow", "dynamics.j2", "orbit.epoch"),
)
def _earth(mission: Mission) -> Iterator[str]:
    orbit, dynamics = mission.orbit, mission.dynamics
    if orbit.is_of_earth:
        return
    of_earth = {
        f"light.shadow={mission.light.shadow}": mission.light.shadow != "none",
        "dynamics.j2 above 0": dynamics.model == "two_body" and dynamics.j2 > 0.0,
        "orbit.epoch": orbit.epoch is not None,
    }
    for words, is_set in of_earth.items():
        if is_set:
            yield (
                f"orbit.gravity_m3_s2 is {orbit.gravity_m3_s2:g}, another planet's, and {words} is about the "
                "Earth; leave one of them out"
            )


@relation(
    "Clohessy and Wiltshire's equations fly beside an orbit that is nearly a circle.",
    *("orbit.tle", "dynamics.model"),
)
def _circle(mission: Mission) -> Iterator[str]:
    if mission.orbit.kind == "tle" and mission.dynamics.model == "cw":
        eccentricity = mission.orbit.elements.eccentricity
        if not eccentricity <= MOST_CIRCULAR:
            yield (
                f"orbit.tle is an orbit of eccentricity {eccentricity:.3g}, and dynamics.model=cw is about a "
                f"circle, up to {MOST_CIRCULAR:g}; choose dynamics=two_body"
            )


@relation(
    "Where the Sun follows from the epoch, the orbit's plane is that of every flight.",
    *("orbit.epoch", "orbit.inclination_deg", "orbit.raan_deg", "orbit.latitude_argument_deg"),
)
def _plane(mission: Mission) -> Iterator[str]:
    angles = ("inclination_deg", "raan_deg", "latitude_argument_deg")
    dispersed = [name for name in angles if name in mission.dispersions.get("orbit", {})]
    if mission.orbit.epoch is not None and dispersed:
        yield (
            f"dispersions.orbit.{dispersed[0]} is given, but the Sun follows from orbit.epoch and the plane "
            "given by orbit; leave one of them out"
        )


@relation(
    "A flight is whole control periods, each of them whole attitude periods.",
    "attitude_period_s",
    "control_period_s",
    "duration_s",
)
def _clocks(mission: Mission) -> Iterator[str]:
    attitude_period, period, duration = (
        mission.attitude_period_s,
        mission.control_period_s,
        mission.duration_s,
    )
    checks.divides("attitude_period_s", attitude_period, "control_period_s", period)
    checks.divides("control_period_s", period, "duration_s", duration)
    if mission.num_controls > MOST_CONTROLS:
        yield (
            f"duration_s is {duration:g} and control_period_s {period:g}, which makes "
            f"{mission.num_controls} control periods; there must be at most {MOST_CONTROLS}: shorten the "
            "first or lengthen the second"
        )


@relation(
    "Fixes and delays fall on samples of the flight.",
    "navigation.fix_period_s",
    "navigation.delay_s",
    "actuators.delay_s",
    "control_period_s",
)
def _samples(mission: Mission) -> Iterator[str]:
    period, navigation, times = mission.control_period_s, mission.navigation, {}
    if navigation.mode == "fixes":
        times["navigation.fix_period_s"] = navigation.fix_period_s
        times["navigation.delay_s"] = navigation.delay_s
    if mission.actuators.kind == "real":
        times["actuators.delay_s"] = mission.actuators.delay_s
    for key, time in times.items():
        if abs(time / period - round(time / period)) > 1e-9 * max(1.0, time / period):
            yield (
                f"{key} is {time:g} s and control_period_s {period:g} s; the first must be a multiple of "
                f"the second, as {period * max(1, round(time / period)):g} s is"
            )
        checks.within(key, time, 0.0, mission.duration_s, "s")


@relation(
    "A logged flight fits into memory.",
    "duration_s",
    "control_period_s",
    "attitude_period_s",
    "chief.num_points",
)
def _memory(mission: Mission) -> Iterator[str]:
    num_points, period_s = mission.chief.num_points, mission.attitude_period_s
    for key, value, per_control, most in (
        ("chief.num_points", num_points, num_points, MOST_POINTS_SAMPLED),
        ("attitude_period_s", period_s, mission.num_attitude_steps, MOST_ATTITUDES),
    ):
        count = mission.num_controls * per_control
        if count > most:
            yield (
                f"duration_s is {mission.duration_s:g}, control_period_s {mission.control_period_s:g} and "
                f"{key} {value:g}, which makes {count:.2g} values of "
                f"a flight; there may be at most {most:,}: shorten the flight, or make it coarser"
            )


@relation(
    "The sphere of inspection points lies inside the least distance of the deputy.",
    "chief.inspection_radius_m",
    "deputy.min_distance_m",
    "deputy.max_distance_m",
)
def _body(mission: Mission) -> Iterator[str]:
    chief, deputy = mission.chief, mission.deputy
    if chief.shape != "sphere":  # whose reach is known once it is read: pipeline.flight.world.surface
        return
    if not chief.inspection_radius_m < deputy.max_distance_m:
        yield (
            f"chief.inspection_radius_m is {chief.inspection_radius_m:g} and deputy.max_distance_m "
            f"{deputy.max_distance_m:g}; the first must be less than the second, or all points lie "
            "beyond the deputy (m)"
        )
    if mission.problem.kind == "inspection" and chief.inspection_radius_m > deputy.min_distance_m:
        yield (
            f"chief.inspection_radius_m is {chief.inspection_radius_m:g} and deputy.min_distance_m "
            f"{deputy.min_distance_m:g}; the first must not be greater than the second, or a flight through "
            "the chief keeps its limits (m)"
        )


@relation(
    "The sampled attitude law is stable.",
    "attitude.derivative_gain",
    "attitude.proportional_gain",
    "attitude_period_s",
)
def _gains(mission: Mission) -> Iterator[str]:
    attitude, period = mission.attitude, mission.attitude_period_s
    if attitude.mode != "flown":
        return
    damping = attitude.derivative_gain * period
    # a torque held over a period turns a rate w into (1 - damping) w
    if not damping < 2.0:
        yield (
            f"attitude.derivative_gain is {attitude.derivative_gain:g} and attitude_period_s "
            f"{period:g}, with the product {damping:g}; it must be less than 2, or every "
            f"period turns an error in rate into one {abs(1.0 - damping):.3g} times as great: lower one "
            "of them"
        )
    # for an error of half a turn the rate is the ratio of the gains, rad/s
    turned = attitude.proportional_gain / attitude.derivative_gain * period
    if not turned < 2.0:
        yield (
            f"attitude.proportional_gain is {attitude.proportional_gain:g}, attitude.derivative_gain "
            f"{attitude.derivative_gain:g} and attitude_period_s {period:g}, with which the deputy turns by "
            f"{turned:.3g} rad in a period; it must be less than 2, for the law acts once a period: "
            "lower the first or the last, or raise the second"
        )


@relation(
    "The thrusters can hold the deputy above the chief at its least distance.",
    "deputy.max_force_n",
    "deputy.mass_kg",
    "orbit.mean_motion_rad_s",
    "deputy.min_distance_m",
)
def _holding(mission: Mission) -> Iterator[str]:
    deputy, motion = mission.deputy, mission.orbit.mean_motion_rad_s
    needed = 3.0 * deputy.mass_kg * motion**2 * deputy.min_distance_m
    if not deputy.max_force_n >= needed:
        yield (
            f"deputy.max_force_n is {deputy.max_force_n:g}, but to stand still above the chief at "
            f"deputy.min_distance_m={deputy.min_distance_m:g} takes {needed:.3g} N with deputy.mass_kg="
            f"{deputy.mass_kg:g} and orbit.mean_motion_rad_s={motion:g}; raise it, or lower one of these"
        )


@relation(
    "The thrusters are stronger than drag and radiation.",
    "dynamics.drag_m_s2",
    "dynamics.radiation_m_s2",
    "deputy.max_force_n",
    "deputy.mass_kg",
)
def _disturbances(mission: Mission) -> Iterator[str]:
    dynamics, deputy = mission.dynamics, mission.deputy
    if dynamics.model != "two_body":
        return
    against = abs(dynamics.drag_m_s2) + abs(dynamics.radiation_m_s2)
    most = deputy.max_force_n / deputy.mass_kg
    if not against < most:
        yield (
            f"dynamics.drag_m_s2 is {dynamics.drag_m_s2:g} and dynamics.radiation_m_s2 "
            f"{dynamics.radiation_m_s2:g}, together no less than deputy.max_force_n={deputy.max_force_n:g} "
            f"over deputy.mass_kg={deputy.mass_kg:g}, which is {most:.3g} m/s^2; lower the first two, or "
            "raise the force"
        )


@relation(
    "The mass exceeds the propellant plus a control period at full thrust.",
    "actuators.propellant_kg",
    "deputy.mass_kg",
    "actuators.specific_impulse_s",
    "deputy.max_force_n",
)
def _propellant(mission: Mission) -> Iterator[str]:
    actuators, deputy = mission.actuators, mission.deputy
    if actuators.kind != "real" or actuators.specific_impulse_s is None:
        return
    speed = STANDARD_GRAVITY_M_S2 * actuators.specific_impulse_s
    most = deputy.mass_kg - 3.0 * deputy.max_force_n * mission.control_period_s / speed
    if not actuators.propellant_kg < most:
        yield (
            f"actuators.propellant_kg is {actuators.propellant_kg:g} and deputy.mass_kg "
            f"{deputy.mass_kg:g}, of which actuators.specific_impulse_s={actuators.specific_impulse_s:g} "
            f"may use {deputy.mass_kg - most:.3g} in a control period; the first must be less than "
            f"{most:.3g}: lower it, or raise one of the others (kg)"
        )


@relation(
    "The spheres of the safety layer have room between them, and the goal is outside the keep-out sphere.",
    *("safety.keep_out_margin_m", "safety.keep_in_margin_m", "deputy.min_distance_m"),
    *("deputy.max_distance_m", "problem.goal_radius_m"),
)
def _spheres(mission: Mission) -> Iterator[str]:
    if mission.safety.kind != "filter":
        return
    near = "deputy.min_distance_m plus safety.keep_out_margin_m"
    far = "deputy.max_distance_m less safety.keep_in_margin_m"
    checks.ascending(near, mission.keep_out_m, far, mission.keep_in_m)
    if mission.problem.kind == "reach" and mission.problem.goal_radius_m < mission.keep_out_m:
        yield (
            f"the safety layer keeps the deputy {mission.keep_out_m:g} m from the chief, but its goal lies "
            f"within {mission.problem.goal_radius_m:g} m (problem.goal_radius_m); choose safety=none"
        )


@relation(
    "The safety layer's stops take no more than the thrusters, and hold the deputy at its keep-in sphere.",
    *("safety.braking_force_n", "safety.planned_braking_n", "deputy.max_force_n", "deputy.mass_kg"),
    *("orbit.mean_motion_rad_s", "deputy.max_distance_m"),
)
def _braking(mission: Mission) -> Iterator[str]:
    safety, deputy = mission.safety, mission.deputy
    if safety.kind != "filter":
        return
    checks.within("safety.braking_force_n", mission.braking_force_n, 0.0, deputy.max_force_n, "N")
    standing = 3.0 * mission.orbit.mean_motion_rad_s**2 * mission.keep_in_m * deputy.mass_kg
    forces = {"braking_force_n": mission.braking_force_n}
    if safety.probability is not None:
        forces["planned_braking_n"] = safety.planned_braking_n
    for name, force in forces.items():
        if not standing <= force:
            yield (
                f"safety.{name} is {force:g}, but to stand still {mission.keep_in_m:g} m above the chief "
                f"takes {standing:.3g} N; raise it, or lower deputy.max_distance_m"
            )


@relation(
    "The safety layer allows a speed at its keep-out sphere, and looks a bounded time ahead.",
    *("safety.speed_limit_m_s", "safety.speed_slope_per_s", "safety.speed_distance_m"),
    *("safety.passive_horizon_s", "safety.keep_in_horizon_s", "control_period_s"),
)
def _speeds(mission: Mission) -> Iterator[str]:
    safety = mission.safety
    if safety.kind != "filter":
        return
    beyond = mission.keep_out_m - safety.speed_distance_m
    slowest = safety.speed_limit_m_s + safety.speed_slope_per_s * beyond
    if not slowest >= 0.0:
        yield (
            f"safety.speed_limit_m_s and safety.speed_slope_per_s allow {slowest:.3g} m/s at the "
            f"keep-out sphere ({mission.keep_out_m:g} m); it must be at least 0: raise the first, or lower "
            "the second or safety.speed_distance_m"
        )
    for name in ("passive_horizon_s", "keep_in_horizon_s"):
        most = MOST_HORIZONS * mission.control_period_s
        checks.within(f"safety.{name}", getattr(safety, name), 0.0, most, "s")
