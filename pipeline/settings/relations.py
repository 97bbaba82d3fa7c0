"""Relations between settings of a mission: one table, a row for each, by which a mission is accepted.

A row is the settings that it relates, and a function that checks them: it yields, of a mission that breaks
the relation, what is wrong and the cure; the message begins with the values of the settings. Values of single
settings are checked where they are defined.
"""

import math
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any, NamedTuple

from pipeline.constants import STANDARD_GRAVITY_M_S2
from pipeline.settings import checks
from pipeline.settings.checks import SettingError
from pipeline.settings.orbit import FASTEST_RAD_S, GRAVITY_TOLERANCE, SLOWEST_RAD_S, MeanMotionOrbit

#: `pipeline.settings.mission.Mission`, which imports this module
Mission = Any
Refusals = Callable[[Mission], Iterator[str]]

#: beyond these a flight fills a computer's memory
MOST_CONTROLS, MOST_POINTS_SAMPLED, MOST_ATTITUDES = 100_000, 20_000_000, 5_000_000
#: greatest eccentricity beside which Clohessy and Wiltshire's equations, with its mean motion, are of use
MOST_CIRCULAR = 0.02
#: greatest cosine between what is up in an image and the boresight
MOST_ALONG = 0.999
#: beyond this many control periods of free drift the safety layer takes longer than the flight
MOST_HORIZONS = 10_000


class Relation(NamedTuple):
    """A relation: of which dotted keys, and what refuses a mission that breaks it.

    That yields sentences, or raises a `SettingError`.
    """

    keys: tuple[str, ...]
    refusals: Refusals


#: in the order in which they are checked
RELATIONS: list[Relation] = []


def relation(*keys: str) -> Callable[[Refusals], Refusals]:
    """Add a function to the table, with the keys that it relates."""

    def add(refusals: Refusals) -> Refusals:
        RELATIONS.append(Relation(keys, refusals))
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
            values = {key: setting(mission, key) for key in row.keys}
            shown = [f"{key} is {value:g}" for key, value in values.items() if type(value) in (int, float)]
            raise SettingError("; ".join(filter(None, (", ".join(shown), words))))


def setting(mission: Mission, key: str) -> Any:
    """Return the value of a dotted key; None where it does not exist."""
    return reduce(lambda node, name: getattr(node, name, None), key.split("."), mission)


@relation("orbit.mean_motion_rad_s", "orbit.radius_m", "orbit.gravity_m3_s2")
def _gravity(mission: Mission) -> Iterator[str]:
    """Check that a mean motion and a radius, where both are given, are those of one planet."""
    orbit = mission.orbit
    if not isinstance(orbit, MeanMotionOrbit) or orbit.radius_m is None:
        return
    gravity = orbit.mean_motion_rad_s**2 * orbit.radius_m**3
    if not abs(gravity / orbit.gravity_m3_s2 - 1.0) <= GRAVITY_TOLERANCE:
        yield (
            f"the first two are an orbit about {gravity / orbit.gravity_m3_s2:.4g} of orbit.gravity_m3_s2; "
            "give one of them, as with orbit=radius, or name the planet's gravity"
        )


@relation(
    "orbit.kind", "orbit.radius_m", "orbit.semi_major_axis_m", "orbit.altitude_m", "orbit.gravity_m3_s2"
)
def _motion(mission: Mission) -> Iterator[str]:
    """Check that a size of an orbit, and its planet's gravity, make a mean motion that orbits have."""
    motion, kind = mission.orbit.mean_motion_rad_s, mission.orbit.kind
    if not SLOWEST_RAD_S <= motion <= FASTEST_RAD_S:
        yield (
            f"orbit.kind is {kind}, and what it gives makes a mean motion of {motion:.3g} rad/s; it must be "
            f"from {SLOWEST_RAD_S:g} to {FASTEST_RAD_S:g}: check the size, in m, and orbit.gravity_m3_s2"
        )


@relation("orbit.gravity_m3_s2", "light.shadow", "dynamics.j2", "orbit.epoch")
def _earth(mission: Mission) -> Iterator[str]:
    """Check that shadow and oblateness are of a planet of known radius, and an epoch is about the Earth."""
    orbit, shadow = mission.orbit, mission.light.shadow
    if orbit.is_of_earth:
        return
    if orbit.epoch is not None:
        yield "that is another planet's, and orbit.epoch is about the Earth; leave one of them out"
    of_radius = [f"light.shadow={shadow}"] if shadow != "none" else []
    of_radius += ["dynamics.j2 above 0"] if setting(mission, "dynamics.j2") else []
    if of_radius and orbit.planet_radius_m is None:
        yield (
            f"that is another planet's, and {of_radius[0]} is about one of known radius; give "
            "orbit.planet_radius_m, or leave one of them out"
        )


