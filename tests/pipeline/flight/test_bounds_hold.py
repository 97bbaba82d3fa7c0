"""The bounds and premises of the safety layer's proof hold against the laws that fly, for any settings.

Every setting of a group is drawn from its type, so that one that somebody adds is drawn, too: a bound that
does not know it fails here, unless a premise refuses it. No formula of a bound is repeated. What chance
decides is counted: how often a bound of a probability is left, against the binomial distribution.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from fis_tools.compiled.three import Three
from pipeline.evaluation.assurance import proofs
from pipeline.flight.cases.actuators import thrust_errors, thrusters_of
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.period.act.safety import most_exceeded
from pipeline.flight.reference import actuators as law
from pipeline.flight.reference import navigation, period, two_body
from pipeline.flight.reference.errors import DrawnErrors
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.motion import pushed
from pipeline.flight.reference.safety import STANDING, SafetyLayer
from pipeline.flight.state.log import Scenario
from pipeline.flight.world import bounds, estimates, thrust_bounds
from pipeline.flight.world.bounds import SafetyBounds
from pipeline.flight.world.estimates import EstimateErrors
from pipeline.flight.world.pack import pack_world
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Mission
from tests.pipeline.flight.cases import mission
from tests.pipeline.flight.departures import ASKEW
from tests.pipeline.flight.drawn import magnitude, setting, with_value

pytestmark = pytest.mark.slow

PERIOD, COUNT = 10.0, 12
#: an estimate that is exact
EXACT = EstimateErrors(np.zeros((1, 6, 6)), np.zeros((1, 6, 3)))
#: with a tenth of flights beyond a bound at most
RISK = 0.1
SAFE = {"kind": "filter", "probability": 1.0 - RISK}
CLOCK = {"control_period_s": PERIOD, "duration_s": COUNT * PERIOD}
THRUSTERS = mission(actuators={"kind": "real"}, safety=SAFE, **CLOCK)
BOLTED = mission(actuators={"kind": "real", "thrusters": ASKEW}, safety=SAFE, **CLOCK)
FIXES = mission(navigation={"mode": "fixes"}, safety=SAFE, **CLOCK)
GUARDED = mission(safety={"kind": "filter"}, **CLOCK)
MOVED = mission(dynamics={"model": "two_body"}, safety=SAFE, **CLOCK)
SEEDS = st.integers(0, 2**31 - 1)
#: by which a group has errors at all
SWITCHES = ("kind", "mode", "model")


def examples(count: int) -> Callable[[Any], Any]:
    return settings(
        max_examples=count,
        deadline=None,
        derandomize=True,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )


@st.composite
def varied(draw: Any, base: Mission, group: str, *apart: str) -> Mission:
    """A mission like another, but for some settings of a group; those apart have a test of their own."""
    drawn = base
    for _ in range(draw(st.integers(1, 4))):
        old = getattr(drawn, group)
        names = [field.name for field in fields(old) if field.name not in (*SWITCHES, *apart)]
        name = draw(st.sampled_from(names))
        value = draw(setting(type(old), name, getattr(old, name)))
        if name.endswith("_n_s") and value is not None and draw(st.booleans()):
            # about the impulse of a control period, where it matters
            value = base.deputy.max_force_n * PERIOD * draw(magnitude(1e-4, 1.0))
        elif name.endswith("_s") and draw(st.booleans()):  # some must be multiples
            value = PERIOD * draw(st.integers(0, 3))
        try:
            drawn = replace(drawn, **{group: with_value(old, name, value)})
        except SettingError:
            continue
    return drawn


def thrusters(*apart: str) -> st.SearchStrategy[Mission]:
    """Missions with thrusters along the axes, or a layout of them."""
    return st.sampled_from([THRUSTERS, BOLTED]).flatmap(lambda base: varied(base, "actuators", *apart))


def is_covered(drawn: Mission) -> bool:
    """Whether no premise refuses the settings themselves, whatever they come to."""
    failing, _ = proofs.premises(drawn, SafetyBounds())
    return not failing


def starts(count: int, seed: int) -> list[Scenario]:
    return [Scenario(np.array([0.0, 190.0, 0.0]), np.zeros(3), 0.0, 0.0, (seed, 1, k)) for k in range(count)]


def assert_rare(num_beyond: int, count: int, risk: float = RISK) -> None:
    """Check that so many of some flights beyond a bound do not speak against its probability."""
    assert num_beyond <= binom.isf(1e-9, count, risk), (num_beyond, count)


def held(drawn: Mission, errors: np.ndarray, seed: int) -> ReferenceFlight:
    """A flight whose thrusters have a linear error."""
    none = np.zeros((0, 3))
    errors = DrawnErrors(matrices=errors[np.newaxis], table=thrusters_of(drawn).table)
    return ReferenceFlight(drawn, coast(), starts(1, seed)[0], none, none, np.zeros((0, 3, 3)), errors)


def longest(drawn: Mission, towards: np.ndarray, share: float) -> float:
    """The longest command along a direction that the thrusters give in spite of their errors, a premise."""
    limit = drawn.deputy.max_force_n
    if drawn.actuators.thrusters is None:
        return float(limit / (np.abs(towards).max() + share))
    return min(limit, thrust_bounds.capacity_of(drawn.actuators.thrusters).least_force_n)


def the_errors(drawn: Mission, share: float, seed: int) -> np.ndarray:
    """The first of the product's linear errors of thrusters that are inside a share."""
    matrices = thrust_errors(drawn, starts(40, seed)).matrices[:, 0]
    inside = [each for each in matrices if np.linalg.norm(each - np.eye(3), 2) <= share]
    assert inside
    return inside[0]


