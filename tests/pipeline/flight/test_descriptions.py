"""Descriptions of signals: what each says with its constants and without is what flights sense."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain, combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from fis_tools.edit.session import Session
from fis_tools.formats import serialize
from pipeline.controllers.source import load
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.descriptions import FOLLOWING, describe, descriptions_of, with_descriptions
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import CONSTANTS, HILL_AXES, SIGNALS
from pipeline.settings.places import conf_folder
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import STARTS, mission
from tests.pipeline.flight.missions import MEAN_MOTION

VALUES = {
    "ring_size_m": 30.0,
    "ring_lead_rad": 0.4,
    "prediction_time_s": 700.0,
    "see_horizon_s": 1500.0,
    "aim_urgent_m_s": 0.04,
    "tour_lean_m": 20.0,
    "tour_wait_s": 2400.0,
}
#: constants without which a signal has no meaning at all, and a tour that does not move
ALWAYS = {
    "ring_error": {"ring_lead_rad": 0.4},
    "see_push": {"see_damping_ks2": 0.08, "urgency_time_s": 400.0},
    "aim": {"see_damping_ks2": 0.08, "urgency_time_s": 400.0},
    "tour_push": {"urgency_time_s": 900.0, "tour_time_s": 600.0, "tour_along_track_mean_m": 70.0},
}
TOUR = np.array([0.0, 70.0, 0.0])
#: the Sun goes behind the Earth, where there is one, after some minutes, and comes back before the end
DUSK = replace(STARTS[0], sun_angle_rad=np.pi + 1.5)
SHADOWED = {"light": {"shadow": "conical"}}

Sensed = dict[str, np.ndarray]


def sensed(prefix: str, constants: dict[str, float], **world: object) -> tuple[FlightLog, Sensed]:
    """Return a free flight, and what is sensed in it, by the signal's name without its prefix."""
    names = [name for name in FOLLOWING if name.startswith(prefix)]
    senses = {"x": (0.01, dict.fromkeys(names, 60.0))}
    if prefix in ("aim", "tour_push"):
        others = ("urgent", "see_push") if prefix == "aim" else ("urgent",)
        for axis, other in zip("yz", others, strict=False):
            senses[axis] = (0.01, {f"{other}_{along}": 1.0 for along in HILL_AXES})
    dead = {f"dead_band_force_{axis}_n": 1.0 for axis in "xyz"}
    log = fly_logged(mission(**world), cases.leaning(senses, dead | constants), DUSK)
    assert not log.force_hill_n.any()
    return log, {
        name: log.fis_input[:, at, : len(names)] for at, name in enumerate((prefix, *others_of(prefix)))
    }


def others_of(prefix: str) -> tuple[str, ...]:
    """Return what is sensed besides."""
    return {"aim": ("urgent", "see_push"), "tour_push": ("urgent",)}.get(prefix, ())


def drift(time_s: float) -> np.ndarray:
    """The transition of free motion, by SciPy, from the equations of Clohessy and Wiltshire."""
    n, system = MEAN_MOTION, np.zeros((6, 6))
    system[:3, 3:] = np.eye(3)
    system[3, 0], system[3, 4], system[4, 3], system[5, 2] = 3.0 * n * n, 2.0 * n, -2.0 * n, -n * n
    return expm(system * time_s)


def states(log: FlightLog) -> np.ndarray:
    """Return the states at decisions, a column each."""
    return np.hstack([log.position_m, log.velocity_m_s])[:-1].T


def centres(state: np.ndarray) -> np.ndarray:
    """Return the middle, along i and j, of free paths over an orbit, which drift by the same each time."""
    orbit = 2.0 * np.pi / MEAN_MOTION
    times = np.linspace(-0.5 * orbit, 0.5 * orbit, 65)[:-1]
    return np.mean([(drift(time) @ state)[:2] for time in times], axis=0)


def close(values: np.ndarray, expected: np.ndarray, atol: float = 1e-8) -> None:
    """Values that differ, as expected."""
    assert np.ptp(expected) > 1e3 * atol
    np.testing.assert_allclose(values, expected, rtol=0, atol=atol)