@relation("orbit.tle", "dynamics.model")
def _circle(mission: Mission) -> Iterator[str]:
    """Check that Clohessy and Wiltshire's equations fly beside an orbit that is nearly a circle."""
    if mission.orbit.kind == "tle" and mission.dynamics.model == "cw":
        eccentricity = mission.orbit.elements.eccentricity
        if not eccentricity <= MOST_CIRCULAR:
            yield (
                f"orbit.tle is an orbit of eccentricity {eccentricity:.3g}, and dynamics.model=cw is about a "
                f"circle, up to {MOST_CIRCULAR:g}; choose dynamics=two_body"
            )


@relation("orbit.epoch", "orbit.inclination_deg", "orbit.raan_deg", "orbit.latitude_argument_deg")
def _plane(mission: Mission) -> Iterator[str]:
    """Check that where the Sun follows from the epoch, the orbit's plane is that of every flight."""
    angles = ("inclination_deg", "raan_deg", "latitude_argument_deg")
    dispersed = [name for name in angles if name in mission.dispersions.get("orbit", {})]
    if mission.orbit.epoch is not None and dispersed:
        yield (
            f"dispersions.orbit.{dispersed[0]} is given, but the Sun follows from orbit.epoch and the plane "
            "given by orbit; leave one of them out"
        )


@relation("attitude_period_s", "control_period_s", "duration_s")
def _clocks(mission: Mission) -> Iterator[str]:
    """Check that a flight is whole control periods, each of them whole attitude periods."""
    period, duration = mission.control_period_s, mission.duration_s
    checks.divides("attitude_period_s", mission.attitude_period_s, "control_period_s", period)
    checks.divides("control_period_s", period, "duration_s", duration)
    if (count := mission.num_controls) > MOST_CONTROLS:
        yield (
            f"that makes {count} control periods; there must be at most {MOST_CONTROLS}: shorten the flight, "
            "or lengthen the period"
        )


@relation("control_period_s", "navigation.fix_period_s", "navigation.delay_s", "actuators.delay_s")
def _samples(mission: Mission) -> Iterator[str]:
    """Check that fixes and delays fall on samples of the flight."""
    period = mission.control_period_s
    for key in ("navigation.fix_period_s", "navigation.delay_s", "actuators.delay_s"):
        time = setting(mission, key) or 0.0
        if abs(time / period - round(time / period)) > 1e-9 * max(1.0, time / period):
            yield f"{key} must be a multiple of the first, as {period * max(1, round(time / period)):g} s is"
        checks.within(key, time, 0.0, mission.duration_s, "s")


@relation("duration_s", "control_period_s", "attitude_period_s", "chief.num_points")
def _memory(mission: Mission) -> Iterator[str]:
    """Check that a logged flight fits into memory."""
    for what, per_control, most in (
        ("points", mission.chief.num_points, MOST_POINTS_SAMPLED),
        ("attitudes", mission.num_attitude_steps, MOST_ATTITUDES),
    ):
        if (count := mission.num_controls * per_control) > most:
            yield (
                f"that makes {count:.2g} {what} of a flight; there may be at most {most:,}: shorten it, or "
                "make it coarser"
            )


@relation("chief.inspection_radius_m", "deputy.min_distance_m", "deputy.max_distance_m")
def _body(mission: Mission) -> Iterator[str]:
    """Check that the sphere of inspection points lies inside the least distance of the deputy."""
    chief, deputy = mission.chief, mission.deputy
    if chief.shape != "sphere":  # whose reach is known once it is read: pipeline.flight.world.surface
        return
    if not chief.inspection_radius_m < deputy.max_distance_m:
        yield "the first must be less than the last, or all points lie beyond the deputy (m)"
    if mission.problem.kind == "inspection" and chief.inspection_radius_m > deputy.min_distance_m:
        yield ("the first must be at most the second, or a flight through the chief keeps its limits (m)")


@relation("sensor.min_range_m", "sensor.max_range_m", "deputy.max_distance_m")
def _focus(mission: Mission) -> Iterator[str]:
    """Check that the camera's least range is below its greatest."""
    sensor = mission.sensor
    most = mission.deputy.max_distance_m if sensor.max_range_m is None else sensor.max_range_m
    if sensor.min_range_m > 0.0 and not sensor.min_range_m < most:
        yield f"the first must be less than {most:g}, or nothing is ever in focus (m)"


