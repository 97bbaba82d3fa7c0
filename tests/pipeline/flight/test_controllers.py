"""Fuzzy controllers that cannot fly, told why; and plans of forces."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from pipeline.controllers.source import load
from pipeline.flight.control.controller import ControllerError, coast, from_fuzzy, law_of, open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.signals import AXES, slot
from tests.pipeline.flight.cases import HURRYING, STARTS, mission, with_attributes
from tests.pipeline.flight.missions import steering_systems

BODY = (("force_axes", "body"),)
X, Y, Z = steering_systems()
#: four control periods
SHORT = mission(duration_s=40.0)


def renamed(system: FuzzySystem, **changes: str) -> FuzzySystem:
    """A system whose first input is called or measured otherwise."""
    return replace(system, inputs=(replace(system.inputs[0], **changes), *system.inputs[1:]))


def driving(system: FuzzySystem, *outputs: Variable) -> FuzzySystem:
    return replace(system, outputs=outputs)


@pytest.mark.parametrize(
    ("systems", "attributes", "message"),
    [
        ((X, Y, Z), (), r"'tried' has force_axes ''; set the attribute to body or hill"),
        ((X,), (("force_axes", "chief"),), r"force_axes 'chief'; set the attribute to body or hill"),
        ((), BODY, r"'tried' has no system; give one to three"),
        ((renamed(X, name="range"),), BODY, r"'steer_x' senses 'range', which is no signal; the signals"),
        ((renamed(X, unit="km"),), BODY, r"'steer_x' takes 'distance' in 'km'; this signal comes in 'm'"),
        ((driving(X, replace(X.outputs[0], name="thrust")),), BODY, r"drives thrust; each system drives"),
        ((driving(X, X.outputs[0], Y.outputs[0]),), BODY, r"drives force_x, force_y; each system drives"),
        ((driving(X),), BODY, r"drives nothing; each system drives one of"),
        ((X, driving(Y, X.outputs[0])), BODY, r"'steer_x' and 'steer_y' both drive force_x; give each axis"),
        ((driving(X, replace(X.outputs[0], unit="mN")),), BODY, r"'force_x' of 'steer_x' is in 'mN'; use N"),
        ((replace(X, and_operator="product"),), BODY, r"'tried' cannot fly: system 'steer_x' cannot be"),
    ],
)
def test_what_cannot_fly_is_told_why(systems, attributes, message):
    with pytest.raises(ControllerError, match=message):
        from_fuzzy(FuzzyController("tried", systems, attributes))


def test_a_controller_is_wired_by_the_names_of_its_variables():
    law = law_of(from_fuzzy(FuzzyController("tried", (Z, X), BODY)), mission())
    np.testing.assert_array_equal(law.axes, [AXES["force_z"], AXES["force_x"]])
    names = ("eta_u", "velocity_body_z"), ("distance", "velocity_body_x")
    np.testing.assert_array_equal(law.signals[:, :2], [list(map(slot, pair)) for pair in names])
    assert not law.has_plan


def test_a_plan_is_flown_without_force_after_its_last_row_and_none_is_longer_than_the_flight():
    law = law_of(open_loop("plan", np.ones((2, 3))), SHORT)
    np.testing.assert_array_equal(law.plans.forces, [[[1, 1, 1], [1, 1, 1], [0, 0, 0], [0, 0, 0]]])
    assert law.has_plan
    assert law_of(coast(), SHORT).plans.forces.shape == (1, 4, 3)
    with pytest.raises(ControllerError, match=r"'plan' has 5 forces, the flight 4 control periods; shorten"):
        law_of(open_loop("plan", np.ones((5, 3))), SHORT)


@pytest.mark.parametrize("period", ["25", "4"])
def test_decisions_off_the_clock_are_told_before_the_flight(period, tmp_path):
    controller = with_attributes(HURRYING, decision_period_s=period)
    text, path = serialize.dump_yaml(controller.fuzzy), tmp_path / "off.yaml"
    path.write_text(text)
    message = rf"has decision_period_s {period}; give a whole number of control periods of 10 s"
    for given in (yaml.safe_load(text), {"path": str(path)}):
        with pytest.raises(ControllerError, match=message):
            load(given, mission())
    with pytest.raises(ControllerError, match=message):
        fly_all(mission(), controller, STARTS)
