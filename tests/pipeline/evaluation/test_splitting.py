"""Splitting against events whose probability has a closed form."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.evaluation import splitting
from pipeline.evaluation.splitting import rare_share, scouted
from pipeline.run.engine import TaskPool


class Plane:
    """Normal variables beyond a plane, or two: the probability is that of the normal tail."""

    def __init__(self, probability, *, has_two=False, num_genes=4):
        self.has_two, self.num_genes = has_two, num_genes
        self.distance = -norm.ppf(probability / (2 if has_two else 1))

    @property
    def is_periodic(self):
        return np.zeros(self.num_genes, np.bool_)

    def margins(self, genes, numbers):
        along = norm.ppf(np.clip(genes, 1e-300, 1.0 - 2.0**-53)).sum(axis=1) / math.sqrt(self.num_genes)
        return self.distance - (np.abs(along) if self.has_two else along)


class Sector:
    """A direction near the seam of a turn, and a number's random variable below a bound."""

    is_periodic = np.array([True])

    def __init__(self, width, bound):
        self.width, self.bound = width, bound

    def margins(self, genes, numbers):
        away = np.abs((genes[:, 0] + 0.5) % 1.0 - 0.5) / self.width
        of_number = np.array([np.random.default_rng(number).random() for number in numbers]) / self.bound
        return np.maximum(away, of_number) - 1.0


class Luck:
    """A number's random variable alone: genes decide nothing."""

    is_periodic = np.zeros(2, np.bool_)

    def __init__(self, probability):
        self.probability = probability

    def margins(self, genes, numbers):
        return np.array([np.random.default_rng(number).random() for number in numbers]) - self.probability


class Counts:
    """Margins that are whole numbers, of which many are equal: the event is the least of a thousand."""

    is_periodic = np.zeros(1, np.bool_)

    def margins(self, genes, numbers):
        return np.floor(10.0 * (1.0 - genes[:, 0]) ** (1.0 / 3.0)) - 0.5


@pytest.mark.parametrize(
    ("law", "probability", "half_width"),
    [
        (Plane(1e-5), 1e-5, 0.3),
        (Plane(1e-5, has_two=True), 1e-5, 0.3),
        (Plane(1e-3), 1e-3, 0.1),
        (Plane(0.3), 0.3, 0.03),
        (Sector(0.005, 0.01), 1e-4, 1.0),
        (Counts(), 1e-3, 0.1),
        (Luck(1e-3), 1e-3, 1.0),
    ],
    ids=["plane", "two planes", "near", "common", "seam and number", "counts", "luck"],
)
def test_the_share_of_an_event_is_its_probability(law, probability, half_width):
    num_flights = 20_000 if isinstance(law, Sector | Luck) else 40_000
    rare = rare_share(law, num_flights, 99.0, (3,))
    assert rare.low < probability < rare.high
    # a population that dies out flies no more
    assert 0.6 * num_flights < rare.num_flights < 1.02 * num_flights
    at_95 = (rare.high - rare.low) / 2.0 / rare.share * 2.201 / 3.106  # Student's quantiles, 11 degrees
    assert at_95 < half_width
    assert f"{rare.share:.3g} by splitting" in rare.sentence


def test_intervals_hold_as_often_as_they_say():
    held = sum(
        rare.low <= 1e-3 <= rare.high
        for seed in range(40)
        for rare in [rare_share(Plane(1e-3), 4000, 90.0, (seed,))]
    )
    # a count of 40 trials with 90 % that is lower has a chance of 1 %
    assert held >= 31


def test_an_estimate_depends_on_its_seed_alone():
    first, again, other = (rare_share(Plane(1e-4), 5000, 95.0, (seed, 7)) for seed in (1, 1, 2))
    assert first == again
    assert first.populations != other.populations
    assert len(first.populations) == splitting.POPULATIONS
    assert len(set(first.populations)) > 5


def test_what_cannot_be_approached_is_given_up_and_what_nobody_saw_has_no_upper_bound():
    class Same(Counts):
        def margins(self, genes, numbers):
            return np.ones(len(genes))

    rare = rare_share(Same(), 2000, 95.0, (1,))
    assert (rare.share, rare.high, rare.levels) == (None, None, ())
    assert "splitting gave up after 0 levels" in rare.sentence
    impossible = scouted(Plane(1e-300), 200, (1, 0)).plan
    assert len(impossible.levels) == splitting.MOST_LEVELS
    assert impossible.levels[-1] > 0.0


class Watched(Plane):
    """A plane that counts the cases whose margins are asked for in a pool's tasks, and those elsewhere."""

    def __init__(self, probability):
        super().__init__(probability)
        self.is_in_task, self.num_in_tasks, self.num_elsewhere = False, 0, 0

    def margins(self, genes, numbers):
        self.num_in_tasks += len(genes) * self.is_in_task
        self.num_elsewhere += len(genes) * (not self.is_in_task)
        return super().margins(genes, numbers)


def test_all_cases_are_flown_where_the_pool_works():
    law = Watched(1e-3)

    class Pool(TaskPool):
        def run(self, function, tasks):
            for index, task in reversed(list(enumerate(tasks))):
                law.is_in_task = True
                result = function(*task)
                law.is_in_task = False
                yield index, result

    rare = rare_share(law, 5_000, 95.0, (3,), Pool(None))
    assert (law.num_in_tasks, law.num_elsewhere) == (rare.num_flights, 0)
    assert rare == rare_share(Plane(1e-3), 5_000, 95.0, (3,))
