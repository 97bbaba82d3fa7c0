"""Flights with any settings, constants and signals: what Hypothesis draws, within the product's own limits.

A mission begins as a sensible one of its kind. Some of its settings, by turns, then get a value near their
own or anywhere in their whole range, unless the mission would be refused: with all of them anywhere nearly
every mission would be, and in most others nothing would be seen.
"""

from dataclasses import asdict, fields, replace
from math import inf, log10
from typing import Any, Literal, get_args, get_origin

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.flight.control.controller import Controller
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import CONSTANTS, PARKING, SIGNALS
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.settings.checks import SettingError
from pipeline.settings.equipment import FilteredNavigation, RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.groups import variant_of
from pipeline.settings.keys import UNITS, unit_of
from tests.pipeline.flight.cases import controller, leaning_system

#: beyond these a flight takes long, by any means: radians of the orbit, points, attitudes, periods ahead, and
#: radians that torques may turn the deputy by in a period of attitude
MOST_RADIANS, MOST_POINTS, MOST_TICKS, MOST_PERIODS, MOST_TURN = 20.0, 150, 8, 300, 1e4
#: digits of a number near its own value, in powers of ten
NEAR = 0.5


def magnitude(least: float, greatest: float) -> st.SearchStrategy[float]:
    """Numbers of every order of magnitude from the least to the greatest, above zero."""
    return st.floats(log10(least), log10(greatest)).map(lambda power: min(max(10.0**power, least), greatest))


def number(key: str, limits: dict[str, float], value: float | None) -> st.SearchStrategy[float]:
    """A number by its unit and limits, near a value, or anywhere."""
    _, least, most = unit_of(key)
    low, high = limits.get("ge", limits.get("gt", -inf)), limits.get("le", limits.get("lt", inf))
    greatest = min(most, high)
    anywhere = [magnitude(max(least, low), greatest)]
    if low <= 0.0 and "gt" not in limits:
        anywhere.append(st.just(0.0))
    if low < 0.0:
        anywhere.append(magnitude(least, min(most, -low)).map(lambda size: -size))
    if greatest < inf and low > -inf:
        anywhere.append(st.floats(max(low, least if "gt" in limits else low), greatest))
    if value:
        close = st.floats(-NEAR, NEAR).map(lambda power: min(value * 10.0**power, high))
        return st.one_of(close, *anywhere)
    return st.one_of(*anywhere)


def limits_of(annotation: Any, metadata: Any = ()) -> dict[str, float]:
    """The bounds of a setting's type, of which its innermost part is a number."""
    limits: dict[str, float] = {}
    for entry in metadata:
        limits |= limits_of(None, getattr(entry, "metadata", ()))
        limits |= {name: getattr(entry, name) for name in ("gt", "ge", "le", "lt") if hasattr(entry, name)}
    for part in get_args(annotation):
        if get_origin(annotation) is not Literal:
            limits |= limits_of(part, getattr(part, "__metadata__", ()))
    return limits


@st.composite
def setting(draw: Any, kind: Any, name: str, value: Any) -> Any:
    """A value for a setting of a group."""
    tags = kind.root.__pydantic_fields__
    field = tags.get(name, kind.__pydantic_fields__[name])
    simple = {bool: st.booleans(), int: st.integers(1, MOST_POINTS)}
    special = {
        "inertia_kg_m2": inertia(),
        "thrusters": layout(),
        "boresight": direction(3),
        "initial_quaternion": direction(4),
    }
    limits = limits_of(field.annotation, field.metadata)
    strategy = simple.get(field.annotation, special.get(name))
    if get_origin(field.annotation) is Literal:
        strategy = st.sampled_from(get_args(field.annotation))
    if strategy is None and "tuple" in str(field.annotation):
        strategy = st.tuples(*(number(name, limits, part) for part in value or (None,) * 3))
    if strategy is None:
        strategy = number(name, limits, value)
    return draw(st.one_of(st.none(), strategy) if type(None) in get_args(field.annotation) else strategy)


def direction(count: int) -> st.SearchStrategy[tuple[float, ...]]:
    """A unit vector, isotropic."""
    seeds = st.integers(0, 2**32 - 1)
    vectors = seeds.map(lambda seed: np.random.default_rng(seed).standard_normal(count))
    return vectors.map(lambda vector: tuple((vector / np.linalg.norm(vector)).tolist()))


