"""The C of a controller against the forces that its recorded flights fired."""

import ctypes

import numpy as np
import pytest

from fis_tools.formats.c import source, step
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import LOGIC_REASONS, ThrustLogic, thrust_logic
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller
from pipeline.settings.experiment import Mission
from telemetry.file.recording import Recording
from tests.fis_tools.formats.test_c import loaded
from tests.pipeline.flight.cases import STEERING, mission, random_starts, with_attributes
from tests.pipeline.recording import cases

REASON_WORDS = np.array(LOGIC_REASONS)
COASTING = {"dead_band_force_y_n": "0.01", "coast_below_points": "9", "coast_margin_m": "5"}
#: controllers, each with how it is flown: dead bands, coasting, a decision period, body axes, a weak thruster
FLOWN: list[tuple[Controller, Mission]] = [
    (named("champion_any_sun", mission()), mission()),
    (with_attributes(named("champion_fixed_sun", mission()), decision_period_s="30"), mission()),
    (named("ellipse", mission()), mission(deputy={"max_force_n": 0.015})),
    (named("paper_champion", mission()), mission()),
    # all of it in body axes
    (
        with_attributes(STEERING, decision_period_s="20.0", **COASTING),
        mission(deputy={"max_force_n": 0.02}, control_period_s=20.0),
    ),
]
FLIGHTS_EACH = 5
#: what coasting is decided by: signals, and as which they are recorded
FORESEEN = {
    "missed": "coasting_missed",
    "coasting_nearest": "coasting_nearest_m",
    "coasting_farthest": "coasting_farthest_m",
}


def structure(*members: tuple[str, type]) -> type[ctypes.Structure]:
    return type("Members", (ctypes.Structure,), {"_fields_": list(members)})


STATE = structure(("periods_to_wait", ctypes.c_int))
FORCE = structure(
    ("fired_n", ctypes.c_double * 3), ("asked_n", ctypes.c_double * 3), ("reason", ctypes.c_int * 3)
)


def signals_of(controller: FuzzyController, logic: ThrustLogic) -> type[ctypes.Structure]:
    doubles = [(word, ctypes.c_double) for word, _, _ in step.members(controller, logic).values()]
    attitude = [("attitude", ctypes.c_double * 4)] if logic.force_axes == "body" else []
    return structure(*doubles, *attitude, ("is_complete", ctypes.c_int))


def mission_of(logic: ThrustLogic, what: Mission) -> ctypes.Structure:
    deputy, numbers = what.deputy, {"max_force_n": what.deputy.max_force_n}
    if logic.decision_period_s > 0.0:
        numbers["control_period_s"] = what.control_period_s
    if logic.may_coast:
        numbers |= {"min_distance_m": deputy.min_distance_m, "max_distance_m": deputy.max_distance_m}
    doubles = [(name, ctypes.c_double) for name in numbers]
    kind = structure(*doubles, ("coasts_when_complete", ctypes.c_int))
    return kind(*numbers.values(), what.coast_when_complete)


def stepped(
    library: ctypes.CDLL, controller: FuzzyController, what: Mission, recording: Recording
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What C fires, asks for and says, told what a recording holds and NaN for everything else."""
    logic = thrust_logic(controller)
    assert logic is not None
    words = {name: member for name, (member, _, _) in step.members(controller, logic).items()}
    kind, world = signals_of(controller, logic), mission_of(logic, what)
    state, force = STATE(99), FORCE()
    library.start(ctypes.byref(state))
    control, deputy, status = recording["/deputy/control"], recording["/deputy/state"], recording["/mission"]
    known = {word: np.full(len(control), np.nan) for word in words.values()}
    for name, member in FORESEEN.items() if logic.may_coast else ():
        known[words[name]] = control[member]
    for system in controller.systems:
        inferred = recording[f"/fis/{system.name}"]
        rows = np.searchsorted(control.time_s, inferred.time_s)
        for variable, values in zip(system.inputs, inferred["inputs"].T, strict=True):
            known[words[variable.name]][rows] = values
    fired_by_period = []
    for k in range(len(control)):
        signals = kind(**{word: values[k] for word, values in known.items()})
        if logic.force_axes == "body":
            signals.attitude[:] = deputy["quaternion"][k].tolist()
        signals.is_complete = int(status["inspected_mask"][k].all())
        library.step(*map(ctypes.byref, (state, signals, world, force)))
        fired_by_period.append((list(force.fired_n), list(force.asked_n), list(force.reason)))
    fired, requested, reason = (np.array(column) for column in zip(*fired_by_period, strict=True))
    return fired, requested, REASON_WORDS[reason]


@pytest.mark.slow
def test_c_fires_what_recorded_flights_fired(tmp_path):
    reasons: set[str] = set()
    for index, (controller, what) in enumerate(FLOWN):
        # one of a name is loaded but once
        library = loaded(tmp_path / f"{index}.so", source.write(controller.fuzzy), "-ffp-contract=off")
        for start in random_starts(FLIGHTS_EACH, 31):
            _, recording = cases.recorded(tmp_path / "flight.mcap", what, controller, start)
            control = recording["/deputy/control"]
            fired, requested, reason = stepped(library, controller.fuzzy, what, recording)
            np.testing.assert_allclose(fired, control["force_hill_n"], rtol=0, atol=1e-12)
            np.testing.assert_allclose(requested, control["force_asked_n"], rtol=0, atol=1e-12)
            np.testing.assert_array_equal(reason, control["reason"])
            reasons |= set(np.unique(reason).tolist())
    assert reasons >= {"fired", "dead_band", "waiting", "coasting", "complete", "clipped"}
