"""One flight whose targets scikit-learn chooses, period by period in plain Python: for comparison, slowly."""

from functools import cache
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.cases import Cases
from pipeline.flight.fly.logged import write_period, write_sample
from pipeline.flight.fly.many import start_lanes
from pipeline.flight.fly.workspace import Parts, make_state, make_workspace
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.look.guidance import MAX_ITERATIONS, nearest_centre, start_centres
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state.arrays import Law, State, Workspace, World
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import SETTING, URGENCY


@cache
def _kmeans() -> tuple[Any, Any]:
    """Return scikit-learn's KMeans and a thread limiter; imported only here, as that takes a second."""
    from sklearn.cluster import KMeans  # noqa: PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415

    return KMeans, ThreadpoolController()


def choose_cluster(world: World, state: State, work: Workspace, k: int) -> None:
    """Make the nearest of scikit-learn's cluster centres the target of lane 0."""
    is_candidate = work.candidate[: world.num_points] > 0.0
    if not is_candidate.any():
        state.num_centres[0] = 0
        return
    points = world.points[k if len(world.points) > 1 else 0][:, : world.num_points][:, is_candidate]
    centres, position = state.centres[0], np.array(state.truth.position[:, 0])
    candidates = np.zeros_like(work.candidates)
    candidates[:, : points.shape[1]] = points
    wanted = start_centres(
        candidates,
        points.shape[1],
        position,
        centres,
        int(state.num_centres[0]),
        work.labels[0],
        work.distances,
    )
    kmeans, threads = _kmeans()
    # with so few points one thread is fastest
    with threads.limit(limits=1, user_api="openmp"):
        options = {"n_init": 1, "max_iter": MAX_ITERATIONS, "tol": 0, "algorithm": "lloyd"}
        fitted = kmeans(n_clusters=wanted, init=centres[:wanted], **options).fit(points.T)
    centres[:wanted], state.num_centres[0] = fitted.cluster_centers_, wanted
    state.lanes.target[:, 0] = centres[nearest_centre(centres, wanted, position)]


def fly_plainly(
    world: World,
    parts: Parts,
    law: Law,
    values: Floats,
    rules: Integers,
    cases: Cases,
    counted: Bytes,
    log: FlightLog,
) -> None:
    """Fly one flight and log it; see `pipeline.flight.fly.many.fly_many` for the arguments."""
    optics, guard, _, pushes, errors = parts
    state, work, starts = make_state(world, errors, 1), make_workspace(world, 1), cases.starts
    with plainly("pipeline"):
        start_lanes(world, state, starts, counted, 0, 1)
        if law.needs & (URGENCY | SETTING):
            note_deadlines(world, optics, state, work, 1)
        for k in range(world.num_controls + 1):
            look(world, optics, None, errors, law.plans, state, work, 0, 1, k)
            choose_cluster(world, state, work, k)
            write_sample(world, errors, state, work, counted[0], log, k, starts[0])
            if k == world.num_controls:
                break
            decide(world, optics, pushes, law, values, rules, state, work, 0, 1, k)
            act(world, guard, errors, law.plans, state, work, 0, 1, k)
            write_period(world, law, values, state, work, errors, log, k, False)
