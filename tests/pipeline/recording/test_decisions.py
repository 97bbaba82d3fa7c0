"""What is said of plans of pushes and of fleets, from logs made by hand; paths by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.flight.fly.replanning import ENDS
from pipeline.flight.state.log import PARKED
from pipeline.recording.events import Event, events
from pipeline.recording.fleets import fleet_events
from pipeline.recording.foresight import decision_at, decisions_in_words, is_planned, recorded_decisions
from tests.pipeline.recording import cases

#: half an hour in periods of 10 s; a force of 12 mN for one changes the velocity by 10 mm/s
WORDS = ("duration_s=1800.0",)
MISSION = cases.composed(*WORDS).experiment.mission
NONE = (-1.0, 0.0, 0.0, 0.0)
NOTHING = (NONE,) * 3
#: a push up now, and one back and north five minutes later; one down after a minute
BEST = ((0.0, 0.012, 0.0, 0.0), (30.0, 0.0, -0.024, 0.0144), NONE)
OTHER = ((6.0, -0.0126, 0.0, 0.0), NONE, NONE)
#: later, given in another order; a component of 0.4 mm/s is not worth a word, one of 0.6 is
LATER = ((75.0, 0.0, 0.012, 0.00048), (60.0, 0.0, 0.0, -0.00072), NONE)


def flight():
    log = cases.flown(*WORDS)
    nan = np.nan
    return log._replace(
        foresight_at=np.array([[0.0, 4800.0, 31.0], [60.0, 0.0, 7.0]]),
        foresight_plans=np.array([[BEST, OTHER, *[NOTHING] * 3], [LATER, *[NOTHING] * 4]]),
        foresight_prices_m_s=np.array([[0.035, 0.0472, nan, nan, nan], [0.0106, nan, nan, nan, nan]]),
        foresight_ends_m_s=np.array([[0.2, 0.1, 0.3, nan], [0.0106, nan, nan, nan]]),
    )


FIRST = (
    "planned: of 4,800 plans, checked for light and sight, the cheapest is 10 mm/s up now; 20 mm/s back, 12 "
    "north after 5.0 min. The best that differs clearly, 10 mm/s down after 1.0 min, would cost 12 mm/s "
    "more; the rules finish. Firing nothing from here would leave 31 points unseen"
)
SECOND = (
    "planned: the last plan still sees enough, 1 mm/s south now; 10 mm/s ahead after 2.5 min; coasting "
    "follows. Firing nothing from here would leave 7 points unseen"
)


def test_each_decision_is_told_with_its_plans_in_order_and_in_minutes():
    assert is_planned(flight())
    assert list(decisions_in_words(MISSION, flight())) == [(0, FIRST), (60, SECOND)]
    assert [decision_at(MISSION, flight(), sample) for sample in (0, 59, 60)] == [FIRST, FIRST, SECOND]
    assert decision_at(MISSION, cases.flown(*WORDS), 5) == ""
    at = np.array([[0.0, 4800.0, 1.0], [60.0, 0.0, 0.0]])
    (_, words), (_, later) = decisions_in_words(MISSION, flight()._replace(foresight_at=at))
    assert words.endswith("would leave 1 point unseen")
    assert later.endswith("would leave 0 points unseen")
    nothing = np.array([[NOTHING] * 5] * 2)
    (_, words), _ = decisions_in_words(MISSION, flight()._replace(foresight_plans=nothing))
    assert "the cheapest is no push. The best that differs clearly, no push, would" in words


@pytest.mark.parametrize(
    ("least", "then"),
    [
        (0, "coasting follows"),
        (1, "the rules finish"),
        (2, "but the rules alone are cheaper"),
        (3, "but what the rules rehearse is cheaper"),
    ],
)
def test_what_follows_is_the_cheapest_of_the_flights_ahead(least, then):
    ends = np.full((2, len(ENDS)), 0.3)
    ends[:, least] = 0.2
    for _, words in decisions_in_words(MISSION, flight()._replace(foresight_ends_m_s=ends)):
        assert f"; {then}. Firing" in words


def pushed(log, plan):
    """Positions of a plan by Clohessy and Wiltshire's equations, each minute."""
    n, mass, period = MISSION.orbit.mean_motion_rad_s, MISSION.deputy.mass_kg, MISSION.control_period_s

    def rates(time, state):
        x, y, z = sum(
            (
                np.array(force)
                for begin, *force in plan
                if begin >= 0 and 0.0 <= time - begin * period < period
            ),
            np.zeros(3),
        )
        dx, dy, dz = state[3:]
        return [
            dx,
            dy,
            dz,
            3 * n * n * state[0] + 2 * n * dy + x / mass,
            -2 * n * dx + y / mass,
            -n * n * state[2] + z / mass,
        ]

    times = np.arange(0.0, MISSION.duration_s + 1.0, 60.0)
    start = np.r_[log.position_m[0], log.velocity_m_s[0]]
    return solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, max_step=1.0, rtol=1e-9, atol=1e-9).y[:3].T


