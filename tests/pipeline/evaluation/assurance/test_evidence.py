"""Evidence as data."""

import numpy as np
import pytest

from pipeline.evaluation.assurance.evidence import histogram, joint_claim


@pytest.mark.parametrize("shift", [-9.0, -0.3, 0.0, 0.4, 7.0])
def test_every_margin_is_counted_in_bins_of_equal_width(shift: float) -> None:
    margins = np.random.default_rng(5).normal(shift, 1.0, 500)
    drawn = histogram(margins)
    edges = np.array(drawn["edges"])
    assert sum(drawn["counts"]) == len(margins)
    assert edges[0] <= margins.min() <= margins.max() <= edges[-1]
    np.testing.assert_allclose(np.diff(edges), edges[1] - edges[0], rtol=1e-9)
    assert (0.0 in edges) == (margins.min() < 0.0 < margins.max())


def test_equal_margins_have_a_bin() -> None:
    assert sum(histogram(np.full(7, 2.5))["counts"]) == 7


def test_risks_of_claims_that_flights_show_add_up_and_proofs_have_none() -> None:
    def entry(name: str, verdict: str, confidence: float | None, *proofs: bool) -> dict[str, object]:
        methods = {str(number): {"is_proof": is_proof} for number, is_proof in enumerate(proofs)}
        return {"id": name, "verdict": verdict, "confidence": confidence, "methods": methods}

    entries = [
        entry("R1", "shown", 0.99, False),
        entry("R2", "shown", 0.95, False, True),
        entry("R3", "shown", 0.96, False, False),
        entry("R4", "refuted", 0.99, False),
        entry("R5", "shown", None, False),
    ]
    joint = joint_claim(entries)
    assert joint is not None
    assert joint["requirements"] == ["R1", "R3"]
    assert joint["confidence"] == pytest.approx(1.0 - 0.01 - 0.04)
    assert joint_claim(entries[1:]) is None
