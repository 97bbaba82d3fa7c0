"""Programs of least fuel: as SciPy solves them, and by hand."""

import numpy as np
import pytest
from scipy.optimize import linprog

from pipeline.optimum.polish import LEAST_FORCE, PRICE_OF_SLACK, least_forces

FUEL, MAX_FORCE = 0.8, 1.0


@pytest.mark.parametrize("presolves", [True, False])
@pytest.mark.parametrize(("num_rows", "num_forces"), [(1, 1), (5, 12), (40, 9)])
def test_solutions_are_those_of_scipy(num_rows, num_forces, presolves):
    generator = np.random.default_rng(num_rows)
    rows = generator.normal(0.0, 50.0, (num_rows, num_forces))
    rows[generator.random(rows.shape) < 0.3] = 0.0
    most = generator.normal(-10.0, 20.0, num_rows)
    found = least_forces(rows, most, FUEL, MAX_FORCE, presolves=presolves)
    parts = [(0.0, MAX_FORCE)] * (2 * num_forces)
    expected = linprog(
        np.r_[np.full(2 * num_forces, FUEL), np.full(num_rows, PRICE_OF_SLACK)],
        A_ub=np.hstack([rows, -rows, -np.eye(num_rows)]),
        b_ub=most,
        bounds=[*parts, *[(0.0, None)] * num_rows],
    )
    forces = expected.x[:num_forces] - expected.x[num_forces : 2 * num_forces]
    np.testing.assert_allclose(found.forces, forces, atol=2 * LEAST_FORCE)
    assert found.slack == pytest.approx(expected.x[2 * num_forces :].sum(), abs=1e-9)
    np.testing.assert_allclose(found.prices, -expected.ineqlin.marginals, atol=1e-12)


def test_of_two_forces_the_one_that_leads_further_is_fired():
    found = least_forces(np.array([[-20.0, 40.0]]), np.array([-10.0]), FUEL, MAX_FORCE, presolves=False)
    assert found.forces.tolist() == [0.0, -0.25]
    assert found.slack == 0.0
    # a metre more takes 1/40 N more
    assert found.prices == pytest.approx([FUEL / 40.0])


def test_what_no_force_reaches_is_missed_at_its_price():
    found = least_forces(np.array([[-20.0]]), np.array([-50.0]), FUEL, MAX_FORCE, presolves=True)
    assert found.forces.tolist() == [MAX_FORCE]
    assert found.slack == pytest.approx(30.0)
    assert found.prices == pytest.approx([PRICE_OF_SLACK])


@pytest.mark.parametrize(
    ("slope", "most", "max_force"),
    [(np.inf, -10.0, 1.0), (1.0, np.nan, 1.0), (1.0, -10.0, -1.0)],
    ids=["infinite slope", "no bound", "no force within its limits"],
)
def test_a_program_without_a_solution_gives_none(slope, most, max_force):
    assert least_forces(np.array([[slope]]), np.array([most]), FUEL, max_force, presolves=False) is None