def ellipse(state: np.ndarray) -> np.ndarray:
    """Return the way from the centre, along i and half of that along j, shape (2, K)."""
    middle = centres(state)
    # the middle of a path that drifts: the mean over times that are not quite symmetric is corrected
    orbit, n = 2.0 * np.pi / MEAN_MOTION, MEAN_MOTION
    middle[1] += 1.5 * n * middle[0] * (-0.5 * orbit / 64)
    return (state[:2] - middle) * np.array([[1.0], [0.5]])


def height(log: FlightLog, values: Sensed) -> None:
    close(values["ring_error"].T, ellipse(states(log)))


def from_the_ring(log: FlightLog, values: Sensed) -> None:
    angle = log.sun_angle_rad[:-1] - VALUES["ring_lead_rad"]
    ring = VALUES["ring_size_m"] * np.array([np.cos(angle), np.sin(angle)])
    close(values["ring_error"].T, ellipse(states(log)) - ring)


def centre_after(time_s: float, log: FlightLog, values: Sensed) -> None:
    state = drift(time_s) @ states(log)
    close(values["predicted_centre"][:, 0], state[1] - 2.0 * ellipse(state)[1])


def nothing(name: str) -> Callable[[FlightLog, Sensed], None]:
    return lambda _, values: np.testing.assert_array_equal(values[name], 0.0)


def pushes(_: FlightLog, values: Sensed) -> None:
    assert np.ptp(values["see_push"]) > 0.01


def aims(log: FlightLog, values: Sensed, sees: bool, leans: bool) -> None:
    lean = VALUES["aim_urgent_m_s"] if leans else 0.0
    assert (np.ptp(values["see_push"]) > 0.01) == sees
    close(values["aim"], values["see_push"] + lean * values["urgent"], 1e-12)
    urgent = np.linalg.norm(values["urgent"], axis=1)
    assert np.all((urgent == 0.0) | (np.abs(urgent - 1.0) < 1e-9))
    assert (urgent > 0.0).any()


def arrives(log: FlightLog, values: Sensed, leans: bool) -> None:
    after = drift(ALWAYS["tour_push"]["tour_time_s"])
    goal = TOUR + (VALUES["tour_lean_m"] if leans else 0.0) * values["urgent"]
    reached = (after[:3] @ states(log)).T + values["tour_push"] @ after[:3, 3:].T
    close(reached, goal, 1e-6)


def waits(log: FlightLog, values: Sensed, leans: bool) -> None:
    """Where it is dark in tour_time_s, it arrives as the shadow ends, unless that is too far ahead."""
    period, steps = 10.0, int(ALWAYS["tour_push"]["tour_time_s"] / 10.0)
    is_dark = log.visible_sun_share < 0.5
    num_dark = 0
    for k in range(0, len(values["tour_push"]) - steps, 7):
        goal = TOUR + (VALUES["tour_lean_m"] if leans else 0.0) * values["urgent"][k]
        lit = np.flatnonzero(~is_dark[k + steps :])
        is_far = not len(lit) or period * (steps + lit[0]) > VALUES["tour_wait_s"] + period
        if is_far:
            np.testing.assert_array_equal(values["tour_push"][k], 0.0)
            continue
        after = drift(period * (steps + lit[0]))
        reached = after[:3] @ states(log)[:, k] + after[:3, 3:] @ values["tour_push"][k]
        assert np.linalg.norm(reached - goal) < (2.5 if is_dark[k + steps] else 1e-5), k
        num_dark += bool(is_dark[k + steps])
    assert num_dark > 3


#: by what begins the signals' names, and the constants that are set: what the description says, in numbers
CLAIMS: dict[tuple[str, frozenset[str]], Callable[[FlightLog, Sensed], None]] = {
    ("ring_error", frozenset()): height,
    ("ring_error", frozenset({"ring_size_m"})): from_the_ring,
    ("predicted_centre", frozenset()): partial(centre_after, 0.0),
    ("predicted_centre", frozenset({"prediction_time_s"})): partial(
        centre_after, VALUES["prediction_time_s"]
    ),
    ("see_push", frozenset()): nothing("see_push"),
    ("see_push", frozenset({"see_horizon_s"})): pushes,
    ("aim", frozenset()): nothing("aim"),
    ("aim", frozenset({"see_horizon_s"})): lambda log, values: aims(log, values, True, False),
    ("aim", frozenset({"aim_urgent_m_s"})): lambda log, values: aims(log, values, False, True),
    ("aim", frozenset({"see_horizon_s", "aim_urgent_m_s"})): lambda log, values: aims(
        log, values, True, True
    ),
    ("tour_push", frozenset()): lambda log, values: arrives(log, values, False),
    ("tour_push", frozenset({"tour_lean_m"})): lambda log, values: arrives(log, values, True),
    ("tour_push", frozenset({"tour_wait_s"})): lambda log, values: waits(log, values, False),
    ("tour_push", frozenset({"tour_lean_m", "tour_wait_s"})): lambda log, values: waits(log, values, True),
}


