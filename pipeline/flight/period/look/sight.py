"""What the deputies see at a sample: points inspected, and the target chosen among those left."""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    chosen,
    lane_of,
    length,
    load_at,
    load_three,
    same,
    store_three,
    three_of,
    totals,
    write_lane,
)
from fis_tools.compiled.vectors import count, least, load, most, select, some, splat, store
from pipeline.array_types import Floats
from pipeline.flight.period.look.guidance import POINTS, Clusters, cluster_centres, nearest_row
from pipeline.flight.period.look.optics import beam_now, eye_at, lit_points, seen_points, sun_after, up_now
from pipeline.flight.state.arrays import FlightState, FullOptics, Moment, Workspace
from pipeline.flight.state.lanes import load_pair, load_quaternion, load_row, store_pair, write_row
from pipeline.physics.quaternion import to_hill


@compiled(error_model="numpy", forceinline=True)
def inspect(
    now: Moment,
    optics: FullOptics | None,
    lane: int,
    candidate_marks: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
) -> None:
    """Inspect what is lit and in view of a lane's camera; the target is the mean of the other lit points.

    Writes into `candidate_marks`, (P padded,), 1 for each of those.
    """
    world, state, lanes = now.world, now.state, now.state.lanes
    beam = beam_now(now, optics, lane)
    position, boresight = lane_of(state.truth.position, 0, lane), lane_of(state.truth.boresight, 0, lane)
    eye = eye_at(world, optics, beam, position, boresight, up_now(now, optics, lane))
    num_seen, num_left = 0, 0
    zeros = splat(0.0, POINTS)
    centre = same(0.0, POINTS)
    for j in range(0, world.points.shape[2], POINTS):
        before = load(state.unseen, (lane, j), POINTS)
        wanted = before > 0.0
        if not (beam.shines and some(wanted)):
            store(candidate_marks, j, zeros)
            continue
        points = load_at(world.points, beam.sample, 0, j, POINTS)
        left = lit_points(world, optics, lit_marks, j, points, wanted, beam)
        if not some(left):
            store(candidate_marks, j, zeros)
            continue
        if not eye.is_blind:
            seen = seen_points(world, optics, seen_marks, j, points, left, eye)
            left = left ^ seen
            store(state.unseen, (lane, j), select(seen, zeros, before))
            num_seen += count(seen)
        store(candidate_marks, j, select(left, 1.0, zeros))
        num_left += count(left)
        centre += chosen(left, points, same(0.0, POINTS))
    lanes.num_unseen[lane] -= num_seen
    lanes.num_candidates[lane] = num_left
    write_lane(lanes.target, 0, lane, totals(centre) / max(num_left, 1))


@compiled(error_model="numpy", forceinline=True)
def are_new(state: FlightState, candidate_marks: Floats, lane: int) -> bool:
    """Return whether the candidates differ from those clustered last, and store them as clustered."""
    num_different = 0
    for j in range(0, len(candidate_marks), POINTS):
        now = load(candidate_marks, j, POINTS)
        num_different += count(now != load(state.clustered, (lane, j), POINTS))
        store(state.clustered, (lane, j), now)
    return num_different > 0


@compiled(error_model="numpy")
def choose_cluster(
    now: Moment,
    lane: int,
    candidate_marks: Floats,
    candidates: Floats,
    labels: Floats,
    distances: Floats,
    sums: Floats,
) -> None:
    """Cluster the candidates of a lane, and make the centre nearest to the deputy its target.

    Centres stay unchanged if the candidates are not new. Overwrites the last four arrays, see `Clusters`.
    """
    world, state, lanes = now.world, now.state, now.state.lanes
    position, centres = np.empty(3), state.centres[lane]
    num_candidates = int(lanes.num_candidates[lane])
    if num_candidates == 0:
        state.num_centres[lane] = 0
        state.clustered[lane, 0] = -1.0  # so that the next candidates are new
        return
    write_row(position, state.truth.position, lane)
    if are_new(state, candidate_marks, lane) or len(world.points) > 1:
        filled, sample = 0, (now.k if len(world.points) > 1 else 0)
        for j in range(world.num_points):  # without a branch, which processors cannot predict
            for axis in range(3):
                candidates[axis, filled] = world.points[sample, axis, j]
            filled += int(candidate_marks[j])
        clusters = Clusters(candidates, num_candidates, centres, labels, distances, sums)
        state.num_centres[lane] = cluster_centres(clusters, position, state.num_centres[lane])
    nearest = nearest_row(centres, state.num_centres[lane], position)
    write_lane(lanes.target, 0, lane, three_of(centres[nearest]))


@compiled(error_model="numpy", forceinline=True)
def see(now: Moment, work: Workspace, optics: FullOptics | None, clusters: bool | None) -> None:
    """Inspect, and choose the target, of every lane; add up distances."""
    world, lanes, truth, k = now.world, now.state.lanes, now.state.truth, now.k
    sun, height = sun_after(world, load_pair(lanes.sun_at_start), load_pair(lanes.height_at_start), k)
    store_pair(lanes.sun, 0, sun[0], sun[1])
    store_pair(lanes.sun_height, 0, height[0], height[1])
    distance = length(load_three(truth.position, 0))
    store(lanes.travelled, 0, load_row(lanes.travelled) + distance)
    store(lanes.nearest, 0, least(distance, load_row(lanes.nearest)))
    store(lanes.farthest, 0, most(distance, load_row(lanes.farthest)))
    if k > world.first:
        beyond = most(world.min_distance - distance, distance - world.max_distance)
        store(lanes.beyond, 0, most(beyond, load_row(lanes.beyond)))
        keep_out = world.keep_out[now.k if len(world.keep_out) > 1 else 0]
        for row in range(len(keep_out)):
            x, y, z, radius = keep_out[row, 0], keep_out[row, 1], keep_out[row, 2], keep_out[row, 3]
            inside = radius - length(load_three(truth.position, 0) - Three(x, y, z))
            store(lanes.beyond, 0, most(inside, load_row(lanes.beyond)))
    store_three(truth.boresight, 0, to_hill(load_quaternion(truth.attitude), three_of(world.boresight)))
    for lane in range(now.num_lanes):
        inspect(now, optics, lane, work.candidate_marks, work.lit, work.seen)
        if clusters is not None and world.has_clusters:  # by the first the code is left out
            choose_cluster(
                now, lane, work.candidate_marks, work.candidates, work.labels, work.distances, work.sums
            )
