"""Mixtures of kernels against SciPy's wrapped Cauchy law and integrals of their densities."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest, wrapcauchy

from pipeline.evaluation.mixture import UNIFORM, KernelMixture, Kernels, fitted

PERIODIC = np.array([True, False])
KERNELS = Kernels(np.array([[0.95, 0.02], [0.1, 0.7]]), np.array([[0.03, 0.05], [0.2, 0.01]]))


def along(gene, values, kernels=KERNELS):
    """The density of one gene alone, of kernels without uniform draws."""
    alone = Kernels(kernels.centres[:, [gene]], kernels.widths[:, [gene]])
    return KernelMixture([alone], [1.0], PERIODIC[[gene]]).density(np.reshape(values, (-1, 1)))


def test_around_a_turn_it_is_scipys_wrapped_cauchy_law():
    for number, width in enumerate(KERNELS.widths[:, 0]):
        single = Kernels(KERNELS.centres[[number]], KERNELS.widths[[number]])
        genes = np.linspace(0.0, 1.0, 41)
        turns = 2.0 * np.pi * (genes - single.centres[0, 0]) % (2.0 * np.pi)
        expected = 2.0 * np.pi * wrapcauchy.pdf(turns, np.exp(-2.0 * np.pi * width))
        np.testing.assert_allclose(along(0, genes, single), expected, rtol=1e-9)


@pytest.mark.parametrize("gene", [0, 1])
def test_draws_have_the_density_which_integrates_to_one(gene):
    centres = KERNELS.centres[:, gene]

    def integral(high):
        return quad(
            lambda value: along(gene, value)[0], 0.0, high, points=centres[centres < high], limit=200
        )[0]

    assert integral(1.0) == pytest.approx(1.0, abs=1e-7)
    drawn = KernelMixture([KERNELS], [1.0], PERIODIC).draw(400, np.random.default_rng(1))
    assert drawn.min() >= 0.0
    assert drawn.max() <= 1.0
    assert kstest(drawn[:, gene], np.vectorize(integral)).pvalue > 1e-3


def test_groups_and_uniform_draws_have_their_weights():
    other = Kernels(np.full((3, 2), 0.5), np.full((3, 2), 1e-5))
    proposal = KernelMixture([KERNELS, other], [0.5, 0.3], PERIODIC)
    genes = np.random.default_rng(2).random((50, 2))
    parts = [KernelMixture([each], [1.0], PERIODIC).density(genes) for each in (KERNELS, other)]
    np.testing.assert_allclose(proposal.density(genes), 0.5 * parts[0] + 0.3 * parts[1] + 0.2)
    drawn = proposal.draw(4000, np.random.default_rng(3))
    near = (np.abs(drawn - 0.5) < 0.01).all(axis=1).mean()
    assert near == pytest.approx(0.3, abs=0.03)


def test_kernels_are_as_wide_as_makes_unseen_cases_likely():
    generator = np.random.default_rng(4)
    seen, unseen = ((0.02 * generator.standard_normal((300, 2)) + [0.0, 0.4]) % 1.0 for _ in range(2))
    kernels = fitted(seen, PERIODIC)
    likelihoods = [
        np.log(
            UNIFORM + KernelMixture([Kernels(seen, factor * kernels.widths)], [1.0], PERIODIC).density(unseen)
        ).mean()
        for factor in (0.2, 1.0, 5.0)
    ]
    assert np.argmax(likelihoods) == 1
    # the entropy of the law that cases have is the best there is
    best = -np.log(2.0 * np.pi * np.e * 0.02**2)
    assert best - 0.8 < likelihoods[1] < best
    assert fitted(seen[:7], PERIODIC) is None
