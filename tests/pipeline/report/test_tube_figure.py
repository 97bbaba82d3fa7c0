"""What is drawn of a tube holds every state of its boxes."""

import numpy as np

from pipeline.report.figures.flights import bounds


def test_bounds_hold_corners_and_are_met_by_them() -> None:
    draw = np.random.default_rng(5)
    low, least = draw.uniform(-3.0, 3.0, (2, 24))
    high, greatest = low + draw.uniform(0.0, 2.0, 24), least + draw.uniform(0.0, 2.0, 24)
    step, axis = np.repeat(np.arange(6.0), 4), np.tile([0.0, 0.0, 1.0, 1.0], 6)
    shear = draw.uniform(-1.0, 1.0, 24)
    tube = {"step": step, "axis": axis, "low_m": low, "high_m": high, "shear_per_s": shear}
    found = bounds(tube | {"least_m_s": least, "greatest_m_s": greatest})
    for k in range(6):
        boxes = [np.flatnonzero((step == k) & (axis == letter)) for letter in (0, 1)]
        distances, speeds = [], []
        for x in boxes[0]:
            for y in boxes[1]:
                # a fine grid of states of the two boxes, corners included
                places = [np.linspace(low[i], high[i], 41) for i in (x, y)]
                leaning = [np.linspace(least[i], greatest[i], 3) for i in (x, y)]
                both = [
                    np.subtract.outer(s, shear[i] * p)
                    for i, p, s in zip((x, y), places, leaning, strict=True)
                ]
                distances.append(np.hypot.outer(*places))
                speeds.append(np.hypot.outer(both[0].ravel(), both[1].ravel()).max())
        assert found[0][k] <= np.min(distances) <= found[0][k] + 0.1
        assert np.isclose(np.max(distances), found[1][k])
        assert np.isclose(np.max(speeds), found[2][k])