@relation("sensor.max_range_m", "deputy.min_distance_m", "chief.inspection_radius_m")
def _range(mission: Mission) -> Iterator[str]:
    """Check that the camera's range reaches points of the chief from the deputy's least distance."""
    reach, chief = mission.sensor.max_range_m, mission.chief
    if reach is None or chief.shape != "sphere" or mission.problem.kind != "inspection":
        return
    least = mission.deputy.min_distance_m - chief.inspection_radius_m
    if not reach > least:
        yield f"the first must be more than {least:g}, or no point is ever within range (m)"


@relation("sensor.up", "sensor.boresight")
def _upright(mission: Mission) -> Iterator[str]:
    """Check that what is up in the image is not along the boresight."""
    sensor = mission.sensor
    along = abs(sum(x * y for x, y in zip(sensor.up, sensor.boresight, strict=True)))
    if sensor.rectangle_deg is not None and not along < MOST_ALONG:
        yield (
            f"sensor.up is {list(sensor.up)} and sensor.boresight {list(sensor.boresight)}, along one line; "
            "point the first across the second, for it says how the image is turned"
        )


@relation(
    *("chief.keep_out_m", "deputy.min_distance_m", "deputy.max_distance_m", "safety.kind", "problem.kind")
)
def _booms(mission: Mission) -> Iterator[str]:
    """Check that spheres to stay out of reach beyond the least distance, and are known to the mission."""
    low, high = mission.deputy.min_distance_m, mission.deputy.max_distance_m
    for which, (*centre, radius) in enumerate(mission.chief.keep_out_m):
        if not low < math.hypot(*centre) + radius < high:
            yield (
                f"chief.keep_out_m[{which}] reaches {math.hypot(*centre) + radius:g} m from the chief's "
                "centre; it must be more than the first, or it forbids nothing, and less than the second"
            )
    if mission.chief.keep_out_m and mission.safety.kind != "none":
        yield (
            f"chief.keep_out_m is given, which safety.kind={mission.safety.kind} does not keep; choose "
            "safety=none, or raise deputy.min_distance_m to a sphere about them all"
        )
    if mission.chief.keep_out_m and mission.problem.kind != "inspection":
        yield "chief.keep_out_m is given, which only inspections know; leave it out"


@relation("after_s", "flight", "dynamics.model")
def _after(mission: Mission) -> Iterator[str]:
    """Check that what follows a flight is computed by what flies it."""
    if mission.after_s > 0.0 and (mission.flight, mission.dynamics.model) == ("reference", "two_body"):
        yield "the reference coasts on by Clohessy and Wiltshire's equations alone; change one of them"


@relation("fleet.deputies", "problem.kind", "flight", "guidance.engine", "after_s")
def _fleet(mission: Mission) -> Iterator[str]:
    """Check that what else the mission asks for knows of several deputies."""
    if not mission.has_fleet:
        return
    for key, value in (("problem.kind", "reach"), ("flight", "reference"), ("guidance.engine", "sklearn")):
        if setting(mission, key) == value:
            yield f"{key}={value} knows of one deputy; change one of them"
    if mission.dispersions:
        yield "dispersions are given, which are of one deputy; leave one of them out"
    if mission.after_s > 0.0:
        yield "what follows a flight is asked of one deputy alone; leave one of them out"


@relation(
    *("fleet.keep_apart_m", "safety.kind", "safety.probability", "navigation.mode", "actuators.kind"),
    *("dynamics.model", "orbit.course"),
)
def _apart(mission: Mission) -> Iterator[str]:
    """Check that deputies are kept apart by the safety layer, with margins where anything is inexact."""
    if not mission.fleet.keep_apart_m > 0.0:
        return
    if mission.safety.kind != "filter":
        yield "it is the safety layer that keeps deputies apart; add safety=filter, or safety=robust"
    if mission.has_true_course:
        yield "deputies are kept apart by the mean motion alone; leave out orbit.course=true"
    for key, exact in (("navigation.mode", "perfect"), ("actuators.kind", "ideal"), ("dynamics.model", "cw")):
        if setting(mission, key) != exact and mission.safety.probability is None:
            yield (
                f"{key} is {setting(mission, key)}, and without margins for errors deputies are kept apart "
                f"only with {exact}; change one of them, or choose safety=robust"
            )