SCALE_AND_TURN = "scale_error", "misalignment_deg"


@examples(250)
@given(thrusters(*SCALE_AND_TURN), SEEDS)
def test_thrusters_fire_within_the_bound(drawn: Mission, seed: int) -> None:
    """Commands of every size, up to what thrusters or a layout give in any direction."""
    assume(is_covered(drawn))
    allowed = bounds.error_bounds(drawn, EXACT)
    flight = held(drawn, the_errors(drawn, allowed.share, seed), seed)
    generator = np.random.default_rng(seed)
    for part in np.r_[0.0, np.geomspace(1e-3, 1.0, 25) * (1.0 - 1e-9)]:
        towards = generator.normal(size=3)
        towards /= np.linalg.norm(towards)
        command = part * longest(drawn, towards, allowed.share) * towards
        attitude = Rotation.random(random_state=generator)
        fired = law.fired(flight, 0, command, [command], attitude, drawn.deputy.mass_kg)
        off = np.linalg.norm(fired.fired - command) if fired.share == 1.0 else 0.0  # or the tank is empty
        assert off <= allowed.share * np.linalg.norm(command) + allowed.force_n + 1e-12


@examples(6)
@given(thrusters(), SEEDS)
def test_linear_errors_of_thrusters_are_within_the_share(drawn: Mission, seed: int) -> None:
    assume(is_covered(drawn))
    share = bounds.error_bounds(drawn, EXACT).share
    errors = thrust_errors(drawn, starts(300, seed)).matrices[:, 0] - np.eye(3)
    assert_rare(np.count_nonzero(np.linalg.norm(errors, 2, axis=(1, 2)) > share), len(errors))


@examples(150)
@given(thrusters(*SCALE_AND_TURN, "specific_impulse_s", "propellant_kg"), magnitude(1e-3, 0.5), SEEDS)
def test_a_tank_that_just_holds_the_bound_is_never_empty(drawn: Mission, part: float, seed: int) -> None:
    """Nor does what is fired count for more than allowed, as the mass falls; `part` of it is propellant."""
    actuators = drawn.actuators
    assume(is_covered(drawn))
    share, _ = thrust_bounds.of_fired(actuators, PERIOD, 1.0 - RISK, 0.0)
    generator = np.random.default_rng(seed)
    towards = np.ones(3) if generator.uniform() < 0.5 else generator.normal(size=3)
    towards /= np.linalg.norm(towards)
    length = longest(drawn, towards, share) * (1.0 - 1e-9)
    full, tank = drawn.deputy.mass_kg, part * drawn.deputy.mass_kg
    unit = replace(actuators, specific_impulse_s=1.0, propellant_kg=tank)
    impulse = thrust_bounds.propellant(unit, share, length, PERIOD, COUNT) / tank
    try:
        drawn = replace(drawn, actuators=replace(unit, specific_impulse_s=impulse))
    except SettingError:  # a period of full thrust would take more than there is
        assume(False)
    allowed = bounds.error_bounds(drawn, EXACT, tank / (full - tank))
    flight = held(drawn, the_errors(drawn, share, seed), seed)
    commands, mass = [], full
    for k in range(COUNT):
        commands.append(length * towards)
        attitude = Rotation.identity() if generator.uniform() < 0.5 else Rotation.random(random_state=seed)
        thrust = law.fired(flight, k, commands[-1], commands, attitude, mass)
        assert thrust.share == 1.0
        after = law.mass_after(flight, thrust, mass)
        off = np.linalg.norm(thrust.fired * full / (0.5 * (mass + after)) - commands[-1])
        assert off <= allowed.share * length + allowed.force_n + 1e-12
        mass = after