def all_claims() -> set[tuple[str, frozenset[str]]]:
    """Return what begins the names of signals that follow constants, with each set of these."""
    prefixes = {
        signal.removesuffix(f"_{axis}"): constants
        for signal, (constants, _) in FOLLOWING.items()
        for axis in HILL_AXES
        if signal.endswith(f"_{axis}")
    }
    return {
        (prefix, frozenset(choice))
        for prefix, constants in prefixes.items()
        for choice in chain.from_iterable(combinations(constants, size) for size in range(len(constants) + 1))
    }


def test_every_meaning_has_a_claim():
    assert all_claims() == CLAIMS.keys()
    for signal in FOLLOWING:
        choices = [chosen for prefix, chosen in CLAIMS if signal.startswith(prefix)]
        assert len({describe(signal, chosen) for chosen in choices}) == len(choices) > 1


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: "-".join((claim[0], *sorted(claim[1]))))
def test_what_a_description_says_is_what_flights_sense(claim):
    prefix, chosen = claim
    constants = ALWAYS.get(prefix, {}) | {name: VALUES[name] for name in chosen}
    world = SHADOWED if "tour_wait_s" in chosen else {}
    flight = sensed(prefix, constants, **world)
    CLAIMS[claim](*flight)
    others = [each for each in CLAIMS if each[0] == prefix and each != claim]
    assert [each for each in others if _is_so(CLAIMS[each], flight)] == []


def _is_so(holds: Callable[[FlightLog, Sensed], None], flight: tuple[FlightLog, Sensed]) -> bool:
    """Whether a claim asserts nothing that a flight denies."""
    try:
        holds(*flight)
    except AssertionError:
        return False
    return True


FILES = sorted(
    path for path in (conf_folder() / "controller").glob("*.yaml") if "\nsystems:" in path.read_text("utf-8")
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_shipped_controllers_say_what_their_signals_mean_to_them(path):
    controller = serialize.load(path)
    assert with_descriptions(controller) == controller
    assert all(variable.description for system in controller.systems for variable in system.inputs)


def test_what_is_loaded_follows_its_constants_and_keeps_words_of_its_own(tmp_path):
    text = (conf_folder() / "controller" / "champion_27.yaml").read_text(encoding="utf-8")
    worded = text.replace("description: velocity relative to Hill along k", "description: my own words")
    assert worded != text
    path = tmp_path / "given.yaml"
    path.write_text(worded)
    source = {"path": str(path), "attributes": {"ring_size_m": 20.0}}
    controller = load(source, mission())
    meant = {
        variable.name: variable.description for system in controller.systems for variable in system.inputs
    }
    assert meant["ring_error_radial"] == SIGNALS["ring_error_radial"].description
    assert meant["velocity_cross_track"] == "my own words"
    assert controller.name == "champion_27, edited"


def test_in_an_editor_a_description_changes_with_the_constant():
    opened = load({"path": str(conf_folder() / "controller" / "champion_27.yaml")}, mission()).fuzzy
    session = Session(Path("champion_27.yaml"), opened, describe=with_descriptions)

    def meant() -> str:
        inputs = session.controller.systems[1].inputs
        return next(variable.description for variable in inputs if variable.name == "ring_error_radial")

    assert meant() == describe("ring_error_radial", ()) != SIGNALS["ring_error_radial"].description
    attributes = tuple(sorted({**dict(opened.attributes), "ring_size_m": "20"}.items()))
    session.touch(lambda controller: replace(controller, attributes=attributes))
    assert meant() == SIGNALS["ring_error_radial"].description
    session.step(-1)
    assert meant() == describe("ring_error_radial", ())


def test_meanings_name_constants_there_are():
    for signal, (constants, _) in FOLLOWING.items():
        assert set(constants) <= CONSTANTS.keys()
        assert SIGNALS[signal].description in descriptions_of(signal)
