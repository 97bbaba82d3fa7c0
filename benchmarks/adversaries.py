"""Controllers that mean harm, against the safety layer: ``python -m benchmarks adversaries``.

From random starts at rest between the layer's spheres, a fifth of them next to one, in every world of
``+experiment=robustness``, and in the last with a layout of thrusters and with dispersed settings too, six
adversaries push at 1 N and at 0.01 N: towards the chief, away from it, along each axis, and at random. It
counts flights that leave the limits at any second. With ``--at-bound`` thrusters are off by as much as the
layer's proof allows.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Variable, table_rules
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.cases.starts import Cases, cases_of
from pipeline.flight.control.controller import Controller, from_fuzzy, open_loop
from pipeline.flight.fly import simulation
from pipeline.flight.state.arrays import TRACK_FORCE
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.physics.motion import motion_over
from pipeline.settings.experiment import Mission
from pipeline.settings.schema import in_world

#: noise seeds of the starts, as of an evaluation
SEED, STAGE = 20261122, 1
FORCES_N = (1.0, 0.01)
#: flights whose tracks are in memory at once
PART = 500
#: of the settings of the last world
DISPERSIONS = {
    "deputy": {
        "mass_kg": {"kind": "normal", "mean": 12.0, "std": 0.5},
        "max_torque_n_m": {"kind": "normal", "mean": 0.01, "std": 0.002, "low": 0.005},
    },
    "dynamics": {"drag_m_s2": {"kind": "uniform", "low": -6e-7, "high": 6e-7}},
    "navigation": {"noise_m": {"kind": "uniform", "low": 0.5, "high": 2.0}},
}


def missions(safety: str) -> Iterator[tuple[str, Mission]]:
    """Yield each world's mission and its name."""
    composed = compose_experiment(["+experiment=robustness", f"safety={safety}"]).experiment
    for name in composed.compare.worlds:
        mission = in_world(composed, name).mission
        mission = replace(mission, attitude=replace(mission.attitude, mode="ideal"))
        yield name, mission
    layout = compose_experiment(["+experiment=evaluate", "controller=coast", "actuators=layout"]).experiment
    yield f"{name}, layout", replace(mission, actuators=layout.mission.actuators)
    yield f"{name}, dispersed", replace(mission, dispersions=DISPERSIONS)


def radial(force_n: float) -> Controller:
    """Push away from the chief; towards it where the force is negative."""
    seen = Variable("distance", "m", 0.0, 250.0, (Term("any", Gaussian(125.0, 500.0)),))
    reach = 2.0 * abs(force_n)
    terms = (Term("push", Gaussian(force_n, 0.1 * reach)),)
    output = Variable("force_x", "N", -reach, reach, terms, default=force_n)
    system = FuzzySystem("push", (seen,), (output,), table_rules((seen,), output, ["push"]))
    return from_fuzzy(FuzzyController("radial", (system,), (("force_axes", "body"),)))


def adversaries(num_controls: int, force_n: float) -> Iterator[tuple[str, Controller]]:
    """Yield each adversary and its name."""
    yield "towards the chief", radial(-force_n)
    yield "away from it", radial(force_n)
    for axis, row in zip("xyz", np.eye(3), strict=True):
        yield f"along {axis}", open_loop(axis, np.tile(force_n * row, (num_controls, 1)))
    random = np.random.default_rng(SEED)
    yield "at random", open_loop("random", random.uniform(-force_n, force_n, (num_controls, 3)))


def starts_in(mission: Mission, count: int) -> list[Scenario]:
    """Return starts at rest between the layer's spheres, the Sun anywhere."""
    random = np.random.default_rng(SEED)
    positions = random.normal(size=(count, 3))
    near, far = spheres_of(mission, bounds_of(mission))
    distances = random.uniform(near, far, count)
    distances[::10], distances[5::10] = near + 0.01, far - 0.01
    positions *= (distances / np.linalg.norm(positions, axis=1))[:, np.newaxis]
    suns = random.uniform(0.0, 2.0 * np.pi, count)
    return [
        Scenario(position, np.zeros(3), float(sun), 0.0, (SEED, STAGE, case))
        for case, (position, sun) in enumerate(zip(positions, suns, strict=True))
    ]


def cases_at_bound(mission: Mission, starts: list[Scenario]) -> Cases:
    """Return cases whose thrusters are off by the whole bound: too strong, too weak, or in any direction."""
    cases, share = cases_of(mission, starts), bounds_of(mission).errors.share
    random = np.random.default_rng([start.noise[2] for start in starts])
    off, _ = np.linalg.qr(random.normal(size=(len(starts), 3, 3)))
    off[::4], off[1::4] = np.eye(3), -np.eye(3)
    matrices = np.eye(3) + share * off[:, np.newaxis] + np.zeros_like(cases.firing.errors.matrices)
    return replace(
        cases, firing=cases.firing._replace(errors=cases.firing.errors._replace(matrices=matrices))
    )


def extremes(mission: Mission, controller: Controller, starts: list[Scenario]) -> np.ndarray:
    """Return the least and the greatest distance of each flight, at all seconds, m: shape (n, 2).

    Between samples a deputy moves as Clohessy and Wiltshire say, under the force fired.
    """
    motion = motion_over(mission.orbit, mission.deputy, np.arange(mission.control_period_s).tolist())
    to_place = np.concatenate([motion.transition, motion.control], axis=2)[:, :3]
    _, tracks = fly_tracked(mission, controller, starts, None)
    masses = [dict(drawn(mission, start)).get("deputy.mass_kg", mission.deputy.mass_kg) for start in starts]
    tracks[..., TRACK_FORCE : TRACK_FORCE + 3] *= mission.deputy.mass_kg / np.reshape(masses, (-1, 1, 1))
    pushed = np.concatenate([tracks[..., :6], tracks[..., TRACK_FORCE : TRACK_FORCE + 3]], axis=2)
    distances = [np.linalg.norm(pushed @ rows.T, axis=2) for rows in to_place.astype(np.float32)]
    return np.stack([np.min(distances, axis=(0, 2)), np.max(distances, axis=(0, 2))], axis=1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly them; print a row for each world and strength."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks adversaries", description=__doc__)
    parser.add_argument("--starts", type=int, default=10_000, help="of each adversary in each world")
    parser.add_argument("--safety", default="robust", help="an option of conf/safety")
    parser.add_argument("--at-bound", action="store_true", help="thrusters off by the whole bound")
    parser.add_argument("--only", default="", help="worlds with this text in their name")
    options = parser.parse_args(arguments)
    print("| world | push (N) | flights | outside at any second | nearest, farthest (m) |")
    print("|---|---|---|---|---|")
    for name, mission in missions(options.safety):
        if options.only not in name:
            continue
        if options.at_bound and (mission.actuators.kind == "ideal" or mission.dispersions):
            continue
        starts, limits = starts_in(mission, options.starts), mission.deputy
        for force in FORCES_N:
            with patch.object(simulation, "cases_of", cases_at_bound if options.at_bound else cases_of):
                flown = np.concatenate(
                    [
                        extremes(mission, controller, starts[first : first + PART])
                        for _, controller in adversaries(mission.num_controls, force)
                        for first in range(0, len(starts), PART)
                    ]
                )
            outside = (flown[:, 0] < limits.min_distance_m) | (flown[:, 1] > limits.max_distance_m)
            print(
                f"| {name} | {force:g} | {len(flown):,} | {outside.sum():,} | "
                f"{flown[:, 0].min():.2f}, {flown[:, 1].max():.2f} |",
                flush=True,
            )
    return 0