@examples(40)
@given(varied(FIXES, "navigation", "gate_sigma"), SEEDS)
def test_forces_turn_with_the_sensed_attitude_within_the_bound(drawn: Mission, seed: int) -> None:
    """The greatest commands, as they are meant by a body that is sensed askew."""
    assume(is_covered(drawn))
    allowed = bounds.error_bounds(drawn, estimates.estimate_errors(drawn))
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3) * drawn.deputy.max_force_n
    scenarios, num_beyond = starts(30, seed), 0
    for errors in errors_of(drawn, scenarios).of_attitude:
        flight = replace(held(drawn, np.eye(3), seed), errors=DrawnErrors(of_attitude=errors))
        off = 0.0
        for k, command in enumerate(np.resize(corners, (COUNT, 3))):
            attitude = Rotation.random(random_state=seed + k)
            state = SimpleNamespace(commands=[], belief=SimpleNamespace(acting=np.zeros((COUNT, 3))))
            seen = SimpleNamespace(attitude=attitude, sensed=attitude * flight.tilt(k))
            period.remember_command(flight, k, state, seen, command)
            off = max(off, np.linalg.norm(state.commands[0] - command))
        num_beyond += off > allowed.share * np.linalg.norm(corners[0]) + allowed.force_n + 1e-12
    assert_rare(num_beyond, len(scenarios))


@examples(60)
@given(varied(FIXES, "navigation", "gate_sigma"), SEEDS)
def test_estimates_are_within_the_bound(drawn: Mission, seed: int) -> None:
    """Of a deputy that stands far from the chief; that no good fix is left out is assumed."""
    drawn = replace(drawn, navigation=replace(drawn.navigation, gate_sigma=None))
    assume(is_covered(drawn))
    allowed = bounds.error_bounds(drawn, estimates.estimate_errors(drawn))
    count, num_beyond = 12, 0
    for scenario in starts(count, seed):
        flight = reference_of(replace(drawn, safety=GUARDED.safety), coast(), scenario)
        truth = np.r_[scenario.position_m, scenario.velocity_m_s]
        belief, off = navigation.first_belief(flight, truth), np.zeros(2)
        for k in range(COUNT + 1):
            attitude = Rotation.random(random_state=scenario.generator(9).integers(2**31) + k)
            measured = navigation.fix(flight, k, truth[:3], attitude)
            known, _ = navigation.estimate(flight, k, belief, measured, attitude * flight.tilt(k))
            off = np.maximum(off, np.linalg.norm((known - truth).reshape(2, 3), axis=1))
            truth = pushed(drawn, truth, np.zeros(3), PERIOD)
        num_beyond += bool(np.any(off > (allowed.position_m, allowed.speed_m_s)))
    assert_rare(num_beyond, count)


@st.composite
def moved(draw: Any) -> Mission:
    """A mission about the Earth with any orbit and any forces beside it."""
    drawn = draw(varied(MOVED, draw(st.sampled_from(["dynamics", "orbit", "deputy"]))))
    return draw(varied(drawn, draw(st.sampled_from(["dynamics", "orbit"]))))


