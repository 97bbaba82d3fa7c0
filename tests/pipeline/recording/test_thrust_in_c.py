"""The C of a controller against the forces that its recorded flights fired."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import telemetry
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import LOGIC_REASONS, ThrustLogic, thrust_logic
from pipeline.flight.control.controller import from_fuzzy
from pipeline.settings.experiment import Mission
from telemetry.file.reader import Recording
from tests.fis_tools.formats.test_c import gcc
from tests.pipeline.flight.cases import STEERING, mission, random_starts
from tests.pipeline.recording import cases
from tests.places import PROJECT

CONTROLLERS = PROJECT / "conf" / "controller"
REASON_WORDS = np.array(LOGIC_REASONS)


def but(fuzzy: FuzzyController, **attributes: str) -> FuzzyController:
    return replace(fuzzy, attributes=tuple(sorted((dict(fuzzy.attributes) | attributes).items())))


def shipped(name: str, **attributes: str) -> FuzzyController:
    return but(serialize.load(CONTROLLERS / f"{name}.yaml"), **attributes)


COASTING = {"dead_band_force_y_n": "0.01", "coast_below_points": "9", "coast_margin_m": "5"}
#: controllers, each with how it is flown: dead bands, coasting, a decision period, body axes, a weak thruster
FLOWN: list[tuple[FuzzyController, Mission]] = [
    (shipped("champion_any_sun"), mission()),
    (shipped("champion_fixed_sun", decision_period_s="30"), mission()),
    (shipped("ellipse"), mission(deputy={"max_force_n": 0.015})),
    (shipped("paper_champion"), mission()),
    # all of it in body axes
    (
        but(STEERING.fuzzy, decision_period_s="20.0", **COASTING),
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


def compiled(controller: FuzzyController, path: Path) -> ctypes.CDLL:
    """Write a controller as C, compile it and load it."""
    path.with_suffix(".c").write_text(source.write(controller), encoding="utf-8")
    words = ("-ffp-contract=off", "-shared", "-fPIC", f"{path.stem}.c", "-o", path.name, "-lm")
    done = gcc(path.parent, *words)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(path))


def structure(*members: tuple[str, type]) -> type[ctypes.Structure]:
    return type("Members", (ctypes.Structure,), {"_fields_": list(members)})


STATE = structure(("periods_to_wait", ctypes.c_int))
FORCE = structure(
    ("fired_n", ctypes.c_double * 3), ("asked_n", ctypes.c_double * 3), ("reason", ctypes.c_int * 3)
)


def signals_of(controller: FuzzyController, logic: ThrustLogic) -> type[ctypes.Structure]:
    doubles = [(word, ctypes.c_double) for word, _, _ in source.members(controller, logic).values()]
    attitude = [("attitude", ctypes.c_double * 4)] if logic.force_axes == "body" else []
    return structure(*doubles, *attitude, ("is_complete", ctypes.c_int))


def mission_of(logic: ThrustLogic, what: Mission) -> ctypes.Structure:
    members: list[tuple[str, type, float]] = [("max_force_n", ctypes.c_double, what.deputy.max_force_n)]
    if logic.decision_period_s > 0.0:
        members.append(("control_period_s", ctypes.c_double, what.control_period_s))
    if logic.may_coast:
        members.append(("min_distance_m", ctypes.c_double, what.deputy.min_distance_m))
        members.append(("max_distance_m", ctypes.c_double, what.deputy.max_distance_m))
    members.append(("coasts_when_complete", ctypes.c_int, what.coast_when_complete))
    return structure(*((name, kind) for name, kind, _ in members))(*(value for _, _, value in members))


def stepped(
    library: ctypes.CDLL, controller: FuzzyController, what: Mission, found: Recording
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What C fires, asks for and says, told what a recording holds and NaN for everything else."""
    logic = thrust_logic(controller)
    assert logic is not None
    words = {name: member for name, (member, _, _) in source.members(controller, logic).items()}
    kind, world = signals_of(controller, logic), mission_of(logic, what)
    state, force = STATE(99), FORCE()
    library.start(ctypes.byref(state))
    control, deputy, status = found["/deputy/control"], found["/deputy/state"], found["/mission"]
    inferred = {system.name: found[f"/fis/{system.name}"] for system in controller.systems}
    rows = {
        name: {time: row for row, time in enumerate(one.time_s.tolist())} for name, one in inferred.items()
    }
    told = []
    for k, time_s in enumerate(control.time_s.tolist()):
        signals = kind()
        for word in words.values():
            setattr(signals, word, np.nan)
        for name, member in FORESEEN.items() if logic.may_coast else ():
            setattr(signals, words[name], control[member][k])
        for system in controller.systems:
            if time_s in rows[system.name]:
                values = inferred[system.name]["inputs"][rows[system.name][time_s]]
                for variable, value in zip(system.inputs, values, strict=True):
                    setattr(signals, words[variable.name], value)
        if logic.force_axes == "body":
            signals.attitude[:] = deputy["quaternion"][k].tolist()
        signals.is_complete = int(status["inspected_mask"][k].all())
        library.step(*map(ctypes.byref, (state, signals, world, force)))
        told.append((list(force.fired_n), list(force.asked_n), list(force.reason)))
    fired, asked, reason = (np.array(column) for column in zip(*told, strict=True))
    return fired, asked, REASON_WORDS[reason]


@pytest.mark.slow
def test_c_fires_what_recorded_flights_fired(tmp_path):
    reasons: set[str] = set()
    for place, (controller, what) in enumerate(FLOWN):
        # one of a name is loaded but once
        library, flown = compiled(controller, tmp_path / f"{place}.so"), from_fuzzy(controller)
        for start in random_starts(FLIGHTS_EACH, 31):
            path = tmp_path / "flight.mcap"
            cases.recorded(path, what, flown, start)
            found = telemetry.read(path)
            control = found["/deputy/control"]
            fired, asked, reason = stepped(library, controller, what, found)
            np.testing.assert_allclose(fired, control["force_hill_n"], rtol=0, atol=1e-12)
            np.testing.assert_allclose(asked, control["force_asked_n"], rtol=0, atol=1e-12)
            np.testing.assert_array_equal(reason, control["reason"])
            reasons |= set(np.unique(reason).tolist())
    assert reasons >= {"fired", "dead_band", "waiting", "coasting", "complete", "clipped"}
