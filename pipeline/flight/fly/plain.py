"""Flights whose targets scikit-learn chooses, in plain Python: for comparison, slowly."""

from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.flight.period.look.guidance import MAX_ITERATIONS, Clusters, cluster_centres, start_centres
from pipeline.settings.experiment import Mission


@cache
def _kmeans() -> tuple[Any, Any]:
    """Return scikit-learn's KMeans and a thread limiter; imported only here, as that takes a second."""
    from sklearn.cluster import KMeans  # noqa: PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415

    return KMeans, ThreadpoolController()


def centres_by_sklearn(clusters: Clusters, position_h: Floats, num_centres: int) -> int:
    """Return what `pipeline.flight.period.look.guidance.cluster_centres` does, computed by scikit-learn."""
    wanted = start_centres(clusters, position_h, num_centres)
    kmeans, threads = _kmeans()
    # with so few points one thread is fastest
    with threads.limit(limits=1, user_api="openmp"):
        options = {"n_init": 1, "max_iter": MAX_ITERATIONS, "tol": 0, "algorithm": "lloyd"}
        fitted = kmeans(n_clusters=wanted, init=clusters.centres[:wanted], **options)
        fitted.fit(clusters.candidates[:, : clusters.num_candidates].T)
    clusters.centres[:wanted] = fitted.cluster_centers_
    return wanted


def is_interpreted(mission: Mission) -> bool:
    """Return whether flights are plain Python: those whose clusters are scikit-learn's."""
    return mission.guidance.kind == "clusters" and mission.guidance.engine == "sklearn"


def plain_if_interpreted(mission: Mission) -> AbstractContextManager[None]:
    """Run flights inside the block, on this thread, in plain Python if `is_interpreted` says so."""
    if is_interpreted(mission):
        return plainly("pipeline", {cluster_centres: centres_by_sklearn})
    return nullcontext()
