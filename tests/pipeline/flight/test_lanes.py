"""A flight is the same to the last bit alone, in any company, in any order, on any number of threads."""

from dataclasses import fields, replace
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from fis_tools.engines.kernel import LANES
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import open_loop
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.population import fly_population, lanes_for
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state import arrays
from pipeline.flight.state.log import Outcomes
from pipeline.flight.world.pack import pack_world
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import STEERING, mission, random_starts
from tests.pipeline.flight.departures import FIXES, REAL, TUMBLING, VARYING
from tests.pipeline.flight.guarded import EARLY
from tests.pipeline.flight.missions import FULL_INERTIA

PLAN = open_loop("plan", np.random.default_rng(2).normal(0.0, 0.02, (90, 3)))

WILD = open_loop("wild", np.random.default_rng(3).normal(0.0, 0.3, (360, 3)))

#: more than fill two rows of lanes; some pass poles, one inspects everything and coasts
STARTS = [*random_starts(LANES, 11), *cases.OVER_POLES, cases.COMPLETED, *random_starts(LANES, 12)]
#: each with its own errors, where there are any
STARTS = [replace(start, noise=(3, 0, case)) for case, start in enumerate(STARTS)]

ERRING = mission(navigation=FIXES, actuators=REAL, safety=vars(EARLY), duration_s=600.0)
CASES = {
    "paper": (mission(), STEERING),
    "clusters": (mission(guidance={"kind": "clusters"}), STEERING),
    "clusters on a tumbling chief, ideal pointing": (
        mission(guidance={"kind": "clusters"}, chief=TUMBLING, attitude={"mode": "ideal"}, duration_s=900.0),
        STEERING,
    ),
    "ball that is sometimes fast": (mission(deputy={"inertia_kg_m2": cases.ball(0.4)}), cases.MIXED),
    "full inertia, narrow limits": (
        mission(deputy={"inertia_kg_m2": FULL_INERTIA, "min_distance_m": 64.0, "max_distance_m": 80.0}),
        STEERING,
    ),
    "pole blending": (mission(attitude={"pole_blending": True}), STEERING),
    "Hill axes": (mission(), cases.RESTORING),
    "plan": (mission(duration_s=900.0), PLAN),
    "safety layer": (mission(safety=EARLY), WILD),
    "fixes and thrusters with errors": (ERRING, STEERING),
    "errors that vary": (replace(ERRING, dispersions=VARYING), STEERING),
}


def fly(what, controller, starts, workers=1):
    """Outcomes as rows, a column for each of their fields, and tracks."""
    tracks = np.full((len(starts), what.num_controls + 1, 3), np.nan, dtype=np.float32)
    outcomes = fly_all(what, controller, starts, workers, tracks)
    return np.column_stack([values.astype(np.float64) for values in vars(outcomes).values()]), tracks


@pytest.mark.parametrize("name", CASES)
def test_alone_in_company_in_any_order_on_any_number_of_threads_logged_or_not(name):
    what, controller = CASES[name]
    rows, tracks = fly(what, controller, STARTS)
    assert len(np.unique(rows, axis=0)) == len(STARTS)
    order = np.random.default_rng(5).permutation(len(STARTS))[: 2 * LANES - 3]
    some = fly(what, controller, [STARTS[index] for index in order])
    np.testing.assert_equal(some, (rows[order], tracks[order]))
    for workers in (2, 3):
        np.testing.assert_equal(fly(what, controller, STARTS, workers), (rows, tracks))
    for index in (0, LANES, LANES + 1, LANES + 3, len(STARTS) - 1):
        alone = fly(what, controller, [STARTS[index]])
        np.testing.assert_equal(alone, (rows[[index]], tracks[[index]]))
        row = rows[index]
        log = fly_logged(what, controller, STARTS[index])
        np.testing.assert_array_equal(log.position_m.astype(np.float32), tracks[index])
        counts = log.is_inspected[-1].sum(), log.is_inspectable.sum()
        assert tuple(row[:3]) == (log.delta_v_m_s[-1], *counts)
        distance = np.linalg.norm(log.position_m, axis=1)
        nearest, farthest = what.deputy.min_distance_m, what.deputy.max_distance_m
        outside = np.maximum(nearest - distance, distance - farthest)[1:].max(initial=0.0)
        held = distance.mean(), distance.min(), distance.max(), outside
        np.testing.assert_allclose(row[3:7], held, rtol=1e-12)
        assert row[7] == np.count_nonzero(log.safety_limit)
        changed = np.abs(log.safety_force_hill_n).sum() * what.control_period_s / what.deputy.mass_kg
        np.testing.assert_allclose(row[8], changed, rtol=1e-12)
    if "narrow" in name:
        assert 0 < np.count_nonzero(rows[:, 6]) < len(STARTS)


def test_a_population_flies_from_few_starts_as_one_controller_does():
    what, controller = mission(duration_s=600.0), STEERING
    starts = STARTS[LANES - 5 : LANES + 2]
    numbers = controller.numbers
    two = replace(numbers, values=numbers.values.repeat(2, axis=0), rules=numbers.rules.repeat(2, axis=0))
    world, law, drawn = pack_world(what), law_of(controller, what), cases_of(what, starts)
    many = fly_population(world, law, two, drawn, lanes=lanes_for(len(starts)))
    assert lanes_for(len(starts)) < lanes_for(LANES) == LANES
    rows = np.stack([values.astype(np.float64) for values in vars(many).values()], axis=-1)
    np.testing.assert_array_equal(rows, [fly(what, controller, starts)[0]] * 2)


@pytest.mark.parametrize("workers", [1, 3])
def test_without_starts_there_are_no_outcomes(workers):
    assert fly(*CASES["paper"], [], workers)[0].shape == (0, len(fields(Outcomes)))


def test_elements_of_arrays_are_told_by_our_own_table(monkeypatch):
    """NumPy's aliases of array types tell them in one way before version 2.5, and in another since."""

    class Alias:
        """Tells nothing."""

    class Kind(NamedTuple):
        values: Annotated[Alias, "P", 2]

    monkeypatch.setitem(arrays.ELEMENTS, Alias, np.int64)
    values = arrays.allocated(Kind, {"P": 3}).values
    assert (values.shape, values.dtype) == ((3, 2), np.int64)
