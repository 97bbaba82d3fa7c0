"""A plane and its residual enclose the force that flies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fis_tools.engines import interpreter, interval
from pipeline.proof.tube import Box, Surface, surface_of
from tests.pipeline.proof.cases import steady

DEAD_BAND_N, MOST_N = 0.05, 0.8


@pytest.fixture(scope="module")
def surface() -> Surface:
    return surface_of(steady().systems[0], DEAD_BAND_N, MOST_N)


@given(
    low=st.floats(-6.0, 6.0),
    width=st.floats(0.0, 3.0),
    least=st.floats(-0.3, 0.3),
    height=st.floats(0.0, 0.2),
    shear=st.floats(-0.1, 0.1),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_force_leaves_it(surface, low, width, least, height, shear, seed):
    box = Box(low, low + width, least, least + height, shear)
    plane = surface.plane(box)
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


def test_where_the_rules_are_smooth_the_residual_is_small(surface):
    near, far = (surface.plane(Box(2.0, 2.0 + w, -0.07, -0.07 + w / 50, 0.0)) for w in (0.05, 1.0))
    assert near.residual < 0.3 * far.residual
    assert near.per_velocity < 0.0