@st.composite
def inertia(draw: Any) -> Any:
    """A rigid body's inertia: moments of masses along its principal axes, turned."""
    size = draw(number("inertia_kg_m2", {"gt": 0.0}, 1.0))
    x, y, z = (draw(st.floats(0.1, 1.0)) for _ in range(3))
    turned = Rotation.from_quat(draw(direction(4))).as_matrix()
    body = size * (turned @ np.diag([y + z, x + z, x + y]) @ turned.T)
    body = np.eye(3) * size if draw(st.booleans()) else 0.5 * (body + body.T)
    return tuple(map(tuple, body.tolist()))


@st.composite
def layout(draw: Any) -> Any:
    """Thrusters here and there, one or more each way."""
    rows = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            leaning = np.array(draw(direction(3))) * 0.3
            leaning[axis] += sign
            position = tuple(draw(st.floats(-0.5, 0.5)) for _ in range(3))
            force = draw(number("max_force_n", {"gt": 0.0}, 0.05))
            rows.append((*position, *(leaning / np.linalg.norm(leaning)).tolist(), force))
    return tuple(rows)


def with_value(group: Any, name: str, value: Any) -> Any:
    """A group of settings with one changed; another variant keeps what it has in common."""
    values = asdict(group) | {name: value}
    names = {field.name for field in fields(variant_of(group.root, values))}
    return group.root(**{key: value for key, value in values.items() if key in names})


@st.composite
def mission(draw: Any, base: Mission, fixed: tuple[str, ...]) -> Mission:
    """A mission like another, but for settings of some groups, and of all but those that are fixed."""
    groups = [
        field.name for field in fields(base) if hasattr(getattr(base, field.name), "__pydantic_fields__")
    ]
    names = [
        (group, field.name)
        for group in groups
        for field in fields(getattr(base, group))
        if not {group, field.name, f"{group}.{field.name}"} & set(fixed)
    ]
    drawn_mission = clocked(draw, base)
    for group, name in draw(st.lists(st.sampled_from(names), max_size=10)):
        old = getattr(drawn_mission, group)
        if not hasattr(old, name):  # another variant was drawn before
            continue
        value = draw(setting(type(old), name, getattr(old, name)))
        try:
            changed = replace(drawn_mission, **{group: with_value(old, name, value)})
        except SettingError:
            continue
        if is_bearable(changed):
            drawn_mission = changed
    return drawn_mission


def clocked(draw: Any, base: Mission) -> Mission:
    """The mission with other clocks, and those of fixes and delays along with them."""
    count, ticks = draw(st.integers(2, 20)), draw(st.integers(1, MOST_TICKS))
    longest = MOST_RADIANS / (2.0 * count * base.orbit.mean_motion_rad_s)
    period = draw(st.one_of(magnitude(1.0, 200.0), magnitude(2.0 * MOST_TICKS * UNITS["_s"].least, longest)))
    clocks = {
        "control_period_s": period,
        "attitude_period_s": period / ticks,
        "duration_s": count * period,
        "safety": replace(base.safety, passive_horizon_s=30 * period, keep_in_horizon_s=45 * period),
    }
    stride, late, slow = (draw(st.integers(least, 2)) * period for least in (1, 0, 0))
    if isinstance(base.navigation, FilteredNavigation):
        clocks["navigation"] = replace(base.navigation, fix_period_s=stride, delay_s=late)
    if isinstance(base.actuators, RealActuators):
        clocks["actuators"] = replace(base.actuators, delay_s=slow)
    try:
        return replace(base, **clocks)
    except SettingError:  # an attitude law too strong for so slow a clock
        return replace(base, **clocks, attitude=replace(base.attitude, mode="ideal"))


def is_bearable(mission: Mission) -> bool:
    """Whether a flight is short enough to be computed by any means, and its margins leave room."""
    if mission.safety.kind == "filter":
        try:
            spheres_of(mission, bounds_of(mission))
        except SettingError:
            return False
    ahead = max(mission.safety.passive_horizon_s, mission.safety.keep_in_horizon_s)
    rate = mission.chief.initial_angular_velocity_rad_s
    turns = np.linalg.norm(rate) * mission.duration_s if rate else 0.0
    deputy = mission.deputy
    arm = mission.actuators.thrust_arm_m if isinstance(mission.actuators, RealActuators) else 0.0
    torque = deputy.max_torque_n_m + 2.0 * arm * deputy.max_force_n
    faster = torque / np.linalg.eigvalsh(deputy.inertia_kg_m2)[0] * mission.duration_s
    return bool(
        mission.orbit.mean_motion_rad_s * (mission.duration_s + ahead) <= MOST_RADIANS
        and ahead <= MOST_PERIODS * mission.control_period_s
        and turns <= MOST_RADIANS
        and faster * mission.attitude_period_s <= MOST_TURN
    )


