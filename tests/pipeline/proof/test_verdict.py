"""What is proved holds for every flight, and what does not hold is not proved."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fis_tools.engines import interpreter, interval
from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.physics.motion import motion_over
from pipeline.proof.tube import ReachableBox, surface_of
from pipeline.proof.verdict import NotProvable, Theorem, Verdict, limit_fault, prove
from pipeline.stages.prove import theorem_of
from tests.pipeline.proof.cases import job, steady

NUM_FLIGHTS = 24


@pytest.fixture(scope="module")
def experiment():
    return job().experiment


def followed(experiment, controller: FuzzyController, periods: int = 400, **changes) -> Verdict:
    mission = experiment.mission
    motion = motion_over(mission.orbit, mission.deputy, (mission.control_period_s,))
    theorem = replace(theorem_of(experiment), **changes)
    return prove(theorem, controller, motion, 48, periods, lambda done: None)


@pytest.fixture(scope="module")
def shown(experiment) -> Verdict:
    return followed(experiment, steady())


def test_every_flight_stays_in_the_tube_keeps_the_limit_and_arrives(experiment, shown):
    assert shown.fault == ""
    mission, theorem = experiment.mission, theorem_of(experiment)
    controller, generator = from_fuzzy(steady()), np.random.default_rng(3)
    low, high = np.array(theorem.start_low), np.array(theorem.start_high)
    corners = [np.where(generator.integers(0, 2, 6) == 0, low, high) for _ in range(NUM_FLIGHTS // 2)]
    for start in [*corners, *generator.uniform(low, high, (NUM_FLIGHTS // 2, 6))]:
        log = fly_logged(mission, controller, Scenario(start[:3], start[3:], 0.0))
        states = np.hstack([log.position_m, log.velocity_m_s])[: shown.num_periods + 1]
        for step, state in enumerate(states):
            for axis in (0, 1):
                assert is_inside(shown.rows, step, axis, state[axis], state[axis + 3]), (step, axis, start)
        distance, speed = np.linalg.norm(states[:, :3], axis=1), np.linalg.norm(states[:, 3:], axis=1)
        base, slope, offset = theorem.limit
        assert np.all(speed <= base + slope * (distance - offset))
        assert distance[-1] <= shown.distance_m <= theorem.goal[0]
        assert speed[-1] <= shown.speed_m_s <= theorem.goal[1]


def is_inside(rows, step: int, axis: int, position: float, velocity: float) -> bool:
    boxes = rows[(rows[:, 0] == step) & (rows[:, 1] == axis)]
    leaning = velocity + boxes[:, 6] * position
    fits = (
        (boxes[:, 2] <= position)
        & (position <= boxes[:, 3])
        & (boxes[:, 4] <= leaning)
        & (leaning <= boxes[:, 5])
    )
    return bool(fits.any())


def test_rules_that_push_away_are_not_proved(experiment):
    systems = []
    for system in steady().systems:
        (output,) = system.outputs
        # terms have each other's names, so that rules conclude the opposite
        pairs = zip(output.terms, reversed(output.terms), strict=True)
        terms = tuple(replace(term, name=opposite.name) for term, opposite in pairs)
        systems.append(replace(system, outputs=(replace(output, terms=terms),)))
    verdict = followed(experiment, replace(steady(), systems=tuple(systems)), periods=60)
    assert "speeds may reach" in verdict.fault or "time is over" in verdict.fault
    assert verdict.distance_m > 1.5


def test_a_limit_that_flights_break_is_not_proved(experiment):
    verdict = followed(experiment, steady(), limit=(0.1, 0.0, 0.0))
    assert "where 0.1000 m/s are allowed" in verdict.fault
    assert verdict.num_periods < 60


def test_a_time_that_is_too_short_is_said_and_what_held_until_then(experiment, shown):
    verdict = followed(experiment, steady(), periods=20)
    assert verdict.num_periods == 20
    assert verdict.fault.startswith("the time is over")
    np.testing.assert_array_equal(verdict.rows, shown.rows[shown.rows[:, 0] <= 20])


def test_between_samples_more_is_allowed_for_than_at_them():
    theorem = Theorem((0,) * 6, (0,) * 6, (0.2, 0.0, 0.0), (0.5, 0.2), 0.001027, 12.0, 1.0, 1.0)
    now = np.zeros((9, 2))
    now[3] = 0.0, 0.199999
    assert limit_fault(theorem, now, now)
    now[3] = 0.0, 0.1999
    assert limit_fault(theorem, now, now) == ""
    assert limit_fault(replace(theorem, max_force_n=1e-6), now, now)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: replace(c, systems=c.systems[:2]), "force_z"),
        (lambda c: replace(c, attributes=(*c.attributes, ("decision_period_s", "30"))), "dead bands"),
        (lambda c: replace(c, attributes=(("force_axes", "hill"),)), "dead band"),
        (lambda c: replace(c, attributes=(("force_axes", "body"),)), "hill"),
    ],
)
def test_others_are_refused_in_a_sentence(experiment, change, words):
    with pytest.raises(NotProvable, match=words):
        followed(experiment, change(steady()))


DEAD_BAND_N, MOST_N = 0.05, 0.8
SURFACE = surface_of(steady().systems[0], DEAD_BAND_N, MOST_N)


@given(
    low=st.floats(-6.0, 6.0),
    width=st.floats(0.0, 3.0),
    least=st.floats(-0.3, 0.3),
    height=st.floats(0.0, 0.2),
    shear=st.floats(-0.1, 0.1),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_force_leaves_it(low, width, least, height, shear, seed):
    box = ReachableBox(low, low + width, least, least + height, shear)
    plane = SURFACE.plane(box)
    at = np.random.default_rng(seed).uniform(size=(2, 20))
    p, s = low + width * at[0], least + height * at[1]
    v = s - shear * p
    force = interpreter.evaluate(interval.pack(steady().systems[0]), np.stack([p, v], axis=1))[:, 0]
    force = np.clip(np.where(np.abs(force) < DEAD_BAND_N, 0.0, force), -MOST_N, MOST_N)
    flat = plane.constant + plane.per_position * p + plane.per_velocity * v
    assert np.all(np.abs(force - flat) <= plane.residual)
    lowest, highest = plane.ends(box)
    assert np.all((lowest <= force) & (force <= highest))
    assert np.all((box.ends[2] - 1e-12 <= v) & (v <= box.ends[3] + 1e-12))
