"""How long a first plan is searched for: on board as long as it may take, as nothing competes there."""

import pytest

from pipeline.flight.fly.lesser_controllers import bare
from pipeline.flight.fly.replanning import first_searches
from tests.pipeline.flight.cases import SEEING, with_attributes


@pytest.mark.parametrize(
    ("pushes", "seconds", "on_board"), [(3, 60, 6), (3, 30, 3), (2, 90, 6), (2, 50, 2), (2, 10, 2), (3, 0, 3)]
)
def test_a_plan_is_searched_for_once_a_push_for_each_half_minute_that_it_may_take(pushes, seconds, on_board):
    constants = {"foresight_pushes": f"{pushes}", "rehearsal_reach_m_s": "0.1"}
    controller = with_attributes(SEEING, **constants, decision_period_s=f"{seconds}")
    assert len(first_searches(controller)) == pushes
    assert len(first_searches(bare(controller))) == on_board


def test_a_number_of_searches_that_is_given_counts_everywhere():
    constants = {"foresight_pushes": "3", "rehearsal_reach_m_s": "0.1", "decision_period_s": "60"}
    controller = with_attributes(SEEING, **constants, foresight_searches="4")
    assert [len(first_searches(each)) for each in (controller, bare(controller))] == [4, 4]