@relation(
    *("safety.keep_way_out", "safety.probability", "navigation.mode", "actuators.kind"),
    *("dynamics.model", "orbit.course", "fleet.keep_apart_m"),
)
def _way_out(mission: Mission) -> Iterator[str]:
    """Check that where a way out without thrust is kept, motion and forces are those that it counts with."""
    if mission.safety.kind != "filter" or not mission.safety.keep_way_out:
        return
    astray = 6.0 * math.pi / mission.orbit.mean_motion_rad_s * 0.001
    for key, exact in (("navigation.mode", "perfect"), ("actuators.kind", "ideal"), ("dynamics.model", "cw")):
        if (value := setting(mission, key)) != exact:
            yield (
                "safety.keep_way_out=true is kept only where nothing is inexact, as an error of 1 mm/s leads "
                f"{astray:.2g} m astray in an orbit, and {key} is {value}; choose {exact}, or leave it out"
            )
    if mission.has_true_course or mission.dispersions or mission.safety.probability is not None:
        yield (
            "safety.keep_way_out=true counts with a circle and exact settings; leave out orbit.course=true, "
            "dispersions and safety.probability, or safety.keep_way_out"
        )
    if mission.fleet.keep_apart_m > 0.0:
        yield "safety.keep_way_out=true knows of no other deputies; leave one of them out"


@relation("safety.min_sun_angle_deg", "fleet.keep_apart_m")
def _cone(mission: Mission) -> Iterator[str]:
    """Check that deputies that are kept apart are not to keep out of the Sun's cone as well."""
    safety = mission.safety
    if safety.kind == "filter" and safety.min_sun_angle_deg > 0.0 and mission.fleet.keep_apart_m > 0.0:
        yield "what keeps deputies apart knows of no cone about the Sun; leave one of them out"


@relation("safety.delta_v_limit_m_s", "safety.keep_way_out")
def _delta_v(mission: Mission) -> Iterator[str]:
    """Check that where the delta-v is limited, flights have an end that costs nothing more."""
    safety = mission.safety
    if safety.kind == "filter" and safety.delta_v_limit_m_s > 0.0 and not safety.keep_way_out:
        yield (
            "a deputy that has stopped is held in place by thrust for ever, so that no limit lasts; only on "
            "a closed ellipse it needs none: add safety.keep_way_out=true, or leave the limit out"
        )


@relation("deputy.max_momentum_n_m_s", "deputy.inertia_kg_m2", "orbit.mean_motion_rad_s")
def _wheels(mission: Mission) -> Iterator[str]:
    """Check that the deputy's wheels can take up the rotation of Hill axes, about any axis."""
    most = mission.deputy.max_momentum_n_m_s
    needed = mission.fastest_turn_rad_s * max(math.hypot(*row) for row in mission.deputy.inertia_kg_m2)
    if mission.attitude.mode == "flown" and most is not None and not most >= needed:
        yield f"to turn with the orbit takes {needed:.3g} N m s; raise the first, or lower another"


@relation("attitude.proportional_gain", "attitude.derivative_gain", "attitude_period_s")
def _gains(mission: Mission) -> Iterator[str]:
    """Check that the sampled attitude law is stable."""
    attitude, period = mission.attitude, mission.attitude_period_s
    damping = attitude.derivative_gain * period
    # for an error of half a turn the rate is the ratio of the gains, rad/s
    turned = attitude.proportional_gain / attitude.derivative_gain * period
    # a torque held over a period turns a rate w into (1 - damping) w
    if attitude.mode == "flown" and not damping < 2.0:
        yield (
            f"the product of the last two is {damping:g}; it must be less than 2, or every period turns an "
            f"error in rate into one {abs(1.0 - damping):.3g} times as great: lower one of them"
        )
    if attitude.mode == "flown" and not turned < 2.0:
        yield (
            f"with these the deputy turns by {turned:.3g} rad in a period; it must be less than 2, for the "
            "law acts once a period: lower the first or the last, or raise the second"
        )


@relation("deputy.max_force_n", "deputy.mass_kg", "orbit.mean_motion_rad_s", "deputy.min_distance_m")
def _holding(mission: Mission) -> Iterator[str]:
    """Check that the thrusters can hold the deputy above the chief at its least distance."""
    deputy = mission.deputy
    needed = mission.greatest_tide_per_s2 * deputy.mass_kg * deputy.min_distance_m
    if not deputy.max_force_n >= needed:
        yield f"to stand still above the chief there takes {needed:.3g} N; raise the force, or lower another"


