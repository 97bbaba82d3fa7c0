"""One flight whose targets scikit-learn chooses, period by period in plain Python: for comparison, slowly."""

from functools import cache
from typing import Any

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.flight.fly.logged import write_period, write_sample
from pipeline.flight.fly.many import Flights, Results, start_lanes, write_outcomes
from pipeline.flight.fly.workspace import Parts, make_state, make_workspace
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.look.guidance import MAX_ITERATIONS, Clusters, nearest_centre, start_centres
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state.arrays import Control, Moment
from pipeline.flight.state.signals import SETTING, URGENCY


@cache
def _kmeans() -> tuple[Any, Any]:
    """Return scikit-learn's KMeans and a thread limiter; imported only here, as that takes a second."""
    from sklearn.cluster import KMeans  # noqa: PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415

    return KMeans, ThreadpoolController()


def choose_cluster(now: Moment) -> None:
    """Make the nearest of scikit-learn's cluster centres the target of lane 0."""
    world, state, work, k = now.world, now.state, now.work, now.k
    is_candidate = work.candidate[: world.num_points] > 0.0
    if not is_candidate.any():
        state.num_centres[0] = 0
        return
    points = world.points[k if len(world.points) > 1 else 0][:, : world.num_points][:, is_candidate]
    centres, position = state.centres[0], np.array(state.truth.position[:, 0])
    candidates = np.zeros_like(work.candidates)
    candidates[:, : points.shape[1]] = points
    clusters = Clusters(candidates, points.shape[1], centres, work.labels, work.distances, work.sums)
    wanted = start_centres(clusters, position, int(state.num_centres[0]))
    kmeans, threads = _kmeans()
    # with so few points one thread is fastest
    with threads.limit(limits=1, user_api="openmp"):
        options = {"n_init": 1, "max_iter": MAX_ITERATIONS, "tol": 0, "algorithm": "lloyd"}
        fitted = kmeans(n_clusters=wanted, init=centres[:wanted], **options).fit(points.T)
    centres[:wanted], state.num_centres[0] = fitted.cluster_centers_, wanted
    state.lanes.target[:, 0] = centres[nearest_centre(centres, wanted, position)]


def fly_plainly(parts: Parts, flights: Flights, results: Results) -> None:
    """Fly and log the one flight of one controller; see `pipeline.flight.fly.many.fly_many`."""
    optics, guard, _, pushes, errors = parts
    world, law, log = flights.world, flights.law, results.log
    control = Control(law, flights.values[0], flights.rules[0])
    now = Moment(world, make_state(world, errors, 1), make_workspace(world, 1), 0, 1, 0)
    with plainly("pipeline"):
        start_lanes(now, flights.cases, flights.counted)
        if law.needs & (URGENCY | SETTING):
            note_deadlines(now, optics)
        for k in range(world.num_controls + 1):
            now = now._replace(k=k)
            look(now, optics, None, errors, law.plans)
            choose_cluster(now)
            write_sample(now, errors, flights.counted[0], log, flights.cases[0])
            if k == world.num_controls:
                write_outcomes(now, 0, results.outcomes)
                break
            decide(now, optics, pushes, control)
            act(now, guard, errors, law.plans)
            write_period(now, optics, control, errors, log, False)
