"""What other readers do without a word: spikes between points are lost, coarse universes change answers."""

import numpy as np

from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fll
from tests.fis_tools.formats.exchange.systems import alone, flat_system

#: Of the range; 1.2e-5 was measured, from straight lines between 1001 points of inputs.
TOLERANCE = 5e-5

HEAD = """[System]
Name='spiky'
Type='mamdani'
NumInputs=1
NumOutputs=1
NumRules=2
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='mom'
"""
BODY = """[Input1]
Name='x'
Range=[0 3]
NumMFs=2
MF1='spike':'trimf',[2 2 2]
MF2='plateau':'trapmf',[0.123456 0.123456 1.1 1.1]
[Output1]
Name='y'
Range=[0 100]
NumMFs=2
MF1='a':'trimf',[60 70 80]
MF2='b':'trapmf',[15.5 15.5 25.25 25.25]
[Rules]
1, 1 (1) : 1
2, 2 (1) : 1
"""


def test_spikes_and_walls_of_inputs_between_points_are_exact() -> None:
    system = serialize.loads(HEAD + BODY, "fis").systems[0]
    inside = [np.nextafter(0.123456, 1.0), 0.123456, 0.5, 1.1, np.nextafter(1.1, 0.0)]
    outside = [0.1234, 0.12345599, 1.1000001, 1.9999999, 2.0000001]
    y = compile(system)({"x": [2.0, *inside, *outside]})["y"]
    assert y[0] == 70.0
    assert (y[1:6] < 26.0).all()
    np.testing.assert_array_equal(y[6:], 50.0)


def test_corners_lie_on_evenly_spaced_points_where_some_number_of_them_does() -> None:
    text = HEAD + BODY.replace("[2 2 2]", "[1 2 3]").replace("[0.123456 0.123456 1.1 1.1]", "[0 0 0.7 1]")
    (variable,) = serialize.loads(text, "fis").systems[0].inputs
    assert variable.points is None
    assert np.abs(np.subtract.outer(variable.universe, [0.7, 1.0, 2.0])).min(axis=0).max() < 1e-12


def test_walls_of_outputs_between_points_are_told() -> None:
    notes = serialize.reads(HEAD + BODY, "fis").assumptions
    assert any("y b jumps at 15.5, between two points of its universe" in sentence for sentence in notes)
    notes = serialize.reads(HEAD + BODY.replace("[60 70 80]", "[70.5 70.5 70.5]"), "fis").assumptions
    assert any("y a jumps at 70.5" in each and "its rules conclude nothing" in each for each in notes)


def test_an_fll_file_without_a_resolution_has_fuzzylites_own() -> None:
    text = fll.write(alone(flat_system())).text
    text = "\n".join(line for line in text.splitlines() if "carries" not in line)
    resolution = flat_system().outputs[0].num_points - 1
    bare = serialize.reads(text.replace(f"Centroid {resolution}", "Centroid"), "fll")
    assert [output.num_points for output in bare.controller.systems[0].outputs] == [1001, 1001]
    assert "1001 for an output that states none" in bare.assumptions[0]
