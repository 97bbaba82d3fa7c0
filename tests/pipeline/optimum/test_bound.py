"""The bounds are those of linear programs, and hold."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from pipeline.optimum.bound import can_cover, delta_v_bound, price_pair, sample_costs, slopes_of, unavoidable
from tests.pipeline.optimum.cases import problem

SHORT = "duration_s=400.0"


def least_by_linear_program(case, demands) -> float:
    """Return what several (point, sample) demands take, m/s, limits aside."""
    rows, missing = [], []
    for point, k in demands:
        normal = case.normals[k, :, point]
        slopes = np.zeros((case.num_controls, 3))
        for i in range(k):
            slopes[i] = normal @ case.gain[k - i]
        rows.append(np.r_[-slopes.ravel(), slopes.ravel()])
        missing.append(normal @ case.free[k] - case.radius)
    solved = linprog(np.full(len(rows[0]), case.delta_v_per_force), A_ub=np.array(rows), b_ub=missing)
    return solved.fun if solved.status == 0 else np.inf


def test_one_point_takes_what_the_linear_program_says():
    case = problem(0, SHORT)
    costs = sample_costs(case)
    assert np.array_equal(np.isinf(costs.min(axis=0)), ~case.is_lit.any(axis=0))
    alone = np.where(np.isinf(costs.min(axis=0)), -1.0, costs.min(axis=0))
    hardest = int(alone.argmax())
    lit = np.flatnonzero(case.is_lit[1:, hardest]) + 1
    least = min(least_by_linear_program(case, [(hardest, int(k))]) for k in lit)
    assert least > 0
    assert alone[hardest] == pytest.approx(least, rel=1e-7)


def test_so_many_points_as_are_never_lit_cannot_be_seen():
    case = problem(0, SHORT)
    ever = int(case.is_lit.any(axis=0).sum())
    assert np.isfinite(delta_v_bound(case, ever))
    assert np.isinf(delta_v_bound(case, ever + 1))


def test_a_pair_takes_no_more_than_the_linear_program_says_and_nearly_as_much():
    case = problem(1, "duration_s=160.0")
    costs = sample_costs(case)
    finite = np.where(np.isinf(costs.min(axis=0)), -1.0, costs.min(axis=0))
    one = int(finite.argmax())
    # the other as far round as there is one that is lit and unseen
    other = int(np.where(finite > 0.0, case.normals[0, :, one] @ case.normals[0], 2.0).argmin())
    weights = np.linspace(0.0, np.pi / 2, 41)
    missing = (case.radius - np.einsum("ka,kaj->kj", case.free, case.normals)) * case.delta_v_per_force
    pair = price_pair(
        *(slopes_of(case.gain, np.ascontiguousarray(case.normals[:, :, j])) for j in (one, other)),
        *(np.ascontiguousarray(missing[:, j]) for j in (one, other)),
        *(np.ascontiguousarray(costs[:, j]) for j in (one, other)),
        weights,
        np.inf,
    )
    when = [np.flatnonzero(case.is_lit[1:, j]) + 1 for j in (one, other)]
    true = min(least_by_linear_program(case, [(one, k), (other, m)]) for k, m in product(*when))
    assert max(finite[one], finite[other]) <= pair <= true * (1 + 1e-9)
    assert pair >= 0.98 * true


def test_edges_are_covered_by_vertices():
    triangle = [(0, 1), (1, 2), (0, 2)]
    assert not can_cover(triangle, 1)
    assert can_cover(triangle, 2)
    assert can_cover([(3, 3)], 1)
    assert not can_cover([(3, 3), (4, 4)], 1)
    assert can_cover([], 0)


def test_what_is_left_when_the_worst_are_let_go():
    takes = {(0, 0): 1.0, (1, 1): 2.0, (2, 2): 3.0, (0, 1): 5.0, (1, 2): 6.0, (0, 2): 3.0}
    assert unavoidable(takes, 0) == 6.0
    assert unavoidable(takes, 1) == 3.0
    assert unavoidable(takes, 2) == 1.0
    assert unavoidable(takes, 3) == 0.0


def test_pairs_raise_the_bound_and_the_ceiling_holds():
    case = problem(1, "sun=random")
    alone = np.sort(sample_costs(case).min(axis=0))[94]
    bound = delta_v_bound(case, 95)
    assert 1.1 * alone < bound < np.inf
    ceiling = 0.5 * (alone + bound)
    assert delta_v_bound(case, 95, ceiling) == pytest.approx(ceiling, rel=1e-8)
