"""Controllers that decide less often than they could fire."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.controllers.source import load
from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy
from pipeline.flight.fly.simulation import fly_all, fly_logged
from tests.pipeline.flight.cases import HURRYING, PAUSING, STARTS, mission
from tests.pipeline.flight.guarded import PASSIVE, guarded, starts_at_rest


def deciding(controller: Controller, period: str) -> Controller:
    fuzzy = controller.fuzzy
    assert isinstance(fuzzy, FuzzyController)
    attributes = dict(fuzzy.attributes) | {"decision_period_s": period}
    return from_fuzzy(replace(fuzzy, attributes=tuple(sorted(attributes.items()))))


def test_a_push_lasts_one_control_period_and_nothing_is_fired_until_the_next_decision() -> None:
    for start in STARTS:
        log = fly_logged(mission(), PAUSING, start)
        decides = np.arange(len(log.is_decided)) % 3 == 0
        assert not log.is_decided[~decides].any()
        assert not log.force_hill_n[~decides].any()
        assert not log.fis_output_n[~decides].any()
        np.testing.assert_array_equal(log.is_decided[decides], ~log.is_inspected[:-1][decides].all(axis=1))
        assert log.force_hill_n[decides].any(axis=1).sum() > 5


@pytest.mark.parametrize("period", ["0", "10", "10.0"])
def test_a_decision_in_each_period_is_the_default(period: str) -> None:
    flown, expected = (fly_all(mission(), one, STARTS) for one in (deciding(HURRYING, period), HURRYING))
    for name, values in vars(flown).items():
        np.testing.assert_array_equal(values, vars(expected)[name], err_msg=name)


def test_the_safety_layer_acts_between_decisions_too() -> None:
    changed = [
        np.flatnonzero(fly_logged(guarded(PASSIVE), PAUSING, start).safety_limit)
        for start in starts_at_rest(6, 47)
    ]
    assert any((periods % 3 != 0).any() for periods in changed)


@pytest.mark.parametrize("is_written_out", [True, False])
@pytest.mark.parametrize("period", ["25", "4"])
def test_decisions_off_the_clock_are_told_before_the_flight(
    is_written_out: bool, period: str, tmp_path: Path
) -> None:
    controller = deciding(HURRYING, period)
    assert controller.fuzzy is not None
    text, path = serialize.dump_yaml(controller.fuzzy), tmp_path / "off.yaml"
    path.write_text(text)
    message = rf"has decision_period_s {period}; give a whole number of control periods of 10 s"
    with pytest.raises(ControllerError, match=message):
        load(yaml.safe_load(text) if is_written_out else {"path": str(path)}, mission())
    with pytest.raises(ControllerError, match=message):
        fly_all(mission(), controller, STARTS)
