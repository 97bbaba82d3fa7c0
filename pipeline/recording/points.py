"""Each point of the chief in a flight's log: what it adds to signals, and whether it was lit.

Some signals are made of points. Their formulas are those of docs/reference/signals.md.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fis_tools.compiled.decorator import compiled, plainly
from fis_tools.compiled.three import load_at, three_of
from fis_tools.compiled.vectors import load, select, store
from pipeline.array_types import Booleans, Bytes, Floats, Integers
from pipeline.flight.control.controller import Controller, sensed_by, stretches_of
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.decide.see_push import KS2
from pipeline.flight.period.decide.tour import time_ahead
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M, POINTS
from pipeline.flight.period.look.optics import beam_from, eye_at, note_lit, seen_points
from pipeline.flight.state.arrays import FullOptics, Workspace, World
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import TOUR_PARTS, TOUR_WAVES, constant
from pipeline.physics.motion import state_transition
from pipeline.physics.quaternion import seen_from_hill

#: signals made of points: the vector that each belongs to, and the place of its component
MADE_OF_POINTS = {
    f"{vector}_{axis}": (vector, column)
    for vector in ("target", "urgent", "see_push", "aim", "tour_push")
    for column, axis in enumerate(("radial", "along_track", "cross_track"))
}


def sensed_of_points(world: World, controller: Controller) -> list[str]:
    """Return the signals made of points that a controller senses; a target chosen by clusters is none."""
    names = [name for name in dict.fromkeys(sensed_by(controller)) if name in MADE_OF_POINTS]
    return [name for name in names if not (world.has_clusters and name.startswith("target"))]


def parts_of_points(
    world: World, controller: Controller, log: FlightLog, samples: Integers
) -> dict[str, Floats]:
    """Return each point's part in each signal that is made of points, for the signals that are sensed.

    The parts sum to the signal; of ``tour_push_*``, to what leaning the tour towards points adds.

    Parameters
    ----------
    world : World
        Of the case that was flown.
    controller : Controller
        As it was flown: where it rehearses tours, one that follows those that it followed.
    log : FlightLog
    samples : (n,)
        Parts are zero at those without an inference.

    Returns
    -------
    dict of str to (n, P)
        In the unit of the signal.
    """
    names = sensed_of_points(world, controller)
    parts = {name: np.zeros((len(samples), world.num_points)) for name in names}
    ends = [*controller.changes, world.num_controls + 1]
    for (begin, stretch), end in zip(stretches_of(controller), ends, strict=True):
        rows = np.flatnonzero((begin <= samples) & (samples < end) & log.is_decided[samples])
        decisions = _Decisions(world, stretch.constants, log, samples[rows])
        for name in names:
            vector, axis = MADE_OF_POINTS[name]
            parts[name][rows] = getattr(decisions, vector)[..., axis]
    return parts


@dataclass(frozen=True)
class _Decisions:
    """The parts that points have in the signals of n decisions; vectors are (n, P, 3), Hill axes."""

    world: World
    constants: Floats
    log: FlightLog
    samples: Integers

    def __getitem__(self, name: str) -> float:
        return float(self.constants[constant(name)])

    @cached_property
    def states(self) -> Floats:
        """Position (m) and velocity (m/s) as the deputy knew them, (n, 6)."""
        is_estimated = np.any(self.log.estimate_covariance)
        true = np.hstack([self.log.position_m, self.log.velocity_m_s])
        return (self.log.estimate if is_estimated else true)[self.samples]

    @cached_property
    def points(self) -> Floats:
        """The points in Hill axes, (n or 1, P, 3), m."""
        rows = self.world.points[self.samples if len(self.world.points) > 1 else [0]]
        return np.swapaxes(rows[:, :, : self.world.num_points], 1, 2)

    @cached_property
    def urgency(self) -> Floats:
        """The weight of each point by its last light, (n, P)."""
        left = self.log.last_light_s - self.world.control_period * self.samples[:, np.newaxis]
        return np.exp(-left / self["urgency_time_s"])

    @cached_property
    def target(self) -> Floats:
        """Each point's part of the target's direction, (n, P, 3)."""
        candidates = self.log.is_candidate[self.samples][..., np.newaxis] * self.points
        length = np.linalg.norm(candidates.sum(axis=1, keepdims=True), axis=2, keepdims=True)
        return candidates / np.maximum(length, MIN_PROJECTION_M)

    @cached_property
    def urgent(self) -> Floats:
        """Each point's part of the urgent direction, (n, P, 3)."""
        weights = (self.urgency * self.log.is_candidate[self.samples])[..., np.newaxis]
        pulls = weights * self.points
        length = np.linalg.norm(pulls.sum(axis=1, keepdims=True), axis=2, keepdims=True)
        has_way = length > MIN_PROJECTION_M * weights.sum(axis=1, keepdims=True)
        return self.turned_aside(np.divide(pulls, length, out=np.zeros_like(pulls), where=has_way))

    @cached_property
    def see_push(self) -> Floats:
        """Each point's part of the push from which what sets is still seen, m/s, (n, P, 3)."""
        short, slopes = self.log.looks[self.samples, :, 0], self.log.looks[self.samples, :, 1:]
        weighted = self.urgency[..., np.newaxis] * slopes
        matrix = self["see_damping_ks2"] * KS2 * np.eye(3) + np.swapaxes(weighted, 1, 2) @ slopes
        pulls = np.linalg.solve(matrix, np.swapaxes(short[..., np.newaxis] * weighted, 1, 2))
        return self.turned_aside(np.swapaxes(pulls, 1, 2))

    @cached_property
    def aim(self) -> Floats:
        return self.see_push + self["aim_urgent_m_s"] * self.urgent

    @cached_property
    def tour_push(self) -> Floats:
        """Return each point's part of the push onto the tour, m/s, (n, P, 3)."""
        parts, rest_of_push = np.zeros_like(self.urgent), np.zeros((len(self.samples), 3))
        first = constant("tour_radial_mean_m")
        waves = self.constants[first:][: len(TOUR_PARTS) * len(TOUR_WAVES)].reshape(len(TOUR_PARTS), -1)
        n, limits = self.world.mean_motion, (self["tour_time_s"], self["tour_wait_s"])
        for row, k in enumerate(self.samples):
            angle, up = self.log.sun_angle_rad[k], self.log.sun_elevation_rad[k]
            with plainly("pipeline"):
                sun = np.cos(angle), np.sin(angle)
                time = time_ahead(self.world.optics.least_height, n, *limits, sun, np.cos(up))
                phi = state_transition(n, time)
            if time == 0.0:
                continue
            then = angle - n * time
            x, y, z, lift = waves @ [1.0, *(f(i * then) for i in (1.0, 2.0) for f in (np.cos, np.sin))]
            push_by = np.linalg.inv(phi[:3, 3:])
            rest_of_push[row] = push_by @ ([x, y, z + np.sin(up) * lift] - phi[:3] @ self.states[row])
            parts[row] = self["tour_lean_m"] * self.urgent[row] @ push_by.T
        return self.turned_aside(parts, rest_of_push)

    def turned_aside(self, parts: Floats, rest_of_push: Floats | float = 0.0) -> Floats:
        """Return the points' parts of pushes, (n, P, 3), turned outwards near the chief as the pushes are.

        `rest_of_push`, (n, 3), is what belongs to no point.
        """
        position, skirt, least = self.states[:, :3], self["skirt_distance_m"], self.world.min_distance
        if not least < skirt:
            return parts
        distance = np.linalg.norm(position, axis=1, keepdims=True)
        outward = position / distance
        leads_in = np.sum((parts.sum(axis=1) + rest_of_push) * outward, axis=1, keepdims=True) < 0.0
        nearness = np.clip((skirt - distance) / (skirt - least), 0.0, 1.0) * leads_in
        along = parts @ outward[..., np.newaxis]
        return parts - 2.0 * nearness[..., np.newaxis] * along * outward[:, np.newaxis]