def test_a_recording_keeps_plans_their_paths_and_flights_ahead():
    log = flight()
    kept = recorded_decisions(MISSION, log)
    assert list(kept) == [
        "plan of pushes",
        "flight ahead",
        "plan of pushes from 600 s",
        "flight ahead from 600 s",
    ]
    plans, ahead, later, then = kept.values()
    assert plans.names == (
        "10 mm/s up now; 20 mm/s back, 12 north after 5.0 min",
        "10 mm/s down after 1.0 min",
    )
    assert (plans.costs_m_s, plans.num_tried, plans.from_s, plans.until_s) == (
        (0.035, 0.0472),
        4800,
        0.0,
        600.0,
    )
    assert (ahead.names, ahead.costs_m_s) == (ENDS[:3], (0.2, 0.1, 0.3))
    assert (ahead.from_s, ahead.until_s) == (0.0, 600.0)
    assert (later.num_tried, later.from_s, later.until_s) == (1, 600.0, 1800.0)
    assert (then.names, then.costs_m_s, then.from_s, then.until_s) == (ENDS[:1], (0.0106,), 600.0, 1800.0)
    # a third decision, of no push
    third = log._replace(
        foresight_at=np.vstack([log.foresight_at, [90.0, 0.0, 3.0]]),
        foresight_plans=np.vstack([log.foresight_plans, [[NOTHING] * 5]]),
        foresight_prices_m_s=log.foresight_prices_m_s[[0, 1, 1]],
        foresight_ends_m_s=log.foresight_ends_m_s[[0, 1, 1]],
    )
    assert [each.until_s for each in recorded_decisions(MISSION, third).values()][::2] == [
        600.0,
        900.0,
        1800.0,
    ]
    # kept to a tenth of a metre
    paths = np.reshape(plans.paths_m, (2, -1, 3))
    for path, plan in zip(paths, (BEST, OTHER), strict=True):
        np.testing.assert_allclose(path, pushed(log, plan), atol=0.06)
    # of a fleet they are a deputy's part, and what all cost
    of_three = recorded_decisions(MISSION, log, 3)
    assert list(of_three) == [
        "part in a plan of 3 deputies",
        "flight ahead of 3 deputies",
        "part in a plan of 3 deputies from 600 s",
        "flight ahead of 3 deputies from 600 s",
    ]
    assert [*of_three.values()] == [*kept.values()]
    assert np.shape(later.paths_m) == (3 * 21,)
    np.testing.assert_allclose(later.paths_m[:3], log.position_m[60], atol=0.06)


@pytest.mark.parametrize("motion", [(), ("dynamics=two_body", "orbit.course=true")], ids=" ".join)
def test_pushes_at_once_lead_where_their_sum_does(motion):
    mission, log = cases.composed(*WORDS, *motion).experiment.mission, flight()
    at_once = ((0.0, 0.012, 0.0, 0.0), (0.0, 0.0, -0.024, 0.0144), NONE)
    joined = ((0.0, 0.012, -0.024, 0.0144), NONE, NONE)
    plans = np.array([[at_once, joined, *[NOTHING] * 3]])
    together = log._replace(
        foresight_at=log.foresight_at[:1],
        foresight_plans=plans,
        foresight_prices_m_s=log.foresight_prices_m_s[:1],
        foresight_ends_m_s=log.foresight_ends_m_s[:1],
    )
    one_by_one, at_a_time = np.reshape(
        recorded_decisions(mission, together)["plan of pushes"].paths_m, (2, -1)
    )
    np.testing.assert_array_equal(one_by_one, at_a_time)


