"""What a controller may sense, set and command: one table each, looked up by name everywhere.

An input of a fuzzy system is named after the signal that it senses, its output after the force component
that it commands; the controller's attribute ``force_axes`` says whether components are along the deputy's
body axes or Hill's. Flights (`pipeline.flight.period`) keep signals and constants in
arrays; `slot` and `constant` give the indices there.
"""

from dataclasses import dataclass
from functools import partial

#: what must be computed before a signal can be read: flags, combined over all that a controller senses
NOTHING, ANGLES, ORBIT, APPROACH, PREVIEW, URGENCY, SETTING, TOUR = 0, 1, 2, 4, 8, 16, 32, 64
PARKING = 128


@dataclass(frozen=True)
class Signal:
    """A quantity that a controller may sense."""

    unit: str  # empty if dimensionless
    description: str
    # what must be computed for it: `NOTHING` beyond what every flight computes, the relative `ANGLES`, free
    # motion, target and Sun (`ORBIT`), the closest `APPROACH`, the `PREVIEW` of coasting, `URGENCY`, the push
    # that shows `SETTING` points, or the one that leads onto the `TOUR` or, for good, to a `PARKING` ellipse
    needs: int
    formula: str = ""  # in the symbols of docs/reference/signals.md; empty where the description is enough


#: names of Hill's axes, and what is along them in words
HILL_AXES = {"radial": "along i", "along_track": "along j", "cross_track": "along k"}


def _along_axes(name: str, unit: str, description: str, needs: int, *formulas: str) -> dict[str, Signal]:
    """Return a signal for each of Hill's axes, with the axis in its name and its description."""
    padded = (*formulas, "", "", "")[: len(HILL_AXES)]
    return {
        f"{name}_{axis}": Signal(unit, description.format(along), needs, formula)
        for (axis, along), formula in zip(HILL_AXES.items(), padded, strict=True)
    }


SIGNALS = {
    "distance": Signal("m", "distance from the chief's centre", NOTHING, "√(x² + y² + z²)"),
    "velocity_body_x": Signal(
        "m/s",
        "velocity relative to Hill along the deputy's x axis; the camera looks along -x",
        NOTHING,
        "C (x', y', z')",
    ),
    "velocity_body_y": Signal("m/s", "velocity relative to Hill along the deputy's y axis", NOTHING),
    "velocity_body_z": Signal("m/s", "velocity relative to Hill along the deputy's z axis", NOTHING),
    "lambda_u": Signal(
        "rad", "angle from the deputy to the target in the i-j (orbit) plane, from -pi to pi", ANGLES
    ),
    "eta_u": Signal("rad", "angle from the deputy to the target in the i-k plane, from -pi to pi", ANGLES),
    "position_radial": Signal("m", "position along Hill i, away from the Earth", NOTHING, "x"),
    "position_along_track": Signal("m", "position along Hill j, the way the chief flies", NOTHING, "y"),
    "position_cross_track": Signal("m", "position along Hill k, the orbit normal", NOTHING, "z"),
    **_along_axes("velocity", "m/s", "velocity relative to Hill {}", NOTHING, "x'", "y'", "z'"),
    "centre_radial": Signal(
        "m",
        "centre of the ellipse of free motion along i; above zero the ellipse falls behind",
        ORBIT,
        "x_c = 4x + 2y'/n",
    ),
    "centre_along_track": Signal(
        "m", "centre of the ellipse of free motion along j", ORBIT, "y_c = y - 2x'/n"
    ),
    "predicted_centre_along_track": Signal(
        "m",
        "where the centre of the ellipse of free motion drifts to within prediction_time_s, along j",
        ORBIT,
        "y_c - 1.5 n x_c prediction_time_s",
    ),
    "closest_approach": Signal(
        "m",
        "least distance to the chief within an orbit of free drift from here",
        APPROACH,
        "least √(x² + y² + z²)",
    ),
    "ring_error_radial": Signal(
        "m",
        "along i, from the place on a ring of free motion that follows the Sun to the deputy's place",
        ORBIT,
        "(x - x_c) - ring_size_m cos(θ - ring_lead_rad)",
    ),
    "ring_error_along_track": Signal(
        "m",
        "along j, from the place on a ring of free motion that follows the Sun to the deputy's place, halved",
        ORBIT,
        "(y - y_c)/2 - ring_size_m sin(θ - ring_lead_rad)",
    ),
    **_along_axes(
        *("target", "", "direction of the target {}, from -1 to 1; zero without candidates", ORBIT),
        *("p_x", "p_y", "p_z"),
    ),
    "sun_alignment": Signal(
        "",
        "cosine of the angle from the deputy to the Sun in the orbit plane; 1 with the Sun behind the deputy",
        ORBIT,
    ),
    "sun_ahead": Signal(
        "",
        "sine of the angle from the deputy to the Sun in the orbit plane; above zero it has yet to come",
        ORBIT,
    ),
    "target_setting": Signal(
        "",
        "direction of the target across the Sun's, in the orbit plane; above zero where it soon goes dark",
        ORBIT,
        "-p_x sin θ + p_y cos θ",
    ),
    "missed": Signal("", "how many points coasting to the flight's end would leave unseen", PREVIEW),
    "coasting_nearest": Signal(
        "m", "least distance from the chief while coasting to the flight's end", PREVIEW
    ),
    "coasting_farthest": Signal(
        "m", "greatest distance from the chief while coasting to the flight's end", PREVIEW
    ),
    **_along_axes(
        "urgent",
        "",
        "direction {}, from -1 to 1, of what is lit and unseen, most of all what is soon dark for good",
        URGENCY,
        "unit vector of Σ p_i exp(-T_i/urgency_time_s), T_i the time until point i sets",
    ),
    **_along_axes(
        "see_push",
        "m/s",
        "push {} that would still show what coasting misses and is soon dark for good",
        SETTING,
    ),
    **_along_axes(
        "aim",
        "m/s",
        "push {} that would still show what is soon dark for good, "
        "plus a bias towards lit, unseen points, weighted by how soon they go dark",
        SETTING | URGENCY,
        "see_push_radial + aim_urgent_m_s urgent_radial",
    ),
    **_along_axes(
        "tour_push",
        "m/s",
        "push {} that leads in tour_time_s to where the tour, "
        "shifted towards lit, unseen points that soon go dark, is then",
        TOUR | URGENCY,
    ),
    **_along_axes(
        "park_push",
        "m/s",
        "cheapest push {} onto a closed ellipse of free motion that stays inside the limits and shows "
        "enough; zero where there is none, or where none is needed",
        PARKING,
    ),
}


