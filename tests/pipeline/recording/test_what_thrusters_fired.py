"""No force that was not fired is recorded as fired, explained or counted: over all controllers that ship."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fis_tools.analysis.flights import inputs_along, read_flight
from fis_tools.commands.arguments import InstantArguments, instants
from fis_tools.model.thrust import COMPONENTS
from pipeline.controllers.source import WITH_PATHS, named
from pipeline.flight.state.log import Scenario
from telemetry.file import reader
from telemetry.scene import drawing
from tests import night
from tests.pipeline.flight.cases import PAUSING
from tests.pipeline.flight.guarded import PASSIVE, guarded
from tests.pipeline.recording import cases
from tests.places import PROJECT

NAMES = sorted(path.stem for path in (PROJECT / "conf" / "controller").glob("*.yaml"))
WORLDS = {"leo": ("world=leo",), "late": ("actuators=real", "actuators.delay_s=10.0"), "guarded": ()}
DOCKING = {"docking": ("problem=docking", "safety=none", "duration_s=300.0")}
DOCKS = ("champion_docking", "steady")
#: it solves a linear programme each period, from the first to the last alike
BRIEF = {"receding_horizon_approach": ("duration_s=80.0",)}
FLOWN = [
    (name, world)
    for name in NAMES
    if name not in WITH_PATHS
    for world in (DOCKING if name.endswith("_approach") else WORLDS | DOCKING if name in DOCKS else WORLDS)
]
# with a shadow, for then all controllers under the layer fly by the same compiled code
GUARDED = guarded(PASSIVE, duration_s=1800.0, light={"shadow": "conical"})
START = Scenario(np.array([-40.0, 20.0, 30.0]), np.array([0.03, -0.02, -0.01]), 2.0, 0.0, (1, 0, 0))
DRAWN = night.by_day(FLOWN, 7)
#: those in which the paper's rules meet the layer, a controller waits, or the deputy docks
CERTAIN = [
    ("pausing", "guarded"),
    *(each for each in FLOWN if (each == ("paper", "guarded") or each[1] == "docking") and each not in DRAWN),
]
CALLED = ("fired", "clipped", "safety", "rehearsed", "parked")
ROUNDING_N = 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("name", "world"), [*DRAWN, *CERTAIN])
def test_nothing_is_said_to_fire_that_did_not(name, world, tmp_path, monkeypatch):
    path, mission = tmp_path / "flight.mcap", GUARDED
    if world != "guarded":
        words = *(WORLDS | DOCKING)[world], *BRIEF.get(name, ())
        mission = cases.composed("duration_s=900.0", *words).experiment.mission
    controller = PAUSING if name == "pausing" else named(name, mission)
    _, recording = cases.recorded(path, mission, controller, START)
    # each period that is explained is looked up in the whole file
    monkeypatch.setattr(reader, "read", cache(reader.read))
    delay_s = getattr(mission.actuators, "delay_s", 0.0)  # ideal thrusters have none
    control, delay = recording["/deputy/control"], round(delay_s / mission.control_period_s)
    force, commanded = control["force_hill_n"], control["force_commanded_n"]
    if mission.actuators.kind == "ideal" and controller.force_axes == "body":  # as reasons are told
        to_body = Rotation.from_quat(recording["/deputy/state"]["quaternion"][:-1]).inv()
        force, commanded = to_body.apply(force), to_body.apply(commanded)
    has_force, is_commanded = np.abs(force) >= ROUNDING_N, np.abs(commanded) >= ROUNDING_N
    reason = control["reason"]
    is_called = np.isin(reason, CALLED)
    assert np.count_nonzero(has_force & ~is_called) == 0
    assert np.count_nonzero(~has_force & np.isin(reason, ("fired", "clipped"))) == 0
    np.testing.assert_array_equal(control["command_age_s"], delay_s)
    is_due = np.zeros_like(is_commanded)
    is_due[delay:] = is_commanded[: len(is_commanded) - delay]
    np.testing.assert_array_equal(reason == "below_least_impulse", is_due & ~has_force)
    np.testing.assert_array_equal(reason == "delayed", is_commanded & ~is_due & ~has_force)
    if name == "pausing":
        assert {"fired", "waiting"} <= set(np.unique(reason).tolist())
    if (name, world) == ("paper", "guarded"):
        assert "safety" in reason
    spent = np.abs(control["force_hill_n"]).sum() * mission.control_period_s / mission.deputy.mass_kg
    if mission.actuators.kind == "ideal":
        assert spent == pytest.approx(recording["/mission"]["delta_v_m_s"][-1], abs=1e-9)
    if mission.actuators.kind == "ideal" and mission.navigation.mode == "perfect":
        np.testing.assert_array_equal(control["force_hill_n"], control["force_commanded_n"])
    if controller.fuzzy is None:
        assert recording.fis_names == ()
    else:
        nothing_inferred = np.isin(reason, ["waiting", "coasting", "complete"]).any(axis=1)
        for system in controller.systems:
            assert not np.isin(
                recording[f"/fis/{system.name}"].time_s, control.time_s[nothing_inferred]
            ).any()
        assert_commanded_as_asked(mission, controller, control)
        assert_shared(controller, recording, delay)
        assert_told(path, controller, recording, delay)


def assert_commanded_as_asked(mission, controller, control):
    """Commanded is what was asked for outside the dead bands, clipped; along Hill axes; or by the layer."""
    is_own = ~(control["command_reason"] == "safety").any(axis=1)
    requested, commanded = control["force_asked_n"][is_own], control["force_commanded_n"][is_own]
    is_rehearsed = np.isin(control["command_reason"][is_own], ("rehearsed", "parked"))
    bands = dict(controller.fuzzy.attributes)
    bands = np.array([float(bands.get(f"dead_band_{name}_n", 0.0)) for name in COMPONENTS])
    passed = np.where((np.abs(requested) >= bands) | is_rehearsed, requested, 0.0)
    limit = mission.deputy.max_force_n
    if controller.force_axes == "hill":
        np.testing.assert_allclose(commanded, np.clip(passed, -limit, limit), rtol=0, atol=1e-12)
    elif np.abs(passed).sum(axis=1).max() < limit:  # a turn keeps the length
        lengths = (np.linalg.norm(force, axis=1) for force in (commanded, passed))
        np.testing.assert_allclose(*lengths, rtol=0, atol=1e-12)


def assert_shared(controller, recording, delay):
    """Shares of rules come to what was asked for where it takes effect, and are zero elsewhere."""
    control = recording["/deputy/control"]
    for system in controller.systems:
        if system.outputs[0].name in COMPONENTS:
            axis, topic = COMPONENTS.index(system.outputs[0].name), recording[f"/fis/{system.name}"]
            rows = np.searchsorted(control.time_s, topic.time_s)
            has_effect = taking_effect(controller, control, axis, delay)[rows]
            expected = np.where(has_effect, control["force_asked_n"][rows, axis], 0.0)
            np.testing.assert_allclose(topic["shares_n"].sum(axis=1), expected, rtol=0, atol=1e-9)
            assert not topic["shares_n"][expected == 0.0].any()


def taking_effect(controller, control, axis, delay):
    """At which periods what is asked for along an axis is commanded and, after the delay, fired."""
    has_force = np.abs(control["force_hill_n"]) >= ROUNDING_N
    is_commanded = np.abs(control["force_commanded_n"]) >= ROUNDING_N
    columns = (slice(None), [axis]) if controller.force_axes == "hill" else (slice(None), slice(None))
    fires = has_force[columns].any(axis=1)
    later = np.zeros_like(fires)
    later[: len(fires) - delay] = fires[delay:]
    is_asked = np.abs(control["force_asked_n"][:, axis]) >= ROUNDING_N
    is_inferred = ~np.isin(control["command_reason"][:, axis], ("rehearsed", "parked", "safety"))
    return is_asked & is_inferred & is_commanded[columns].any(axis=1) & later


def assert_told(path, controller, recording, delay):
    """What is counted, explained and written over the replay is what took effect."""
    control, sensed = recording["/deputy/control"], inputs_along([path])
    effects, counts = {}, control.time_s < recording.end_s
    for flown in read_flight(path):
        axis = COMPONENTS.index(flown.system.outputs[0].name)
        effects[axis] = taking_effect(controller, control, axis, delay)
        inferred = np.isin(control.time_s, recording[f"/fis/{flown.system.name}"].time_s)
        expected = control.time_s[effects[axis] & inferred & counts]
        np.testing.assert_array_equal(flown.time_s, expected)
        assert len(sensed[flown.system.name]) == len(expected)
    for kind in np.unique(control["reason"][counts]):
        for k in np.flatnonzero((control["reason"] == kind).any(axis=1) & counts)[[0, -1]].tolist():
            for instant in instants(InstantArguments(path, time=float(control.time_s[k])), controller.fuzzy):
                axis = COMPONENTS.index(instant.system.outputs[0].name)
                is_due = k >= delay and effects[axis][k - delay]
                assert (instant.inputs is not None) == is_due
    lines = drawing.now_in_words(recording, drawing.sample_times(recording))
    fires = control["force_hill_n"].any(axis=1)
    assert [line.startswith("Firing ") for line in lines[: len(fires)]] == fires.tolist()
    for k, line in enumerate(lines[: len(fires)]):
        if "mostly by rule" in line:
            rule, _, name = line.split("mostly by rule ")[1].split(":")[0].split(",")[0].split(" ")
            assert int(rule) not in recording.fis_description(name).holding
            topic = recording[f"/fis/{name}"]
            row = int(np.flatnonzero(topic.time_s == control.time_s[k - delay])[0])
            assert topic["shares_n"][row, int(rule) - 1] * topic["output_n"][row] > 0.0
