"""Settings that vary within a flight.

A setting with a correlation time is a stationary process, a value for each control period. It is based on
a Gauss-Markov process of unit variance, exact at any period T (A. Gelb, Applied Optimal Estimation, 1974,
section 3.8)::

    z_0 = e_0        z_k = c z_(k-1) + sqrt(1 - c^2) e_k        c = exp(-T / correlation_s)

with independent standard normal e. The setting is the quantile of its distribution at the probability of z
under the normal distribution: for a normal one ``mean + std z``. So at each
instant it has that distribution, truncated or uniform as it may be.

Each key draws from its own place in the case's seed, independently of which others vary.
"""

from collections.abc import Sequence
from math import ceil, exp, inf, sqrt

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import chief_course
from pipeline.flight.world.coasting import FreeMotion
from pipeline.settings.dispersions import IN_TIME, Distribution
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

#: place in the spawn key of the first of `IN_TIME`, after the case; fixes, thrusters and the start's
#: velocity have the places before
FIRST = 4
DRAG = "dynamics.drag_m_s2"


def varies(mission: Mission, *keys: str) -> bool:
    """Return whether one of some settings varies within the flights of a mission."""
    return not mission.varying.keys().isdisjoint(keys)


def in_time(
    mission: Mission, key: str, scenario: Scenario, constant: Floats | float, beyond: int = 0
) -> Floats:
    """Return the values of a setting, a constant if it does not vary, at each sample of a flight.

    The shape is (K+1, 3) for an error, one per axis, else (K+1, 1); (1, ...) for a constant. In rad where the
    key is in degrees. Samples `beyond` the flight's end follow those within it.
    """
    law = mission.varying.get(key)
    if law is None or law.correlation_s is None:
        return np.asarray(constant, dtype=np.float64)[np.newaxis]
    from scipy.signal import lfilter  # noqa: PLC0415 - slow to import, used only here

    keys = list(IN_TIME)
    scores = scenario.generator(FIRST + keys.index(key)).standard_normal(
        (mission.num_controls + 1 + beyond, 3 if IN_TIME[key] == "error" else 1)
    )
    kept = exp(-mission.control_period_s / law.correlation_s)
    scores[1:] *= sqrt(1.0 - kept**2)
    values = _values(law, lfilter([1.0], [1.0, -kept], scores, axis=0))
    return np.radians(values) if key.endswith("_deg") else values


def _values(law: Distribution, scores: Floats) -> Floats:
    """Return the quantiles of a distribution at the probabilities of standard normal scores."""
    from scipy.special import ndtr, ndtri  # noqa: PLC0415 - as above

    if law.kind == "uniform":
        return np.asarray(law.low + (law.high - law.low) * ndtr(scores))
    if law.low == -inf and law.high == inf:
        return law.mean + law.std * scores
    below, upto = ndtr((np.array([law.low, law.high]) - law.mean) / law.std)
    # strictly between 0 and 1, where the inverse is finite
    shares = np.clip(below + (upto - below) * ndtr(scores), 2.0**-53, 1.0 - 2.0**-53)
    return np.asarray(np.clip(law.mean + law.std * ndtri(shares), law.low, law.high))


def drag_in_time(mission: Mission, scenarios: Sequence[Scenario], beyond_s: float = 0.0) -> Floats:
    """Return the difference from constant drag on the deputies in each period, shape (m, K, 3), m/s^2.

    It is held along Hill axes; no rows where drag is constant. Periods up to some seconds beyond the end
    follow those of the flight.
    """
    dynamics = mission.dynamics
    if not varies(mission, DRAG) or not isinstance(dynamics, TwoBody):
        return np.zeros((0, 0, 3))
    constant, beyond = dynamics.drag_m_s2, ceil(beyond_s / mission.control_period_s)
    more = [in_time(mission, DRAG, scenario, constant, beyond)[:-1] - constant for scenario in scenarios]
    with_drag, without = (chief_course(mission, beyond_s, drag_m_s2=drag) for drag in (1.0, 0.0))
    middles = slice(with_drag.num_steps, None, 2 * with_drag.num_steps)
    pushes = with_drag.common[middles] - without.common[middles]
    pushes_h = np.einsum("kij,kj->ki", with_drag.axes[middles], pushes)
    return np.asarray(np.array(more) * pushes_h)


def drifts_of(
    motion: FreeMotion, mission: Mission, scenarios: Sequence[Scenario], beyond_s: float
) -> Floats | None:
    """Return where drag leads each flight from rest, see `FreeMotion.drifts`; None where it is constant.

    Parameters
    ----------
    motion : FreeMotion
        Of the mission, up to `beyond_s` seconds beyond the end.
    mission : Mission
    scenarios : sequence of Scenario
        Of the flights; where there are none drag counts as constant.
    beyond_s : float
    """
    more = drag_in_time(mission, scenarios, beyond_s) if scenarios else np.zeros((0, 0, 3))
    return motion.drifts(more) if len(more) else None
