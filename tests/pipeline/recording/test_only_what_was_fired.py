"""No force that was not fired is recorded as fired, explained or counted: over all controllers that ship."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import telemetry
from fis_tools.analysis.flights import inputs_along, read_flight, usage_along
from fis_tools.commands.arguments import AskedInstant, instants
from fis_tools.model.thrust import COMPONENTS, COUNTED
from pipeline.controllers.source import WITH_PATHS, named
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import LEAST_CHANGE_N, Scenario
from pipeline.recording.recorder import FlightRecorder
from telemetry.file import reader
from telemetry.file.reader import Recording
from tests.pipeline.flight.cases import PAUSING
from tests.pipeline.flight.guarded import PASSIVE, guarded
from tests.pipeline.recording import cases
from tests.places import PROJECT

Floats = NDArray[np.float64]

SHIPPED = sorted(path.stem for path in (PROJECT / "conf" / "controller").glob("*.yaml"))
#: from here the layer acts, the champions coast, and the Sun is behind the deputy
START = Scenario(np.array([-40.0, 20.0, 30.0]), np.array([0.03, -0.02, -0.01]), np.pi)


def recorded(path: Path, name: str, is_guarded: bool) -> tuple[Controller, Recording]:
    """Fly and record a controller that ships, or `PAUSING`."""
    run = cases.composed("duration_s=3600.0", "chief.num_points=99")
    mission = guarded(PASSIVE) if is_guarded else run.experiment.mission
    controller = PAUSING if name == "pausing" else named(name, mission)
    log = fly_logged(mission, controller, START)
    recorder = FlightRecorder(mission, controller, seed=3, config=run.config, near_limit_m=5.0)
    recorder.record(path, START, log, scenario_id="x")
    return controller, telemetry.read(path)


def fired_by_the_controller(controller: Controller, found: Recording) -> Floats:
    """The force that was fired, in the controller's own axes."""
    force = found["/deputy/control"]["force_hill_n"]
    if controller.force_axes == "hill":
        return force
    return Rotation.from_quat(found["/deputy/state"]["quaternion"][:-1]).inv().apply(force)


@pytest.mark.slow
@pytest.mark.parametrize("is_guarded", [False, True])
@pytest.mark.parametrize("name", [*(name for name in SHIPPED if name not in WITH_PATHS), "pausing"])
def test_no_ghosts(name: str, is_guarded: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.mcap"
    controller, found = recorded(path, name, is_guarded)
    # each period that is explained is looked up in the whole file
    monkeypatch.setattr(reader, "read", cache(reader.read))
    control, fired = found["/deputy/control"], fired_by_the_controller(controller, found)
    asked, reason = control["force_asked_n"], control["reason"]

    # recorded: what is called fired is what was asked for, what is called anything else but two was not fired
    np.testing.assert_allclose(
        fired[reason == "fired"], asked[reason == "fired"], rtol=0, atol=LEAST_CHANGE_N
    )
    at_rest = ~np.isin(reason, ["fired", "clipped", "safety"])
    np.testing.assert_allclose(fired[at_rest], 0.0, rtol=0, atol=1e-12)
    spent = np.abs(control["force_hill_n"]).sum() * 10.0 / 12.0
    assert spent == pytest.approx(found["/mission"]["delta_v_m_s"][-1], abs=1e-9)
    if controller.fuzzy is None:
        assert found.fis_names == ()
        return
    nothing_inferred = np.isin(reason, ["waiting", "coasting", "complete"]).any(axis=1)
    for system in controller.systems:
        assert not np.isin(found[f"/fis/{system.name}"].time_s, control.time_s[nothing_inferred]).any()

    # counted: the inferences whose force was fired, each with its force
    usage, sensed = usage_along([path]), inputs_along([path])
    for flown in read_flight(path):
        axis = COMPONENTS.index(flown.system.outputs[0].name)
        is_counted = np.isin(reason[:, axis], COUNTED)
        np.testing.assert_array_equal(flown.time_s, control.time_s[is_counted])
        as_asked = reason[is_counted, axis] == "fired"
        component = fired[is_counted, axis]
        np.testing.assert_allclose(flown.output[as_asked], component[as_asked], rtol=0, atol=LEAST_CHANGE_N)
        assert len(sensed[flown.system.name]) == is_counted.sum()
        assert not is_counted.any() or usage[flown.system.name].num_samples == is_counted.sum()

    # explained: at two periods of each kind
    for kind in np.unique(reason):
        for k in np.flatnonzero((reason == kind).any(axis=1))[[0, -1]].tolist():
            asked = AskedInstant(path, time=float(control.time_s[k]))
            for one in instants(asked, controller.fuzzy):
                axis = COMPONENTS.index(one.system.outputs[0].name)
                assert (one.inputs is not None) == (reason[k, axis] in COUNTED)
                assert (one.note == "") == (reason[k, axis] == "fired")


@pytest.mark.slow
def test_the_flights_above_hold_every_reason(tmp_path: Path) -> None:
    found = set()
    for name, is_guarded in (("champion_any_sun", True), ("ellipse", False), ("pausing", False)):
        _, recording = recorded(tmp_path / f"{name}.mcap", name, is_guarded)
        found |= set(np.unique(recording["/deputy/control"]["reason"]).tolist())
    assert {"fired", "dead_band", "coasting", "waiting", "safety"} <= found