def slot(*names: str) -> int:
    """Return the index of a signal in the arrays of a flight, or of the first of consecutive ones.

    Raises
    ------
    ValueError
        If the signals are not consecutive in `SIGNALS`.
    """
    order = list(SIGNALS)
    first = order.index(names[0])
    if tuple(order[first : first + len(names)]) != names:
        raise ValueError(f"{', '.join(names)} do not follow one another in SIGNALS; put their rows together")
    return first


@dataclass(frozen=True)
class ControllerConstant:
    """A number that a controller may set besides its systems, as an attribute."""

    description: str  # with its unit
    is_signed: bool = False
    is_tuned: bool = True  # whether evolution may tune it: no count of control periods, no choice
    needed_for: int = NOTHING  # flags of the signals that are not defined where it is zero
    such_as: str = ""  # a value to begin with, of one that is needed
    default: float = 0.0  # where not set
    beside: str = ""  # of one with a default, the constant without which it changes nothing


#: a constant that evolution leaves as it is
Chosen = partial(ControllerConstant, is_tuned=False)

#: components of the tour: along Hill axes, and the lift, added to the last times the sine of the elevation
TOUR_PARTS = HILL_AXES | {"lift": "along k, by the sine of the Sun's elevation"}
#: terms of each component: a mean and waves, by their number in a turn of the Sun
TOUR_WAVES = ("mean", "cos_1", "sin_1", "cos_2", "sin_2")

TOUR_COEFFICIENTS = {
    f"tour_{part}_{wave}_m": ControllerConstant(
        f"the tour {axis}: {wave} of the Sun's angle, m", is_signed=True
    )
    for part, axis in TOUR_PARTS.items()
    for wave in TOUR_WAVES
}