@examples(80)
@given(moved(), SEEDS)
def test_what_motion_neglects_is_within_the_bound(drawn: Mission, seed: int) -> None:
    """The change of speed in a second, against that of linear motion; states up to the limits."""
    second = replace(drawn, control_period_s=1.0, attitude_period_s=1.0, duration_s=2.0)
    allowed, generator = estimates.unknown_acceleration(drawn), np.random.default_rng(seed)
    flight = reference_of(replace(second, safety=GUARDED.safety), coast(), starts(1, seed)[0])
    deputy = drawn.deputy
    fastest = np.sqrt(3.0) * deputy.max_force_n * PERIOD / deputy.mass_kg
    assume(fastest < 0.01 * deputy.max_distance_m)  # or it leaves the limits within the second
    for _ in range(4):
        position, velocity, sun = generator.normal(size=(3, 3))
        position *= deputy.max_distance_m / np.linalg.norm(position)
        velocity *= fastest / np.linalg.norm(velocity)
        state, sun = np.r_[position, velocity], sun / np.linalg.norm(sun)
        true = two_body.moved(flight.earth, second, flight.orbit[0], sun, state, np.zeros(3), 0.0)
        linear = pushed(second, state, np.zeros(3), 1.0)
        off = np.linalg.norm(true[3:] - linear[3:])
        assert off <= allowed * (1.0 + 1e-2) + 1e-9


def motion_by_expm(drawn: Mission, time_s: float) -> np.ndarray:
    """Phi of Clohessy and Wiltshire's equations."""
    n, rates = drawn.orbit.mean_motion_rad_s, np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n**2, 2.0 * n, -2.0 * n, -(n**2)
    return expm(rates * time_s)


@st.composite
def guarded(draw: Any) -> Mission:
    drawn = draw(varied(GUARDED, draw(st.sampled_from(["safety", "deputy", "orbit"])), "probability"))
    return draw(varied(drawn, "safety", "probability"))


def layer_of(drawn: Mission) -> Any:
    """The world of the compiled layer; none of limits without room or of too long a look ahead."""
    horizon = max(drawn.safety.passive_horizon_s, drawn.safety.keep_in_horizon_s)
    assume(horizon <= 100 * PERIOD and drawn.orbit.mean_motion_rad_s * horizon < 20.0)
    assume(drawn.safety.kind == "filter")
    try:
        return pack_world(drawn)
    except SettingError:
        assume(False)


@examples(120)
@given(guarded(), st.floats(0.0, 1.0), st.floats(0.0, 1.0), magnitude(1e-4, 1.0), SEEDS)
def test_a_shell_that_is_told_safe_has_no_unsafe_state(
    drawn: Mission, a: float, b: float, c: float, seed: int
) -> None:
    guard, generator = layer_of(drawn).guard, np.random.default_rng(seed)
    room = guard.keep_in - guard.keep_out
    near, far = (guard.keep_out + room * part for part in (0.5 * min(a, b), 0.5 + 0.5 * max(a, b)))
    speed = c * (guard.speed_at_chief + guard.speed_slope * near)
    assume(speed > 0.0 and proofs.are_safe(guard, near, far, speed))
    layer = SafetyLayer(drawn)
    for distance in np.r_[near, far, generator.uniform(near, far, 20)]:
        position, velocity = generator.normal(size=(2, 3))
        state = np.r_[
            position * distance / np.linalg.norm(position), velocity * speed / np.linalg.norm(velocity)
        ]
        assert layer.excesses(state, STANDING).max() <= 1e-6 * far


@examples(80)
@given(guarded(), SEEDS)
def test_what_the_layer_finds_safe_stays_safe_while_it_drifts(drawn: Mission, seed: int) -> None:
    """As long as the settings ask for, by the equations themselves; and so do its stop and its speed."""
    world, generator, safety = layer_of(drawn), np.random.default_rng(seed), drawn.safety
    guard = world.guard
    num_checks = max(guard.num_kept_out, guard.num_kept_in)
    drifts = {
        name: [motion_by_expm(drawn, k * PERIOD)[:3] for k in range(int(np.ceil(time / PERIOD - 1e-9)) + 1)]
        for name, time in (("out", safety.passive_horizon_s), ("in", safety.keep_in_horizon_s))
    }
    num_safe = 0
    for _ in range(200):
        position, velocity = generator.normal(size=(2, 3))
        distance = generator.uniform(guard.keep_out, min(guard.keep_in, 4.0 * guard.keep_out))
        state = np.r_[
            position * distance / np.linalg.norm(position), velocity * generator.choice([1e-4, 0.02, 0.2])
        ]
        if most_exceeded_of(world, state, num_checks) > 0.0:
            continue
        num_safe += 1
        assert min(np.linalg.norm(drift @ state) for drift in drifts["out"]) >= guard.keep_out * (1 - 1e-9)
        assert max(np.linalg.norm(drift @ state) for drift in drifts["in"]) <= guard.keep_in * (1 + 1e-9)
        farther = np.linalg.norm(state[:3]) - safety.speed_distance_m
        fastest = safety.speed_limit_m_s + safety.speed_slope_per_s * farther
        assert np.linalg.norm(state[3:]) <= fastest + 1e-9
        assert np.abs(state[3:]).max() <= (safety.axis_speed_limit_m_s or np.inf) + 1e-9


