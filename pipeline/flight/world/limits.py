"""By how much a logged flight exceeds its limits: on the distance, and spheres about parts of the chief."""

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.state.log import FlightLog
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.settings.experiment import Mission


def depths_in_spheres(mission: Mission, log: FlightLog) -> Floats:
    """Return how deep the deputy is in each sphere of `chief.keep_out_m`, (K+1, S), m: negative outside."""
    depths = np.empty((len(log.position_m), 0))
    if not mission.chief.keep_out_m:
        return depths
    samples = zip(log.quaternion_c_from_h, log.position_m, strict=True)
    position_c = np.array([dcm_b_from_h(quaternion) @ position for quaternion, position in samples])
    for *centre, radius in mission.chief.keep_out_m:
        depth = radius - np.linalg.norm(position_c - centre, axis=1)
        depths = np.column_stack((depths, depth))
    return depths


def metres_beyond(mission: Mission, log: FlightLog) -> Floats:
    """Return by how much the limit that is exceeded most is exceeded, (K+1,), m: negative inside them all."""
    distance, limits = np.linalg.norm(log.position_m, axis=1), mission.deputy
    beyond = np.maximum(limits.min_distance_m - distance, distance - limits.max_distance_m)
    return np.column_stack((beyond, depths_in_spheres(mission, log))).max(axis=1)