CONSTANTS = {
    "ring_size_m": ControllerConstant(
        "height of the ring that ring_error_* refer to; it is twice as long, m"
    ),
    "ring_lead_rad": ControllerConstant(
        "how far the Sun is ahead of the deputy's place on the ring, rad", is_signed=True
    ),
    "dead_band_force_x_n": ControllerConstant("a force_x smaller than this is not fired, N"),
    "dead_band_force_y_n": ControllerConstant("the same for force_y"),
    "dead_band_force_z_n": ControllerConstant("the same for force_z"),
    "prediction_time_s": ControllerConstant("how far ahead predicted_centre_along_track looks, s"),
    "coast_below_points": ControllerConstant(
        "coast if coasting to the end would miss fewer points than this"
    ),
    "coast_margin_m": ControllerConstant("coast only if that stays this far inside the distance limits, m"),
    "decision_period_s": Chosen(
        "time from one decision to the next, whole control periods; a force lasts one of these, s"
    ),
    "urgency_time_s": ControllerConstant(
        "time before its last light within which a point becomes urgent, s",
        needed_for=URGENCY | SETTING,
        such_as="200",
    ),
    "skirt_distance_m": ControllerConstant(
        "nearer than this to the chief, urgent_*, see_push_* and tour_push_* turn aside, m"
    ),
    "see_horizon_s": ControllerConstant("see_push_* shows points that go dark for good within this time, s"),
    "see_damping_ks2": ControllerConstant(
        "weight that keeps see_push_* small, beside squared times to the look, 1e6 s^2",
        needed_for=SETTING,
        such_as="0.1",
    ),
    "aim_urgent_m_s": ControllerConstant("speed that urgent_* adds to see_push_* in aim_*, m/s"),
    "rehearsal_reach_m_s": Chosen(
        "largest radial part of the simulated first pushes, of which the one that ends cheapest is fired, m/s"
    ),
    "rehearsal_point_m_s": Chosen(
        "price of a missed point in simulated flights; 0.15 unless given, m/s",
        default=0.15,
        beside="foresight_pushes",
    ),
    "tour_time_s": ControllerConstant(
        "tour_push_* leads to where the tour is after this time, less than half an orbit, s",
        needed_for=TOUR,
        such_as="500",
    ),
    "tour_wait_s": ControllerConstant(
        "longest wait for light where it is dark then, less than half an orbit, s"
    ),
    "tour_lean_m": ControllerConstant("how far the tour leans towards what is urgent, m"),
    **TOUR_COEFFICIENTS,
    "rehearsal_tours": Chosen(
        "how many of the tour's images are simulated, 2 or 4; the one that ends cheapest is followed"
    ),
    "rehearsal_slowest_s": Chosen(
        "each image is simulated with three times, from tour_time_s to this, less than half an orbit, s"
    ),
    "rehearsal_smallest": Chosen("each image is simulated in two sizes, its own and this share of it"),
    "rehearsal_shapes": Chosen(
        "how many more tours, drawn around the controller's own, are simulated in the same way"
    ),
    "rehearsal_spread_m": Chosen("standard deviation of their constants about the controller's own, m"),
    "rehearsal_draws": Chosen(
        "how many flights with random errors are simulated, each of the tour that is cheapest so far"
    ),
    "rehearsal_period_s": Chosen("time after which the tours are simulated again, whole decision periods, s"),
    "park_below_points": Chosen(
        "park once that would miss fewer points than this: push onto a closed ellipse inside the limits",
        needed_for=PARKING,
        such_as="4.5",
    ),
    "park_reach_m_s": Chosen(
        "largest radial part of a push that parks; 0.08 unless given, m/s",
        default=0.08,
        beside="park_below_points",
    ),
    "park_before_s": Chosen("in so long before the flight's end park whatever that would miss, s"),
    "foresight_pushes": Chosen("how many pushes are planned together by geometry, and fired: 2 or 3"),
    "foresight_points": Chosen("a plan must miss fewer points than this; as coast_below_points unless given"),
    "foresight_coast_points": Chosen(
        "after a plan, coast if that would miss fewer points than this; as coast_below_points unless given"
    ),
    "see_near_m": Chosen(
        "from nearer than this a look of see_push_* falls short by see_short_m at least; 30 unless given, m",
        default=30.0,
        beside="see_horizon_s",
    ),
    "see_short_m": Chosen(
        "what a look that is not certain to show a point falls short by at least; 1 unless given, m",
        default=1.0,
        beside="see_horizon_s",
    ),
    "foresight_reach_m_s": Chosen(
        "largest component of a push that is planned; 0.2 unless given, m/s",
        default=0.2,
        beside="foresight_pushes",
    ),
    "foresight_period_s": Chosen(
        "time after which a flight that can deviate from its plan is planned again, whole decision periods, s"
    ),
    "foresight_after_s": Chosen(
        "how long a plan must lead within the distance limits after the flight's end, if nothing is fired, s"
    ),
    "foresight_passive_s": Chosen(
        "how long a failure of all thrusters after any push of a plan must not lead to the chief, s"
    ),
    "foresight_bare": Chosen(
        "not 0: plans are made as on board, with the camera aimed at the chief, and flown ahead only where "
        "errors make them anew; nothing else competes with them"
    ),
    "foresight_searches": Chosen(
        "how many searches a flight's first plan is the cheapest of; unless given as many as "
        "foresight_pushes, with foresight_bare for each 30 s of the decision period, 1 of a fleet"
    ),
    "foresight_doubt_m_s": Chosen(
        "price of a metre by which errors may lead nearer to the chief after a push; 0.003 unless given, m/s",
        default=0.003,
        beside="foresight_pushes",
    ),
}


def constant(name: str) -> int:
    """Return the index of a constant among a controller's constants."""
    return list(CONSTANTS).index(name)


#: components that a system may command, and their axes
AXES = {"force_x": 0, "force_y": 1, "force_z": 2}
HILL, BODY = 0, 1
FORCE_AXES = {"hill": HILL, "body": BODY}

#: a component smaller than this is not fired: the first of three, in the order of `AXES`
FIRST_DEAD_BAND = constant("dead_band_force_x_n")