def most_exceeded_of(world: Any, state: np.ndarray, num_checks: int) -> float:
    return most_exceeded(world, 0, (Three(*state[:3]), Three(*state[3:])), num_checks)[2]


@examples(60)
@given(magnitude(0.1, 1e3), st.floats(0.0, 1.9), SEEDS)
def test_a_chord_dips_no_deeper_than_allowed(radius: float, part: float, seed: int) -> None:
    """Between two points outside a sphere, or on it."""
    length = part * radius
    for point, chord in np.random.default_rng(seed).normal(size=(40, 2, 3)):
        way = chord / np.linalg.norm(chord)
        middle = point - way * (point @ way)
        # as deep as it may be: both ends on the sphere
        middle *= np.sqrt(radius**2 - 0.25 * length**2) / np.linalg.norm(middle)
        along = np.linspace(-0.5, 0.5, 41)[:, np.newaxis] * length * way
        least = np.linalg.norm(middle + along, axis=1).min()
        assert radius - least <= bounds.dip(radius, length) * (1.0 + 1e-9) + 1e-9 * radius


@examples(80)
@given(guarded(), magnitude(1e-3, 1.0), magnitude(1e-3, 1.0), SEEDS)
def test_a_path_bends_off_its_chord_within_the_bound(drawn: Mission, a: float, b: float, seed: int) -> None:
    """Of any state whose stop takes no more than a force, under a force, by the equations themselves."""
    stop, fired = a * drawn.deputy.max_force_n, b * drawn.deputy.max_force_n
    try:
        other = replace(drawn, safety=THRUSTERS.safety)
    except SettingError:  # so heavy a deputy takes more than that braking to stand still
        assume(False)
    recursion = bounds._Recursion(other, bounds.ErrorBounds(), EXACT)
    bent, length = recursion._between(fired, stop)
    generator, mass = np.random.default_rng(seed), drawn.deputy.mass_kg
    phi, times = motion_by_expm(drawn, PERIOD), np.linspace(0.0, PERIOD, 11)
    moved = [motion_by_expm(drawn, time) for time in times]
    pushes = [integral_by_expm(drawn, time) / mass for time in times]
    for drawn_vectors in generator.normal(size=(6, 3, 3)):
        lengths = drawn.deputy.max_distance_m, stop, fired
        ways = drawn_vectors / np.linalg.norm(drawn_vectors, axis=1)[:, np.newaxis]
        position, braked, force = ways * np.array(lengths)[:, np.newaxis]
        # the speed that the force takes away in a period
        speed = np.linalg.solve(phi[3:, 3:], -pushes[-1][3:] @ braked - phi[3:, :3] @ position)
        path = np.array(
            [(m @ np.r_[position, speed] + p @ force)[:3] for m, p in zip(moved, pushes, strict=True)]
        )
        chord = path[0] + (times / PERIOD)[:, np.newaxis] * (path[-1] - path[0])
        spare = 1e-9 * drawn.deputy.max_distance_m
        assert np.linalg.norm(path - chord, axis=1).max() <= bent * (1.0 + 1e-9) + spare
        # at both ends the stop takes no more than that force
        end = moved[-1] @ np.r_[position, speed] + pushes[-1] @ force
        if np.linalg.norm(np.linalg.solve(pushes[-1][3:], phi[3:] @ end)) <= stop:
            assert np.linalg.norm(path[-1] - path[0]) <= length + 2.0 * bent + spare


