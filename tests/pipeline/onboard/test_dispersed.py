"""Settings that are drawn for each flight, on board: exported where the C is the same whatever is drawn."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.formats import serialize
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.pushes import Effort
from pipeline.flight.fly.replanning import AGAIN_ON_BOARD, FIRST
from pipeline.flight.fly.simulation import fly_logged
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.dispersed import of_all_flights
from pipeline.onboard.export import export
from pipeline.onboard.program import translate
from pipeline.settings.checks import SettingError
from pipeline.settings.dispersions import IN_TIME
from pipeline.settings.mission import TwoBody
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
ERRORS = {"navigation": {"mode": "fixes"}, "actuators": {"kind": "real"}, "dynamics": TwoBody(drag_m_s2=3e-7)}
NOISY, EXACT = mission(duration_s=1200.0, **ERRORS), mission(duration_s=1200.0)
#: the errors of navigation, thrusters and motion that vary within a flight, of those that the mission has
OF_REALITY = sorted(key for key in IN_TIME if hasattr(getattr(NOISY, key.split(".")[0]), key.split(".")[1]))
MASS = {"deputy.mass_kg": {"kind": "normal", "mean": 12.0, "std": 0.6}}
TORQUE = {"deputy.max_torque_n_m": {"kind": "uniform", "low": 0.005, "high": 0.01}}


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setitem(FIRST, 2, Effort(16, 9))
    monkeypatch.setitem(AGAIN_ON_BOARD, 2, (Effort(16, 9),))


def dispersed(flown, distributions):
    groups = {}
    for key, distribution in distributions.items():
        group, name = key.split(".")
        groups.setdefault(group, {})[name] = distribution
    return replace(flown, dispersions=groups)


def program_of(flown, name="champion_27_rehearsed", **how):
    controller = from_fuzzy(serialize.load(SHIPPED[name]))
    return of_all_flights(flown, lambda each: translate(each, controller, **how))


def typical(flown, key):
    """A distribution about what a mission has."""
    group, name = key.split(".")
    value = getattr(getattr(flown, group), name) or 1e-3
    return {"kind": "uniform", "low": 0.5 * value, "high": 2.0 * value}


@pytest.mark.parametrize("is_in_time", [False, True])
def test_what_errs_is_dispersed_and_no_command_differs(is_in_time, tmp_path):
    time = {"correlation_s": 300.0} if is_in_time else {}
    keys = OF_REALITY if is_in_time else [key for key in OF_REALITY if not key.startswith("actuators.")]
    drawn = dispersed(NOISY, {key: typical(NOISY, key) | time for key in keys})
    program, starts = program_of(drawn), random_starts(2, seed=3)
    assert program.planner is not None
    assert program.mission == drawn
    assert export(program, starts, tmp_path / "written").num_different == 0
    log, usual = (fly_logged(each, program.controller, starts[0]) for each in (drawn, NOISY))
    assert np.any(log.force_commanded_n != usual.force_commanded_n)


def test_a_torque_is_the_truth_alone(tmp_path):
    drawn = dispersed(EXACT, TORQUE)
    program = program_of(drawn)
    assert export(program, random_starts(2, seed=3), tmp_path / "written").num_different == 0


def test_what_a_controller_knows_is_refused_by_name():
    with pytest.raises(NotTranslatableError, match=r"on deputy\.mass_kg, .*; leave these dispersions out"):
        program_of(dispersed(EXACT, MASS | TORQUE))
    orbit = {"orbit.mean_motion_rad_s": {"kind": "uniform", "low": 1.0e-3, "high": 1.1e-3}}
    with pytest.raises(NotTranslatableError, match=r"on deputy\.mass_kg and orbit\.mean_motion_rad_s, "):
        program_of(dispersed(EXACT, MASS | orbit))


def test_rules_that_do_not_read_a_mass_are_exported_whatever_it_is(tmp_path):
    drawn = dispersed(EXACT, MASS)
    program = program_of(drawn, rules_alone=True)
    assert program.planner is None
    assert (
        export(program_of(drawn, "champion_27"), random_starts(2, seed=3), tmp_path / "it").num_different == 0
    )


def test_an_impossible_draw_is_refused():
    negative = {"deputy.max_torque_n_m": {"kind": "uniform", "low": -0.01, "high": 0.01}}
    with pytest.raises(SettingError, match="limit its distribution by low and high"):
        program_of(dispersed(EXACT, negative))