@st.composite
def flown(draw: Any, mission: Mission) -> Controller:
    """A controller that senses any signals, the push that shows what sets among them, with any constants."""
    axes = draw(st.sampled_from(["hill", "body"]))
    parks = axes == "hill" and not mission.has_true_course and draw(st.booleans())
    names = [name for name, signal in SIGNALS.items() if parks or not signal.needs & PARKING]
    half = np.pi / mission.orbit.mean_motion_rad_s
    systems = []
    for axis, first in zip("xyz", ("see_push_radial", None, None), strict=True):
        sensed = [first] if first else []
        sensed += draw(st.lists(st.sampled_from(names), min_size=1 - len(sensed), max_size=2, unique=True))
        inputs = [(name, SIGNALS[name].unit, width_of(name)) for name in dict.fromkeys(sensed)]
        reach = draw(number("max_force_n", {"gt": 0.0}, 0.02))
        systems.append(leaning_system(f"force_{axis}", reach, *inputs))
    constants = {
        "urgency_time_s": draw(number("urgency_time_s", {"gt": 0.0}, 300.0)),
        "see_damping_ks2": draw(number("see_damping_ks2", {"gt": 0.0}, 0.1)),
        "see_horizon_s": draw(number("see_horizon_s", {"ge": 0.0}, mission.duration_s)),
        "skirt_distance_m": draw(number("skirt_distance_m", {"ge": 0.0}, 60.0)),
        "tour_time_s": half * draw(st.floats(1e-4, 0.999)),
        "tour_wait_s": half * draw(st.floats(0.0, 0.999)),
        "decision_period_s": mission.control_period_s * draw(st.sampled_from([0, 1, 1, 2, 3])),
        "coast_below_points": draw(st.sampled_from([0.0, 0.0, 5.0, 30.0, 60.5, 100.0])),
    }
    if parks:
        constants["park_below_points"] = draw(st.sampled_from([5.0, 30.0, 60.5, 100.0]))
    others = {name: kind for name, kind in CONSTANTS.items() if name not in (*constants, "park_below_points")}
    needed = [name for name, kind in others.items() if kind.needed_for]
    constants |= {name: draw(number(name, {"gt": 0.0}, 300.0)) for name in needed}
    of_rules = [name for name in CONSTANTS if not name.startswith(("rehearsal", "foresight", "park_below"))]
    for name in draw(st.lists(st.sampled_from(of_rules), unique=True)):
        if name not in constants:
            signed = {} if CONSTANTS[name].is_signed else {"ge": 0.0}
            constants[name] = draw(number(name, signed, 30.0 if name.endswith("_m") else 0.05))
    return controller(tuple(systems), axes, **constants)


def width_of(name: str) -> float:
    """A range in which a signal matters."""
    return {"m": 60.0, "m/s": 0.1, "rad": 3.0}.get(SIGNALS[name].unit, 30.0 if name == "missed" else 1.0)


@st.composite
def scenario(draw: Any, mission: Mission, is_tilted: bool) -> Scenario:
    """A start about the limits, and any Sun."""
    deputy = mission.deputy
    distance = draw(magnitude(max(0.8 * deputy.min_distance_m, 1e-3), 1.2 * deputy.max_distance_m))
    if draw(st.booleans()):
        distance = draw(magnitude(max(deputy.min_distance_m, 1.0), max(deputy.min_distance_m, 1.0) * 8.0))
    speed = draw(st.one_of(st.just(0.0), number("speed_m_s", {"gt": 0.0, "le": 1e3}, 0.05)))
    return Scenario(
        distance * np.array(draw(direction(3))),
        speed * np.array(draw(direction(3))),
        draw(st.floats(0.0, 2.0 * np.pi)),
        draw(st.floats(-1.5, 1.5).filter(lambda elevation: elevation != 0.0)) if is_tilted else 0.0,
        (draw(st.integers(0, 2**31)), 0, draw(st.integers(0, 1000))),
    )