def integral_by_expm(drawn: Mission, time_s: float) -> np.ndarray:
    """What a constant acceleration comes to, (6, 3)."""
    n, rates = drawn.orbit.mean_motion_rad_s, np.zeros((9, 9))
    rates[:3, 3:6] = rates[3:6, 6:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n**2, 2.0 * n, -2.0 * n, -(n**2)
    return expm(rates * time_s)[:6, 6:]


def weaker(module: Any, name: str, change: Callable[[Any], Any]) -> tuple[Any, str, Any]:
    """A function whose result is changed."""
    bound = getattr(module, name)
    return module, name, lambda *given: change(bound(*given))


def without(setting: str) -> tuple[Any, str, Any]:
    """The bound of thrusters that does not know a setting."""
    bound = thrust_bounds.of_fired
    return thrust_bounds, "of_fired", lambda law, *given: bound(replace(law, **{setting: 0.0}), *given)


def halved(value: float) -> float:
    return 0.5 * value


def scaled(**parts: float) -> Callable[[Any], Any]:
    """What multiplies some fields of a result."""
    return lambda result: replace(result, **{name: by * getattr(result, name) for name, by in parts.items()})


def straight(recursion: Any, fired: float, stop: float) -> tuple[float, float]:
    """A path that bends by half as much."""
    bent, length = UNBENT(recursion, fired, stop)
    return 0.5 * bent, length


UNBENT = bounds._Recursion._between
#: by name, what must find it, and what takes the place of a function
WEAKENED: dict[str, tuple[Any, tuple[Any, str, Any]]] = {
    "rounding": (test_thrusters_fire_within_the_bound, without("impulse_step_n_s")),
    "least impulse": (test_thrusters_fire_within_the_bound, without("least_impulse_n_s")),
    "layout's impulses": (
        test_thrusters_fire_within_the_bound,
        weaker(thrust_bounds, "most_missed", lambda missed: 0.1 * missed),
    ),
    "layout's capacity": (
        test_thrusters_fire_within_the_bound,
        weaker(thrust_bounds, "capacity_of", lambda has: has._replace(least_force_n=4.0 * has.least_force_n)),
    ),
    "premises": (test_thrusters_fire_within_the_bound, weaker(proofs, "premises", lambda _: ((), ()))),
    "share": (
        test_linear_errors_of_thrusters_are_within_the_share,
        weaker(thrust_bounds, "largest_share", halved),
    ),
    "propellant": (
        test_a_tank_that_just_holds_the_bound_is_never_empty,
        weaker(thrust_bounds, "propellant", lambda used: 0.6 * used),
    ),
    "lighter": (
        test_a_tank_that_just_holds_the_bound_is_never_empty,
        (
            thrust_bounds,
            "of_fired",
            lambda law, period, probability, _, bound=thrust_bounds.of_fired: bound(
                law, period, probability, 0.0
            ),
        ),
    ),
    "attitude": (
        test_forces_turn_with_the_sensed_attitude_within_the_bound,
        weaker(bounds, "error_bounds", scaled(force_n=0.3)),
    ),
    "position": (test_estimates_are_within_the_bound, weaker(bounds, "error_bounds", scaled(position_m=0.3))),
    "speed": (test_estimates_are_within_the_bound, weaker(bounds, "error_bounds", scaled(speed_m_s=0.3))),
    "motion": (
        test_what_motion_neglects_is_within_the_bound,
        weaker(estimates, "unknown_acceleration", lambda most: 0.3 * most),
    ),
    "shell": (test_a_shell_that_is_told_safe_has_no_unsafe_state, weaker(proofs, "norm", lambda _: 0.0)),
    "horizon": (
        test_what_the_layer_finds_safe_stays_safe_while_it_drifts,
        weaker(bounds, "ceil", lambda count: max(0, count - 2)),
    ),
    "dip": (test_a_chord_dips_no_deeper_than_allowed, weaker(bounds, "dip", halved)),
    "path": (
        test_a_path_bends_off_its_chord_within_the_bound,
        (bounds, "_Recursion", type("Weaker", (bounds._Recursion,), {"_between": straight})),
    ),
}


@pytest.mark.parametrize("name", WEAKENED)
def test_a_planted_weakening_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    finds, planted = WEAKENED[name]
    monkeypatch.setattr(*planted)
    with pytest.raises(AssertionError):
        finds()
