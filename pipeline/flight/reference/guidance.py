"""Where to look next: one point chosen from those that are lit and not yet inspected."""

import numpy as np

from pipeline.array_types import Floats
from pipeline.settings.experiment import Mission

#: most candidates a cluster on average, and how far a new centre is moved towards the deputy, m
CLUSTER_SIZE, SHIFT_M = 10, 0.5
#: squared distances so close are equal, m^2; projections shorter than this have no angle, m
TIE_M2, SHORTEST_M = 1e-9, 1e-9


def chosen_target(
    mission: Mission, candidates: Floats, position: Floats, centres: Floats
) -> tuple[Floats, Floats]:
    """Return the point p_u, zeros without candidates, and the centres that the next sample begins with."""
    if len(candidates) == 0:
        return np.zeros(3), np.empty((0, 3))
    if mission.guidance.kind == "centroid":
        return candidates.mean(axis=0), centres
    centres = clustered(candidates, starting_centres(candidates, position, centres))
    return centres[first_least(squares(centres - position))], centres


def starting_centres(candidates: Floats, position: Floats, before: Floats) -> Floats:
    """Return the centres that clustering starts from: the last sample's, and new ones for those missing."""
    wanted = -(-len(candidates) // CLUSTER_SIZE)
    centres = list(before[:wanted])
    while len(centres) < wanted:
        if centres:
            apart = np.min([squares(candidates - centre) for centre in centres], axis=0)
            chosen = candidates[first_least(-apart)]
        else:
            chosen = candidates[first_least(squares(candidates - position))]
        towards = position - chosen
        centres.append(chosen + SHIFT_M * towards / max(float(np.linalg.norm(towards)), 1e-300))
    return np.array(centres)


def clustered(candidates: Floats, centres: Floats, tolerance: float = 0.0) -> Floats:
    """Return the centres of clusters, by Lloyd's algorithm (IEEE Trans. Information Theory 28, 1982).

    It begins at `centres`, and ends after 50 steps or where these move by less than scikit-learn's tolerance.
    """
    if len(centres) == 1:
        return candidates.mean(axis=0, keepdims=True)
    # slow to import, and used only here
    from sklearn.cluster import KMeans  # noqa: PLC0415
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    means = KMeans(len(centres), init=centres, n_init=1, max_iter=50, tol=tolerance, algorithm="lloyd")
    with threadpool_limits(limits=1, user_api="openmp"):
        return np.asarray(means.fit(candidates).cluster_centers_, dtype=np.float64)


def squares(vectors: Floats) -> Floats:
    """Return squared lengths, (n,)."""
    return np.asarray(np.sum(vectors**2, axis=1))


def first_least(values: Floats) -> int:
    """Return the index of the least value, the first of equal ones."""
    chosen = 0
    for i, value in enumerate(values):
        if value < values[chosen] - TIE_M2:
            chosen = i
    return chosen


def relative_angle(target: Floats, position: Floats) -> float:
    """Return the angle from the position's to the target's projection on a plane, in (-pi, pi], rad.

    It is lambda_u in the plane of i and j, eta_u in that of i and k; the vectors have two components.
    """
    if min(np.hypot(*target), np.hypot(*position)) < SHORTEST_M:
        return 0.0
    angle = np.arctan2(target[1], target[0]) - np.arctan2(position[1], position[0])
    return float(angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi)))
