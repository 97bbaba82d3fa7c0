"""The reference flies whole flights, with the log, the outcomes and the tracks of any other flight."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.settings.experiment import SettingError
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import STARTS, STEERING, mission
from tests.pipeline.flight.departures import ELLIPSE, FIXES, LOW_ORBIT, REAL

IDEAL = {"mode": "ideal"}
#: of each thing that the log holds, one flight of a few periods, in which rounding cannot grow much
FLIGHTS = {
    "flown": (mission(), STEERING),
    "what points make": (mission(attitude=IDEAL), cases.SEEING),
    "what coasting shows": (mission(attitude=IDEAL), cases.FORESEEING),
    "errors": (mission(attitude=IDEAL, navigation=FIXES, actuators=REAL), cases.MIXED),
    "about the Earth": (mission(attitude=IDEAL, dynamics=LOW_ORBIT, orbit=ELLIPSE), cases.RESTORING),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_all_of_the_log_is_that_of_compiled_flights(name):
    what, controller = FLIGHTS[name]
    what = replace(what, duration_s=12 * what.control_period_s)
    expected = fly_logged(what, controller, STARTS[1])
    log = fly_logged(replace(what, flight="reference"), controller, STARTS[1])
    for field, values in expected._asdict().items():
        actual = getattr(log, field)
        if field == "last_light_s" and not expected.is_candidate.any():
            continue
        if actual.shape[-1:] == (4,) and "quaternion" in field:  # two signs are one attitude
            actual = actual * np.where(np.sum(actual * values, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        scale = np.nanmax(np.abs(values), initial=1e-3) if values.dtype.kind == "f" else 0.0
        np.testing.assert_allclose(actual, values, rtol=0, atol=1e-5 * scale, err_msg=field)


@pytest.mark.slow
def test_outcomes_and_tracks_are_those_of_compiled_flights():
    what = mission(attitude=IDEAL, safety={"kind": "filter"}, duration_s=100.0)
    shape = len(STARTS), what.num_controls + 1, NUM_TRACKED
    tracks, expected = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    fast = fly_all(what, STEERING, STARTS, tracks=expected)
    slow = fly_all(replace(what, flight="reference"), STEERING, STARTS, tracks=tracks)
    for field, values in vars(fast).items():
        np.testing.assert_allclose(getattr(slow, field), values, rtol=1e-6, atol=1e-9, err_msg=field)
    np.testing.assert_allclose(tracks, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.slow
def test_a_controller_that_plans_in_flight_flies_as_compiled():
    words = ["+experiment=fly", "controller=receding_horizon", "attitude=ideal", "duration_s=300"]
    fast, slow = (
        fly_logged(job.mission, controller_of(job), STARTS[0])
        for job in (compose_experiment([*words, *more]).experiment for more in ([], ["flight=reference"]))
    )
    np.testing.assert_allclose(slow.position_m, fast.position_m, rtol=0, atol=1e-6)
    assert slow.force_hill_n.any()


def controller_of(experiment):
    from pipeline.controllers.source import load  # noqa: PLC0415

    return load(experiment.controller, experiment.mission)


def test_it_is_refused_where_many_flights_are_flown():
    with pytest.raises(SettingError, match="flight is reference and stages"):
        compose_experiment(["+experiment=train", "flight=reference"])
