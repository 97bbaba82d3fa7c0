"""Which of several candidates a training hands back."""

import numpy as np
import pytest

from pipeline.evaluation.selection import CHAMPION, Candidate, SelectionJudgement, ranked
from pipeline.evaluation.statistics import fraction

#: name, successes of 1,000 starts, cost in m/s
FLOWN = [
    ("dear", 989, 2.07),
    ("good", 950, 1.40),
    ("cheap", 935, 1.30),
    ("poor", 860, 1.10),
    ("worst", 700, 1.00),
]


def judged(flown):
    return [
        SelectionJudgement(
            Candidate(CHAMPION, np.array([index])), 1000, cost, cost, fraction(np.arange(1000) < count, 95.0),
            cost, 100.0, 0.0,
        )
        for index, (_, count, cost) in enumerate(flown)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "order"),
    [
        # intervals reach about 1.5 % to either side
        (None, ["dear", "good", "cheap", "poor", "worst"]),
        (94.0, ["cheap", "good", "dear", "poor", "worst"]),
        (97.0, ["dear", "good", "cheap", "poor", "worst"]),
        (85.0, ["poor", "cheap", "good", "dear", "worst"]),
    ],
)
def test_success_counts_up_to_a_goal_and_cost_beyond(goal, order):
    names = [name for name, *_ in FLOWN]
    for flown in (FLOWN, FLOWN[::-1]):
        in_order = ranked(judged(flown), goal)
        assert [[name for name, *_ in flown][int(each.candidate.genome[0])] for each in in_order] == order
    assert sorted(order) == sorted(names)


def test_a_goal_that_nobody_reaches_leaves_the_most_successful_in_front():
    poor = judged([("less", 600, 1.0), ("more", 800, 2.0)])
    assert [each.cost for each in ranked(poor, 94.0)] == [2.0, 1.0]