@relation("deputy.max_force_n", "deputy.mass_kg", "dynamics.drag_m_s2", "dynamics.radiation_m_s2")
def _disturbances(mission: Mission) -> Iterator[str]:
    """Check that the thrusters are stronger than drag, at the perigee's speed, and radiation."""
    eccentricity = mission.orbit.elements.eccentricity
    most = mission.deputy.max_force_n / mission.deputy.mass_kg
    drag, radiation = (setting(mission, f"dynamics.{name}_m_s2") or 0.0 for name in ("drag", "radiation"))
    drag *= (1.0 + eccentricity) / (1.0 - eccentricity)
    if not abs(drag) + abs(radiation) < most:
        yield (
            f"the last two together, at the perigee, are no less than {most:.3g} m/s^2; lower them, "
            "or raise the force"
        )


@relation("actuators.failed_thruster", "actuators.thrusters")
def _failure(mission: Mission) -> Iterator[str]:
    """Check that a thruster that fails is one of the layout."""
    failed, thrusters = (setting(mission, f"actuators.{name}") for name in ("failed_thruster", "thrusters"))
    if failed is not None and thrusters is not None and failed >= (count := len(thrusters)):
        yield f"there are {count} thrusters; choose one from 0 to {count - 1}"


@relation("actuators.propellant_kg", "actuators.specific_impulse_s", "deputy.mass_kg", "deputy.max_force_n")
def _propellant(mission: Mission) -> Iterator[str]:
    """Check that the mass exceeds the propellant plus a control period at full thrust."""
    deputy, impulse_s = mission.deputy, setting(mission, "actuators.specific_impulse_s")
    speed = STANDARD_GRAVITY_M_S2 * (impulse_s or math.inf)
    most = deputy.mass_kg - 3.0 * deputy.max_force_n * mission.control_period_s / speed
    if impulse_s is not None and not mission.actuators.propellant_kg < most:
        yield (
            f"a control period may use {deputy.mass_kg - most:.3g} kg, and the first must be less than "
            f"{most:.3g}: lower it, or raise one of the others"
        )


@relation(
    *("safety.keep_out_margin_m", "safety.keep_in_margin_m", "deputy.min_distance_m"),
    *("deputy.max_distance_m", "problem.goal_radius_m"),
)
def _spheres(mission: Mission) -> Iterator[str]:
    """Check that the safety layer's spheres have room between them, and the goal lies beyond the inner."""
    if mission.safety.kind != "filter":
        return
    if not mission.keep_out_m < mission.keep_in_m:
        yield (
            f"the keep-out sphere has a radius of {mission.keep_out_m:g} m and the keep-in sphere "
            f"{mission.keep_in_m:g}; the first must be less than the second (m)"
        )
    if mission.problem.kind == "reach" and mission.problem.goal_radius_m < mission.keep_out_m:
        yield f"the layer keeps the deputy {mission.keep_out_m:g} m away from its goal; choose safety=none"


@relation("deputy.max_force_n", "deputy.mass_kg", "orbit.mean_motion_rad_s", "deputy.max_distance_m")
def _braking(mission: Mission) -> Iterator[str]:
    """Check that the safety layer's stops take no more than the thrusters, and hold at the keep-in sphere."""
    safety, deputy = mission.safety, mission.deputy
    if safety.kind != "filter":
        return
    checks.within("safety.braking_force_n", mission.braking_force_n, 0.0, deputy.max_force_n, "N")
    standing = mission.greatest_tide_per_s2 * mission.keep_in_m * deputy.mass_kg
    planned = safety.planned_braking_n if safety.probability is not None else standing
    for name, force in (("braking_force_n", mission.braking_force_n), ("planned_braking_n", planned)):
        if not standing <= force:
            yield (
                f"safety.{name} is {force:g}, but to stand still {mission.keep_in_m:g} m above the chief "
                f"takes {standing:.3g} N; raise it, or lower the distance"
            )


@relation(
    *("safety.speed_limit_m_s", "safety.speed_slope_per_s", "safety.speed_distance_m"),
    *("safety.passive_horizon_s", "safety.keep_in_horizon_s", "control_period_s"),
)
def _speeds(mission: Mission) -> Iterator[str]:
    """Check that the safety layer allows a speed at its keep-out sphere, and looks a bounded time ahead."""
    safety = mission.safety
    if safety.kind != "filter":
        return
    beyond = mission.keep_out_m - safety.speed_distance_m
    slowest = safety.speed_limit_m_s + safety.speed_slope_per_s * beyond
    if not slowest >= 0.0:
        yield (
            f"these allow {slowest:.3g} m/s at the keep-out sphere ({mission.keep_out_m:g} m); it must be at "
            "least 0: raise the first, or lower the second or the third"
        )
    most = MOST_HORIZONS * mission.control_period_s
    for name in ("passive_horizon_s", "keep_in_horizon_s"):
        checks.within(f"safety.{name}", getattr(safety, name), 0.0, most, "s")
