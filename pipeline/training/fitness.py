"""The fitness of flights, term by term.

Pure functions of outcomes. The fitness of a controller is the mean over its flights of delta-v plus

``zeta = c_d [outside] (1 + metres outside) + c_95 max(0, needed - points) + c_99 (all - points)``

with c_d, c_95 and c_99 the settings ``outside_m_s``, ``short_point_m_s`` and ``missed_point_m_s``, `all` the
points that can be inspected, because they are lit at some sample of the flight, and `needed` the number
for a success: 95 of 99 at a threshold of 95 %. The distance limits are tightened by the penalty's margins, so
that a champion keeps clear of them; at most `outside_most_m` of
the metres outside are priced, so that a search for few exits is not dominated by the largest one
(Choi, Kim and Leeghim, AAS 25-727, leave zeta's form open).

For a front the fitness is the sum of two objectives: what is spent, delta-v, and what is missed, the price of
all points that are not inspected. Faults, leaving the limits or missing the threshold, are charged half to
each, so that neither is bought by them.
"""

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import Outcomes, points_needed
from pipeline.settings.experiment import Mission
from pipeline.settings.training import Penalty


def fitness_parts(outcomes: Outcomes, penalty: Penalty, mission: Mission) -> dict[str, Floats]:
    """Return the fitness of a population, in parts.

    Parameters
    ----------
    outcomes : Outcomes
        Arrays of shape (n, m): n controllers, m flights each.
    penalty : Penalty
    mission : Mission
        Has the distance limits and the threshold of success.

    Returns
    -------
    dict of (n,) arrays
        ``fitness``, and its parts: ``delta_v_m_s`` and ``points`` (means), ``outside`` (flights that
        left the limits), ``outside_m`` (mean), ``short`` (flights short of the threshold).
    """
    points = outcomes.inspected_count
    is_short = ~outcomes.is_success(mission.inspection_threshold_percent)
    return {
        "fitness": costs(outcomes, penalty, mission).mean(axis=-1),
        "delta_v_m_s": outcomes.delta_v_m_s.mean(axis=-1),
        "points": points.mean(axis=-1),
        "outside": outcomes.is_violated.sum(axis=-1).astype(np.float64),
        "outside_m": outcomes.outside_m.mean(axis=-1),
        "short": is_short.sum(axis=-1).astype(np.float64),
    }


def objectives(outcomes: Outcomes, penalty: Penalty, mission: Mission) -> dict[str, Floats]:
    """Return the two objectives ``spent`` and ``missed`` of a population, means over the flights, m/s."""
    faults, missed = _prices(outcomes, penalty, mission)
    spent = outcomes.delta_v_m_s + 0.5 * faults
    return {"spent": spent.mean(axis=-1), "missed": (missed + 0.5 * faults).mean(axis=-1)}


def costs(outcomes: Outcomes, penalty: Penalty, mission: Mission) -> Floats:
    """Return delta-v plus zeta of each flight, m/s, in the shape of the outcomes; see the module."""
    faults, missed = _prices(outcomes, penalty, mission)
    return np.asarray(outcomes.delta_v_m_s + (faults + missed))


def _prices(outcomes: Outcomes, penalty: Penalty, mission: Mission) -> tuple[Floats, Floats]:
    """Return the prices of each flight's faults, and of the points that it misses, m/s."""
    points = outcomes.inspected_count
    outside_m = outcomes.outside_m
    if penalty.near_margin_m > 0.0 or penalty.far_margin_m > 0.0:
        too_near = mission.deputy.min_distance_m + penalty.near_margin_m - outcomes.min_distance_m
        too_far = outcomes.max_distance_m - (mission.deputy.max_distance_m - penalty.far_margin_m)
        outside_m = np.maximum(outside_m, np.maximum(too_near, too_far))
    paid_m = outside_m if penalty.outside_most_m is None else np.minimum(outside_m, penalty.outside_most_m)
    inspectable = outcomes.inspectable_count
    num_short = np.maximum(0, points_needed(inspectable, mission.inspection_threshold_percent) - points)
    outside = penalty.outside_m_s * (outside_m > 0.0) * (1.0 + paid_m)
    short = penalty.short_point_m_s * num_short
    return np.asarray(outside + short), np.asarray(penalty.missed_point_m_s * (inspectable - points))
