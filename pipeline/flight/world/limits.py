"""What a logged flight does to its limits: on the distance, spheres about parts of the chief, and wheels."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.state.log import FULL, FlightLog
from pipeline.physics.quaternion import dcms_b_from_h
from pipeline.settings.experiment import Mission


def depths_in_spheres(mission: Mission, log: FlightLog) -> Floats:
    """Return how deep the deputy is in each sphere of `chief.keep_out_m`, (K+1, S), m: negative outside."""
    depths = np.empty((len(log.position_m), 0))
    if not mission.chief.keep_out_m:
        return depths
    samples = zip(dcms_b_from_h(log.quaternion_c_from_h), log.position_m, strict=True)
    position_c = np.array([dcm @ position for dcm, position in samples])
    for *centre, radius in mission.chief.keep_out_m:
        depth = radius - np.linalg.norm(position_c - centre, axis=1)
        depths = np.column_stack((depths, depth))
    return depths


def metres_beyond(mission: Mission, log: FlightLog) -> Floats:
    """Return by how much the limit that is exceeded most is exceeded, (K+1,), m: negative inside them all."""
    distance, limits = np.linalg.norm(log.position_m, axis=1), mission.deputy
    beyond = np.maximum(limits.min_distance_m - distance, distance - limits.max_distance_m)
    return np.column_stack((beyond, depths_in_spheres(mission, log))).max(axis=1)


def wheel_is_full(mission: Mission, log: FlightLog) -> Booleans:
    """Return whether some wheel holds what it can, at each instant of the attitude clock, (K, S)."""
    most = mission.deputy.max_momentum_n_m_s or np.inf
    return np.asarray((np.abs(log.wheel_momentum_b_n_m_s) >= FULL * most).any(axis=2))
