"""Files mean what their programs make of them: stored and published values, Octave and fuzzylite."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import dialects
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from tests.fis_tools import step_by_step
from tests.fis_tools.formats.exchange import stored
from tests.fis_tools.sample_controllers import EXAMPLES
from tests.places import PROJECT
from tests.programs import program

PAGE = PROJECT / "docs" / "how-to" / "exchange-files.md"
KINDS = {"pyfuzzylite": "fll", "jFuzzyLogic": "fcl"}


@pytest.mark.parametrize("name", KINDS)
def test_stored_values_of_programs_are_ours(name):
    """Also beyond the ranges of inputs; by the engine for arrays and the one that keeps every step."""
    cases = stored.load()[name]["cases"]
    assert len(cases) == stored.FILES
    for case in cases:
        system = stored.only(case["text"], KINDS[name])
        rows = np.array(case["inputs"])
        expected = np.array(case["outputs"], dtype=np.float64)
        step_by_step.assert_near(compile(system)(rows), expected, system)
        step_by_step.assert_near(step_by_step.evaluate(system, rows[:2]), expected[:2], system)


def test_published_values_are_ours_to_all_digits():
    for case in stored.load()["MATLAB"]["cases"]:
        system = serialize.load(PROJECT / case["file"]).systems[0]
        for row, expected in zip(case["inputs"], case["outputs"], strict=True):
            answers = compile(system)(np.array([row]))[0]
            assert [f"{value:.4f}" for value in answers] == [f"{value:.4f}" for value in expected]


def test_the_page_says_what_was_compared():
    page = PAGE.read_text(encoding="utf-8")
    for row in stored.table().splitlines():
        assert row in page


def test_octave_and_fuzzylite_compute_what_we_do_of_the_examples():
    """At each program's own points; Octave weighs ends by half, fuzzylite 6 drops strengths of 1e-6."""
    program("octave", "octave")
    for file in (EXAMPLES / "tipper.fis", Path(__file__).with_name("denied.fis")):
        (system,) = serialize.load(file).systems
        rows = dialects.samples(system, 2, is_inside=True)
        theirs = dialects.octave(file, system, rows)
        step_by_step.assert_near(dialects.as_octave(system, rows), theirs, system)
    (dimmer,) = serialize.load(EXAMPLES / "dimmer.fll").systems
    rows = dialects.samples(dimmer, 300, is_inside=False)
    theirs = dialects.fuzzylite(EXAMPLES / "dimmer.fll", dimmer, rows)
    step_by_step.assert_near(dialects.as_fuzzylite(dimmer, rows), theirs, dimmer)