def test_each_push_that_parks_is_told_in_mm_a_second():
    log = cases.flown(*WORDS)
    reason, force = log.command_reason.copy(), np.zeros_like(log.force_asked_n)
    reason[7, 1], force[7] = PARKED, (0.012, -0.06, 0.0)
    happened = events(MISSION, log._replace(command_reason=reason, force_asked_n=force), 5.0)
    words = "parks on a closed ellipse inside the limits: 10 mm/s radially, -50 along the track, 0 across"
    assert [event for event in happened if "parks" in event.text] == [Event(7, "info", words)]


def fleet_log(*, seen=(), left=(), num_points=6, num_inspectable=6):
    """Deputy 1's log; ``seen`` are (from sample, point, by) and ``left`` (samples, point, to)."""
    count = MISSION.num_controls
    seen_by, left_to = np.zeros((count + 1, num_points), np.uint8), np.zeros((count, num_points), np.uint8)
    for sample, point, by in seen:
        seen_by[sample:, point] = by
    for (first, last), point, other in left:
        left_to[first:last, point] = other
    counted = replace_points(cases.flown(*WORDS), num_points, num_inspectable)
    shown, arrived = np.zeros((count, 2, num_points), np.uint8), np.zeros((count, 2), np.uint8)
    return DeputyLog(1, counted, seen_by, left_to, shown, *np.zeros((2, count, 2, 3)), arrived)


def replace_points(log, num_points, num_inspectable):
    return log._replace(is_inspectable=np.arange(num_points) < num_inspectable)


def texts(log):
    return [(event.sample, event.text) for event in fleet_events(MISSION, log, 3)]


def test_what_is_left_to_others_is_told_once_with_when_it_was_seen():
    seen = [(0, 0, 1), (48, 1, 2), (90, 2, 2), (100, 3, 3)]
    left = [((12, 48), 1, 2), ((12, 90), 2, 2), ((20, 90), 4, 3), ((60, 80), 1, 2), ((30, 40), 5, 2)]
    happened = texts(fleet_log(seen=seen, left=left))
    assert happened == [
        # from sample 12 to 48 are 36 periods, six minutes
        (12, "left to deputy 2: 2 points, seen from 6 min later on"),
        (20, "left to deputy 3: 1 point, which nobody saw"),
        (30, "left to deputy 2: 1 point, which nobody saw"),
        (180, "deputy 1 ends; seen first by deputy 1 1, deputy 2 2, deputy 3 1"),
    ]
    partly = texts(
        fleet_log(seen=[(18, 1, 3), (180, 0, 1)], left=[((0, 9), 1, 2), ((0, 9), 2, 2), ((0, 9), 3, 2)])
    )
    assert partly[0] == (0, "left to deputy 2: 3 points, 1 of them seen from 3 min later on")
    assert partly[-1] == (180, "deputy 1 ends; seen first by deputy 1 1, deputy 2 0, deputy 3 1")
    assert texts(fleet_log(seen=[(18, 1, 1)])) == [
        (180, "deputy 1 ends; seen first by deputy 1 1, deputy 2 0, deputy 3 0")
    ]


def test_a_deputy_idles_where_all_that_is_unseen_and_counts_is_left():
    """Point 5 can never be inspected, so nobody waits for it."""
    seen = [(0, 0, 1), (0, 1, 1), (0, 2, 2), (60, 3, 2)]
    left = [((10, 70), 3, 2), ((40, 70), 4, 3), ((100, 110), 4, 3)]
    happened = texts(fleet_log(seen=seen, left=left, num_inspectable=5))
    idle = "coasts: {} left to {}, and coasting keeps the limits"
    assert [(sample, text) for sample, text in happened if text.startswith("coasts")] == [
        (40, idle.format("all 2 unseen points are", "deputy 2 and deputy 3")),
        (100, idle.format("the only unseen point is", "deputy 3")),
    ]


def test_a_deputy_that_leaves_points_when_it_decides_is_told_to_coast_once():
    """Every sixth period it leaves the same point until it is seen; between these nothing is decided."""
    seen = [(0, point, 1) for point in range(5)] + [(60, 5, 2)]
    left = [((sample, sample + 1), 5, 2) for sample in range(12, 60, 6)]
    log = fleet_log(seen=seen, left=left)
    coasts = [event for event in fleet_events(MISSION, log, 3, 6) if event.text.startswith("coasts")]
    words = "coasts: the only unseen point is left to deputy 2, and coasting keeps the limits"
    assert coasts == [Event(12, "info", words)]
