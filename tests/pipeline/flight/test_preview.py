"""What coasting comes to, against flights that do coast; a controller that coasts when that is enough."""

from dataclasses import replace

import numpy as np

from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import by_neighbourhood, inspection_points
from tests.pipeline.flight.cases import (
    FORESEEING,
    controller,
    leaning_system,
    mission,
    random_starts,
)

IDEAL = {"mode": "ideal"}
#: never fires, and senses all that is foreseen
WATCHING = controller(
    (
        leaning_system(
            "force_x",
            0.01,
            ("missed", "", 20.0),
            ("coasting_nearest", "m", 60.0),
            ("coasting_farthest", "m", 60.0),
        ),
        leaning_system("force_y", 0.01, ("target_setting", "", 1.0)),
    ),
    "hill",
    dead_band_force_x_n=1.0,
    dead_band_force_y_n=1.0,
)


def test_a_flight_that_coasts_misses_what_was_foreseen_or_a_little_less() -> None:
    """Foreseen are the places every two minutes, flown are twelve times as many."""
    for start in random_starts(12, 21):
        log = fly_logged(mission(attitude=IDEAL), WATCHING, start)
        missed = 99 - log.is_inspected[-1].sum()
        foreseen = log.fis_input[:, 0, 0]
        assert np.all(foreseen >= missed)
        assert foreseen[0] - missed <= 8
        assert foreseen[-1] == missed  # nothing lies between the last sample but one and the end
        distance = np.linalg.norm(log.position_m, axis=1)
        ahead = np.array([(distance[k:].min(), distance[k:].max()) for k in range(360)])
        np.testing.assert_allclose(log.fis_input[:, 0, 1:], ahead, rtol=0, atol=6.0)
        assert np.all(log.fis_input[:, 0, 1] >= ahead[:, 0] - 1e-9)
        assert np.all(log.fis_input[:, 0, 2] <= ahead[:, 1] + 1e-9)


def test_neighbours_share_a_vector() -> None:
    points = inspection_points(mission())
    order = by_neighbourhood(points)
    assert sorted(order) == list(range(99))

    def widest(ordered: np.ndarray) -> float:
        return float(max(np.ptp(ordered[j : j + POINTS], axis=0).max() for j in range(0, 99, POINTS)))

    assert widest(points[order]) < 0.65 * widest(points)


def test_with_every_point_allowed_to_be_missed_it_never_fires() -> None:
    lazy = replace(
        FORESEEING,
        fuzzy=replace(
            FORESEEING.fuzzy,
            attributes=(("coast_below_points", "100.0"), ("force_axes", "hill"), ("ring_size_m", "20.0")),
        ),
    )
    start = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.3)
    outcomes, coasted = fly_all(mission(), lazy, [start]), fly_all(mission(), coast(), [start])
    assert outcomes.delta_v_m_s[0] == 0.0
    assert outcomes.inspected_count[0] == coasted.inspected_count[0]
