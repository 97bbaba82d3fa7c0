"""Operational domains by hand: the box, when inputs left it, and its file."""

import json

import numpy as np
import pytest

from fis_tools.analysis.domain import as_mapping, box_of, departures, from_mapping
from fis_tools.errors import ControllerFileError
from tests.fis_tools.sample_controllers import force_x_system

SYSTEM = force_x_system()
MET = np.random.default_rng(1).uniform(-1.0, 1.0, (50, len(SYSTEM.inputs)))
BOX = box_of(SYSTEM, MET)


def test_the_box_holds_what_was_met_and_no_more():
    assert BOX.low == tuple(MET.min(axis=0))
    assert BOX.high == tuple(MET.max(axis=0))
    assert BOX.num_samples == 50
    assert not BOX.beyond(MET).any()
    just = np.array(BOX.high)
    just[1] = np.nextafter(just[1], np.inf)
    assert (BOX.beyond(just[np.newaxis]) > 0.0).tolist() == [[False, True] + [False] * (len(just) - 2)]


def test_each_stretch_outside_is_a_departure_with_its_farthest_value():
    inputs = np.zeros((8, len(SYSTEM.inputs)))
    inputs[2:5, 0] = [1.5, 3.0, 2.0]
    inputs[7, 0] = -4.0
    inputs[0, 1] = 9.0
    found = departures(BOX, 10.0 * np.arange(8), inputs)
    names = [variable.name for variable in SYSTEM.inputs]
    assert [(one.name, one.first_s, one.last_s, one.value) for one in found] == [
        (names[1], 0.0, 0.0, 9.0),
        (names[0], 20.0, 40.0, 3.0),
        (names[0], 70.0, 70.0, -4.0),
    ]
    assert (found[1].low, found[1].high) == (BOX.low[0], BOX.high[0])
    assert departures(BOX, np.empty(0), np.empty((0, len(names)))) == ()


def test_a_domain_is_what_its_file_says():
    told = json.loads(json.dumps(as_mapping([BOX])))
    assert from_mapping(told, "domain.json") == (BOX,)


@pytest.mark.parametrize("told", [{}, [], {"schema": "operational-domain", "schema_version": 2}, None])
def test_something_else_is_refused(told):
    with pytest.raises(ControllerFileError, match=r"that\.json holds no operational domain"):
        from_mapping(told, "that.json")
