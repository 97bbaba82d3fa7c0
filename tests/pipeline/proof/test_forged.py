"""No forged proof is accepted whose claim is false, as `benchmarks forge` tries at length."""

import pytest

pytest.importorskip("flint", reason="the checker needs python-flint")
from tests import night
from tests.pipeline.proof.forged import STARTS, forge

#: mutants of each certificate; each takes up to half a second where it is accepted
QUICK, LONG = 40, night.count(20, 60)


def count_false(name: str, number: int, folder) -> tuple[int, int]:
    """Forge a certificate; return the mutants that were refused, and those that are false."""
    results = list(forge(name, number, 11, folder))
    assert len(results) == number
    return results.count(None), sum(result.num_false > 0 for result in results if result is not None)


def test_forged_proofs_are_refused_or_true(tmp_path):
    refused, false = count_false("start on a cell's edge", QUICK, tmp_path)
    assert false == 0
    assert refused > QUICK / 2


@pytest.mark.slow
@pytest.mark.parametrize("name", STARTS)
def test_many_forged_proofs_are_refused_or_true(name, tmp_path):
    refused, false = count_false(name, LONG, tmp_path)
    assert false == 0
    assert refused > LONG / 2