@compiled(nogil=True, error_model="numpy")
def note_lit_and_seen(
    world: World,
    optics: FullOptics | None,
    work: Workspace,
    suns: Floats,
    positions: Floats,
    boresights: Floats,
    ups: Floats,
    left: Bytes,
    lit: Bytes,
    seen: Bytes,
) -> None:
    """Write which of the points left are lit at the samples of a flight, and which dark ones are in view.

    Suns, (K+1, 4), are cosine and sine of the Sun's angle and of its elevation; places (m), boresights of
    the camera and what is up in its image, (K+1, 3), are in Hill axes; `left`, `lit` and `seen`, (K+1, P
    padded), are 0 or 1.
    """
    ahead = work.ahead
    for k in range(len(positions)):
        beam = beam_from(world, optics, k, (suns[k, 0], suns[k, 1]), (suns[k, 2], suns[k, 3]))
        eye = eye_at(world, optics, beam, three_of(positions[k]), three_of(boresights[k]), three_of(ups[k]))
        for j in range(len(ahead)):
            ahead[j] = left[k, j]
        note_lit(world, optics, ahead, work.lit, beam)
        for j in range(0, len(ahead), POINTS):
            dark, points = load(ahead, j, POINTS) > 0.0, load_at(world.points, beam.sample, 0, j, POINTS)
            seen_dark = seen_points(world, optics, work.seen, j, points, dark, eye)
            store(ahead, j, select(seen_dark, 1.0, 0.0))
        for j in range(len(ahead)):
            lit[k, j], seen[k, j] = work.lit[j] > 0.0, ahead[j] > 0.0 and not eye.is_blind


def lit_and_seen(world: World, log: FlightLog) -> tuple[Booleans, Booleans]:
    """Return which points not inspected are lit, and which dark ones are in view, at each sample."""
    angles, num_points = (log.sun_angle_rad, log.sun_elevation_rad), world.num_points
    left = np.zeros((len(log.position_m), world.points.shape[2]), dtype=np.uint8)
    left[:, :num_points] = ~log.is_inspected
    boresight, up = (seen_from_hill(log.quaternion_b_from_h, axis) for axis in (world.boresight, world.up))
    lit, seen = np.zeros_like(left), np.zeros_like(left)
    beyond = optics_in_use(world, log.sun_elevation_rad)
    suns = np.stack([turn(angle) for angle in angles for turn in (np.cos, np.sin)], axis=1)
    work = make_workspace(world)
    note_lit_and_seen(world, beyond, work, suns, log.position_m, boresight, up, left, lit, seen)
    return lit[:, :num_points] > 0, seen[:, :num_points] > 0
