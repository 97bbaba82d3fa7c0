"""Guidance of the readable flight: a function for each kind.

`pipeline.flight.period.look.guidance` describes the clustering.
"""

from collections.abc import Callable
from functools import cache
from math import atan2, hypot, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import padded
from pipeline.flight.period.look.guidance import (
    MAX_ITERATIONS,
    MIN_PROJECTION_M,
    POINTS,
    cluster_centres,
    nearest_centre,
    num_clusters,
    start_centres,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class ClusterMemory(NamedTuple):
    """Working arrays of clustering; `centres` and `num_centres` carry over from step to step.

    Attributes
    ----------
    centres : array, shape (C, 3)
        Of the last step, m, Hill axes; the first ``num_centres[0]`` rows count.
    num_centres : array of int, shape (1,)
        Zero if the last step had no candidates.
    labels : array, shape (2, P)
        Cluster of each candidate, in two consecutive passes.
    distances : array, shape (P,)
        Squared, from each candidate to its centre, m^2.
    sums : array, shape (C, 4)
        Coordinates summed over each cluster, m, and the number of its members.
    """

    centres: Floats
    num_centres: Integers
    labels: Floats
    distances: Floats
    sums: Floats


def cluster_memory(num_points: int) -> ClusterMemory:
    """Return the memory of a flight around `num_points` points before the first choice."""
    most, width = num_clusters(num_points), padded(num_points, POINTS)
    return ClusterMemory(
        centres=np.zeros((most, 3)),
        num_centres=np.zeros(1, dtype=np.int64),
        labels=np.zeros((2, width)),
        distances=np.zeros(width),
        sums=np.zeros((most, 4)),
    )


#: candidates (3, P), how many, position (3,), memory -> p_u of shape (3,), m
ChooseTarget = Callable[[Floats, int, Floats, ClusterMemory], Floats]


@compiled
def choose_centroid(
    candidates: Floats, num_candidates: int, position_h: Floats, memory: ClusterMemory
) -> Floats:
    """Return the mean of the candidates, at least one, shape (3,); the other arguments are not used."""
    target = np.zeros(3)
    for axis in range(3):
        for i in range(num_candidates):
            target[axis] += candidates[axis, i]
    return target / num_candidates


@compiled
def choose_cluster(
    candidates: Floats, num_candidates: int, position_h: Floats, memory: ClusterMemory
) -> Floats:
    """Return the centre of the cluster nearest the deputy.

    Parameters
    ----------
    candidates : array, shape (3, P)
        m, Hill axes; the first `num_candidates` columns count.
    num_candidates : int
        At least 1; a step without candidates sets ``memory.num_centres[0]`` to zero instead.
    position_h : array, shape (3,)
        Of the deputy, m, Hill axes.
    memory : ClusterMemory
        In and out.

    Returns
    -------
    array, shape (3,)
        m, Hill axes.
    """
    memory.num_centres[0] = cluster_centres(
        candidates,
        num_candidates,
        position_h,
        memory.centres,
        memory.num_centres[0],
        memory.labels,
        memory.distances,
        memory.sums,
    )
    target: Floats = memory.centres[nearest_centre(memory.centres, memory.num_centres[0], position_h)].copy()
    return target


@cache
def _kmeans() -> tuple[Any, Any]:
    """Return scikit-learn's KMeans and a thread limiter; imported only here, as that takes a second."""
    from sklearn.cluster import KMeans  # noqa: PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415

    return KMeans, ThreadpoolController()


def choose_cluster_sklearn(
    candidates: Floats, num_candidates: int, position_h: Floats, memory: ClusterMemory
) -> Floats:
    """Return the same as `choose_cluster`, by scikit-learn's KMeans; plain Python."""
    kmeans, threads = _kmeans()
    wanted = start_centres(
        candidates,
        num_candidates,
        position_h,
        memory.centres,
        int(memory.num_centres[0]),
        memory.labels[0],
        memory.distances,
    )
    # With so few points one thread is fastest.
    with threads.limit(limits=1, user_api="openmp"):
        fitted = kmeans(
            n_clusters=wanted,
            init=memory.centres[:wanted],
            n_init=1,
            max_iter=MAX_ITERATIONS,
            tol=0,
            algorithm="lloyd",
        ).fit(candidates[:, :num_candidates].T)
    memory.centres[:wanted] = fitted.cluster_centers_
    memory.num_centres[0] = wanted
    target: Floats = memory.centres[nearest_centre(memory.centres, wanted, position_h)].copy()
    return target


@compiled
def relative_angle(target_a: float, target_b: float, position_a: float, position_b: float) -> float:
    """Return the angle from the deputy's direction to the target's in a plane of Hill axes a and b.

    In the i-j plane this is the paper's lambda_u, in the i-k plane eta_u.

    Parameters
    ----------
    target_a, target_b : float
        Components of p_u, m.
    position_a, position_b : float
        Components of the deputy's position, m.

    Returns
    -------
    float
        In (-pi, pi], rad; zero where a projection is shorter than `MIN_PROJECTION_M`.
    """
    if hypot(target_a, target_b) < MIN_PROJECTION_M or hypot(position_a, position_b) < MIN_PROJECTION_M:
        return 0.0
    angle = atan2(target_b, target_a) - atan2(position_b, position_a)
    if angle > pi:
        return angle - 2.0 * pi
    if angle <= -pi:
        return angle + 2.0 * pi
    return angle
