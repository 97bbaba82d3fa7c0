"""Where to look next: one direction chosen from the points that are lit and not yet inspected.

The paper (Choi, Kim and Leeghim, AAS 25-727) clusters these candidates and steers towards a cluster's
centre. Two kinds are offered: the centroid of all candidates, and the centre nearest the deputy of
``ceil(m/10)`` clusters of m candidates, found by Lloyd's algorithm (S. Lloyd, IEEE Transactions on
Information Theory 28(2), 1982).

`cluster_centres` follows scikit-learn's ``KMeans(init=..., n_init=1, max_iter=50, tol=0, algorithm="lloyd")``
move by move, relocation of empty clusters included; `pipeline.flight.fly.plain` calls that one: the two
agree to rounding unless two distances tie, or a cluster gives its last member away, whose centre then stays.
Clustering is warm-started from the centres of the step
before.

Positions are in m, Hill axes. Compiled functions allocate only what they return.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import dot, lane_of, load_from, three_of, write_three
from fis_tools.compiled.vectors import load, select, store
from pipeline.array_types import Floats

#: inspection points processed together
POINTS = 8
#: most candidates per cluster, on average
CLUSTER_SIZE = 10
MAX_ITERATIONS = 50
#: shift of a new centre off its point towards the deputy, m; points on a lattice tie without it
CENTRE_SHIFT_M = 0.5
#: squared distances this close count as equal, so that rounding does not choose between mirrored points, m^2
TIE_M2 = 1e-9
#: projections shorter than this have no angle, m
MIN_PROJECTION_M = 1e-9


@compiled
def num_clusters(num_candidates: int) -> int:
    """Return the number of clusters for a number of candidates."""
    return (num_candidates + CLUSTER_SIZE - 1) // CLUSTER_SIZE


class Clusters(NamedTuple):
    """Candidates, the centres of their clusters, and what clustering overwrites."""

    candidates: Floats  # (3, P) one row per axis; P is a multiple of `POINTS`
    num_candidates: int  # m: so many columns count
    centres: Floats  # (C, 3) in and out, C >= ceil(P/10)
    labels: Floats  # (2, P)
    distances: Floats  # (P,)
    sums: Floats  # (C, 4)


@compiled
def _assign(clusters: Clusters, first: int, last: int, labels: Floats) -> None:
    """Assign candidates to centres `first` to `last - 1` where these are nearer than `distances`."""
    candidates, centres, distances = clusters.candidates, clusters.centres, clusters.distances
    for i in range(0, clusters.num_candidates, POINTS):
        points = load_from(candidates, 0, i, POINTS)
        nearest, label = load(distances, i, POINTS), load(labels, i, POINTS)
        for j in range(first, last):
            apart = points - three_of(centres[j])
            distance = dot(apart, apart)
            is_nearer = distance < nearest
            nearest, label = select(is_nearer, distance, nearest), select(is_nearer, float(j), label)
        store(distances, i, nearest)
        store(labels, i, label)


@compiled
def start_centres(clusters: Clusters, position_h: Floats, num_centres: int) -> int:
    """Add the missing centres that clustering starts from; return the number of centres, ``ceil(m/10)``.

    Of the centres of the last step the first ``ceil(m/10)`` stay. Each missing one starts at the candidate
    farthest from all centres so far (the very first: nearest the deputy; among equals the lowest index),
    moved towards the deputy by `CENTRE_SHIFT_M`.
    """
    candidates, num_candidates, centres = clusters.candidates, clusters.num_candidates, clusters.centres
    labels, distances = clusters.labels[0], clusters.distances
    wanted = num_clusters(num_candidates)
    ready = min(num_centres, wanted)
    if ready < wanted:
        distances[:] = np.inf
        _assign(clusters, 0, ready, labels)
    for j in range(ready, wanted):
        if j == 0:
            chosen = nearest_row(candidates.T, num_candidates, position_h)
        else:
            chosen = 0
            for i in range(1, num_candidates):
                if distances[i] > distances[chosen] + TIE_M2:
                    chosen = i
        candidate = lane_of(candidates, 0, chosen)
        towards = three_of(position_h) - candidate
        share = CENTRE_SHIFT_M / max(sqrt(dot(towards, towards)), 1e-300)
        write_three(centres[j], candidate + share * towards)
        _assign(clusters, j, j + 1, labels)
    return wanted


@compiled
def _is_same(labels: Floats, labels_before: Floats, num_candidates: int) -> bool:
    """Return whether the assignments of two passes agree."""
    num_different = 0
    for i in range(num_candidates):
        num_different += labels[i] != labels_before[i]
    return num_different == 0


@compiled
def _sum_up(clusters: Clusters, labels: Floats, wanted: int) -> bool:
    """Sum the coordinates of each cluster and count its members; return whether one is empty."""
    candidates, num_candidates, sums = clusters.candidates, clusters.num_candidates, clusters.sums
    sums[:wanted] = 0.0
    for i in range(num_candidates):
        j = int(labels[i])
        sums[j, 0] += candidates[0, i]
        sums[j, 1] += candidates[1, i]
        sums[j, 2] += candidates[2, i]
        sums[j, 3] += 1.0
    has_empty = False
    for j in range(wanted):
        has_empty |= sums[j, 3] == 0.0
    return has_empty


@compiled
def _relocate_empty_clusters(clusters: Clusters, labels: Floats, wanted: int) -> None:
    """Move every empty cluster to the candidate farthest from its centre that is not yet taken."""
    candidates, num_candidates = clusters.candidates, clusters.num_candidates
    distances, sums = clusters.distances, clusters.sums
    if distances[:num_candidates].max() == 0.0:
        return
    for j in range(wanted):  # those emptied below, by giving their last candidate away, stay empty
        if sums[j, 3] == 0.0:
            sums[j, 3] = -1.0
    for j in range(wanted):
        if sums[j, 3] >= 0.0:
            continue
        farthest = int(distances[:num_candidates].argmax())
        distances[farthest] = -1.0
        donor = int(labels[farthest])
        for axis in range(3):
            sums[donor, axis] -= candidates[axis, farthest]
            sums[j, axis] = candidates[axis, farthest]
        sums[donor, 3] -= 1.0
        sums[j, 3] = 1.0


@compiled
def _average(clusters: Clusters, wanted: int) -> None:
    """Put each centre at the mean of its cluster; that of an empty one stays."""
    sums, centres = clusters.sums, clusters.centres
    for j in range(wanted):
        if sums[j, 3] > 0.0:
            share = 1.0 / sums[j, 3]
            for axis in range(3):
                centres[j, axis] = sums[j, axis] * share


@compiled
def cluster_centres(clusters: Clusters, position_h: Floats, num_centres: int) -> int:
    """Cluster the candidates, from the centres of the last step; return the number of centres.

    If the candidates are those of the last step, the centres stay bit-identical: the caller may then skip
    the call.
    """
    num_candidates, labels = clusters.num_candidates, clusters.labels
    wanted = num_clusters(num_candidates)
    if wanted == 0:
        return 0
    if wanted == 1:  # the mean, wherever it starts
        labels[0, :num_candidates] = 0
        _sum_up(clusters, labels[0], 1)
        _average(clusters, 1)
        return 1
    start_centres(clusters, position_h, num_centres)
    for iteration in range(MAX_ITERATIONS):
        now = labels[iteration % 2]
        clusters.distances[:] = np.inf
        _assign(clusters, 0, wanted, now)
        if iteration > 0 and _is_same(now, labels[1 - iteration % 2], num_candidates):
            break
        if _sum_up(clusters, now, wanted):
            _relocate_empty_clusters(clusters, now, wanted)
        _average(clusters, wanted)
    return wanted


@compiled
def nearest_row(positions: Floats, num_positions: int, position_h: Floats) -> int:
    """Return the row, of some first ones, shape (n, 3), nearest the deputy; among equals the lowest."""
    chosen = 0
    nearest = np.inf
    for j in range(num_positions):
        apart = three_of(positions[j]) - three_of(position_h)
        distance = dot(apart, apart)
        if distance < nearest - TIE_M2:
            nearest = distance
            chosen = j
    return chosen
