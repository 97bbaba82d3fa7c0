"""Functions and controllers, imitated; and how near imitations are."""

import numpy as np
import pytest

from fis_tools.engines.compiler import compile
from fis_tools.learning import imitate
from fis_tools.source import read_controller
from tests.places import PROJECT

RANGES = {"position (m)": (-1.0, 1.0), "velocity (m/s)": (-2.0, 2.0)}


def test_a_plane_is_imitated_to_the_digits_that_are_kept() -> None:
    """A line is a sum of tents: every kind of number says it, up to rounding to a thousandth."""
    for consequents in ("constants", "linear"):
        found = imitate(
            lambda position, velocity: -2.0 * position - 0.5 * velocity,
            RANGES,
            output="force",
            consequents=consequents,
        )
        assert [(v.name, v.unit) for v in found.system.inputs] == [("position", "m"), ("velocity", "m/s")]
        assert found.system.outputs[0].name == "force"
        assert found.largest < 0.01 * 6.0
        at = np.array([[0.3, -1.1]])
        assert compile(found.system)(at)[0, 0] == pytest.approx(-0.05, abs=found.largest)


def test_the_error_told_is_that_on_other_samples() -> None:
    found = imitate(lambda a: np.sin(3.0 * a), {"a": (-1.0, 1.0)}, terms=7, num_samples=500)
    a = np.linspace(-1.0, 1.0, 4001)
    miss = compile(found.system)({"a": a})["output"] - np.sin(3.0 * a)
    assert found.root_mean_square == pytest.approx(np.sqrt(np.mean(miss**2)), rel=0.1)
    assert found.largest == pytest.approx(np.abs(miss).max(), rel=0.2)
    assert found.largest < 0.15


def test_more_terms_imitate_a_fuzzy_system_better() -> None:
    tipper = PROJECT / "docs" / "examples" / "tipper.fis"
    coarse, fine = (imitate(tipper, terms=terms, num_samples=600, tune=False) for terms in (2, 5))
    assert fine.root_mean_square < 0.75 * coarse.root_mean_square
    names = [v.name for v in read_controller(tipper).systems[0].inputs]
    assert [v.name for v in fine.system.inputs] == names
    assert fine.system.outputs[0].name == "tip"
    assert imitate(tipper, terms=2, num_samples=600, tune=False).system == coarse.system


@pytest.mark.parametrize(
    ("function", "ranges", "told"),
    [
        (np.sin, None, "a function does not say its inputs"),
        (np.sin, {"a": (1.0, 1.0)}, "give two finite numbers that ascend"),
        (lambda a: 1.0, {"a": (0.0, 1.0)}, "pass numpy.vectorize"),
        (lambda a: np.where(a > 0.5, np.nan, a), {"a": (0.0, 1.0)}, "returns no finite number at"),
        (PROJECT / "docs" / "examples" / "tipper.fis", {"a": (0.0, 1.0)}, "pass those of service, food"),
        (PROJECT / "conf" / "controller" / "paper_champion.yaml", None, "there are several outputs"),
    ],
)
def test_what_cannot_be_imitated_is_told(function, ranges, told):
    with pytest.raises(ValueError, match=told):
        imitate(function, ranges)


def test_more_rules_than_anybody_reads_are_refused():
    ranges = dict.fromkeys("abcdef", (0.0, 1.0))
    with pytest.raises(ValueError, match="5 terms of 6 inputs are up to 15,625 rules"):
        imitate(lambda *columns: sum(columns), ranges, terms=5, max_inputs=6)
