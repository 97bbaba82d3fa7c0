"""Evidence as data."""

import numpy as np
import pytest

from pipeline.evaluation.assurance.evidence import histogram


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
