"""Searches for the worst case: what they draw from, that they repeat, that they beat flights at random."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.assurance.campaign import Flights, Outcome
from pipeline.evaluation.assurance.requirements import read
from pipeline.evaluation.assurance.search import CaseSpace, Search, case_space, search, speed
from pipeline.flight.starts import evaluation_scenarios
from pipeline.settings.places import requirements_path
from tests.pipeline.evaluation.assurance.cases import champion, experiment, scenarios

EXPERIMENT = experiment()
KEEP_OUT = read(requirements_path("inspection").read_text(encoding="utf-8"), "").requirements[0]


def small(**changes: object) -> object:
    settings = {"search_starts": 8, "search_population": 5, "search_generations": 2} | changes
    return replace(EXPERIMENT.assurance, **settings)


def test_genes_spread_evenly_give_starts_as_an_evaluation_draws_them():
    space = case_space(EXPERIMENT.monte_carlo, EXPERIMENT.sun)
    genes = np.random.default_rng(1).random((4000, space.num_genes))
    ours = [space.scenario(row) for row in genes]
    theirs = evaluation_scenarios(replace(EXPERIMENT.monte_carlo, num_cases=4000), EXPERIMENT.sun, 3)
    for of in (
        lambda one: one.position_m / np.linalg.norm(one.position_m),
        lambda one: np.array([np.linalg.norm(one.position_m), one.sun_angle_rad]),
    ):
        first, second = np.array([of(one) for one in ours]), np.array([of(one) for one in theirs])
        spread = second.std(axis=0)
        assert np.all(np.abs(first.mean(axis=0) - second.mean(axis=0)) < 0.1 * spread)
        assert np.all(np.abs(first.std(axis=0) / spread - 1.0) < 0.05)
    assert all(not one.velocity_m_s.any() for one in ours)


def test_a_fixed_sun_is_not_searched():
    sun = replace(EXPERIMENT.sun, mode="fixed", angle_deg=90.0)
    space = CaseSpace((50.0, 100.0), sun)
    assert space.num_genes == 3
    assert space.scenario(np.array([1.0, 0.0, 0.5])).sun_angle_rad == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(space.scenario(np.array([1.0, 0.3, 0.5])).position_m, [0, 0, 75], atol=1e-6)


def test_a_search_repeats_and_counts_every_flight():
    flights = Flights(EXPERIMENT.mission, champion())
    space = case_space(EXPERIMENT.monte_carlo, EXPERIMENT.sun)
    one, same, other = (
        search(KEEP_OUT, flights, space, small(), EXPERIMENT.optimizer, 1, number) for number in (0, 0, 1)
    )
    assert len(one.scenarios) == len(one.outcome.margins) == 8 + 3 * 5
    np.testing.assert_array_equal(one.outcome.margins, same.outcome.margins)
    assert not np.array_equal(one.outcome.margins, other.outcome.margins)
    again = flights.judge([one.scenarios[one.worst]], [KEEP_OUT])["R1"]
    assert again.margins[0] == one.outcome.margins.min()


def test_speed_counts_flights_until_the_first_failure():
    def found(margins):
        margins = np.array(margins, dtype=float)
        return Search((None,) * len(margins), Outcome(margins, margins >= 0))

    random = Outcome(np.zeros(300), np.arange(300) >= 3)
    told = speed([found([1, 1, -1, -1]), found([1, 1, 1, 1]), found([-1, 1, 1, 1])], random)
    assert (told.num_found, told.flights_per_find, told.random_flights_per_find) == (2, 4.0, 100.0)
    assert told.ratio == 25.0
    assert told.sentence == (
        "2 of 3 searches find a failure, one in 4 flights; at random one in 100: 25.0 times as many"
    )
    assert speed([found([1])], random).ratio is None


@pytest.mark.slow
def test_known_exits_are_found_faster_than_at_random():
    """At random champion_any_sun comes too near in 6 of 10,000 cases, 1 of 1,667."""
    flights = Flights(EXPERIMENT.mission, champion())
    space = case_space(EXPERIMENT.monte_carlo, EXPERIMENT.sun)
    searches = [
        search(KEEP_OUT, flights, space, EXPERIMENT.assurance, EXPERIMENT.optimizer, 1, number)
        for number in range(4)
    ]
    random = flights.judge(scenarios(1000), [KEEP_OUT])["R1"]
    assert sum(one.first_failed is not None for one in searches) >= 2
    assert min(one.outcome.margins.min() for one in searches) < random.margins.min()
    needed = sum(one.first_failed or len(one.scenarios) for one in searches)
    assert needed / sum(one.first_failed is not None for one in searches) < 1667 / 2
