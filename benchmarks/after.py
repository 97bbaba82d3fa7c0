"""What follows the hour: ``python -m benchmarks after [CONTROLLER...] [key=value...]`` coasts on.

For each controller it prints how many flights succeed, how many then stay inside the limits without force,
how many were never where a failure of all thrusters would lead to the chief within an orbit, and the share of
samples after the first at which one would. With ``--propagate`` it compares so many ends, and failures at
random moments, with what SciPy's integrators make of them.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.after import ORBITS, aftermath
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.evaluation.statistics import fraction
from pipeline.flight.world.coasting import FreeMotion
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody
from tests.pipeline.evaluation.propagated import Orbit, about_the_earth, linear

#: after the flight's end
MINUTES = (5, 10, 20)
#: of a track: position and velocity
STATE = slice(0, 6)
#: between the instants at which integrated paths are looked at, s
LOOK_S = 5.0


def main(arguments: Sequence[str]) -> int:
    """Print a Markdown table, a line for each controller."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks after", description=__doc__)
    parser.add_argument(
        "words", nargs="*", help="controllers; all of +experiment=reproduce unless given; keys"
    )
    parser.add_argument("--cases", type=int, default=300, help="flights of each controller")
    parser.add_argument("--seed", type=int, default=101, help="of the starts")
    parser.add_argument(
        "--propagate", type=int, default=0, help="ends and failures to integrate, on a circle"
    )
    options = parser.parse_args(arguments)
    changes = [word for word in options.words if "=" in word]
    reproduced = compose_experiment(["+experiment=reproduce"]).experiment.compare.controllers
    names = [word for word in options.words if "=" not in word] or list(reproduced)
    heads = [f"stays {minutes} min" for minutes in MINUTES] + ["stays an orbit", "stays three orbits"]
    heads += ["passively safe", "unsafe samples (%)"]
    print(f"| controller | delta-v (m/s) | success | {' | '.join(heads)} |")
    print("|---|---|---|" + "---|" * len(heads))
    for name in names:
        words = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}", "sun=random", *changes]
        job = compose_experiment(["+experiment=evaluate", f"controller={name}", *words])
        experiment, mission = job.experiment, job.experiment.mission
        controller = source.load(job.config["controller"], mission)
        flown, tracks = fly_tracked(mission, controller, evaluation_scenarios(experiment), None)
        shares = [flown.is_success(mission.inspection_threshold_percent) & ~flown.is_violated]
        ends = tracks[:, -1, STATE].astype(np.float64)
        shares += [stays(mission, ends, 60.0 * minutes) for minutes in MINUTES]
        shares += aftermath(mission, tracks) or []
        cells = [share_in_words(share) for share in shares]
        cells.append(f"{100 * unsafe_share(mission, tracks):.2f}")
        print(f"| `{name}` | {flown.delta_v_m_s.mean():.3f} | {' | '.join(cells)} |", flush=True)
        if options.propagate and mission.orbit.elements.eccentricity == 0.0:
            agreed = agreements(mission, tracks, options.propagate, options.seed)
            words = ", ".join(f"{same} of {count} {what}" for what, same, count in agreed)
            print(f"\n`{name}`: integrators agree on {words}\n", flush=True)
    return 0


def stays(mission: Mission, ends: Floats, seconds: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which flights stay between the limits from their ends on, (n,)."""
    motion, deputy = FreeMotion(mission, seconds), mission.deputy
    nearest, farthest = motion.distances(ends[:, np.newaxis], seconds, sample=mission.num_controls)
    return np.asarray((nearest[:, 0] >= deputy.min_distance_m) & (farthest[:, 0] <= deputy.max_distance_m))


def unsafe_share(mission: Mission, tracks: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> float:
    """Return the share of samples but the first of each flight from which coasting leads too near."""
    states, orbit_s = tracks[..., STATE].astype(np.float64), 2.0 * np.pi / mission.orbit.mean_motion_rad_s
    nearest, _ = FreeMotion(mission, orbit_s).distances(states, orbit_s)
    return float(np.mean(nearest[:, 1:] < mission.deputy.min_distance_m))


def agreements(
    mission: Mission, tracks: np.ndarray[tuple[int, ...], np.dtype[np.float32]], count: int, seed: int
) -> list[tuple[str, int, int]]:
    """Return on how many of what the product and an integration agree, with the number of both.

    It is whether ends stay for an orbit, and for three, and whether failures of all thrusters at random
    moments after the first push lead to the chief within an orbit.
    """
    generator, orbit_s = np.random.default_rng(seed), 2.0 * np.pi / mission.orbit.mean_motion_rad_s
    low, high, last = mission.deputy.min_distance_m, mission.deputy.max_distance_m, mission.num_controls
    nearest, _ = FreeMotion(mission, orbit_s).distances(tracks[..., STATE].astype(np.float64), orbit_s)
    flights = generator.permutation(len(tracks))[:count]
    ends = tracks[flights, -1, STATE].astype(np.float64)
    whole = np.arange(0.0, ORBITS[-1] * orbit_s, LOOK_S)
    far = [distances_from(mission, end, last, whole) for end in ends]
    agreed = []
    for orbits in ORBITS:
        seen = [bool(((d >= low) & (d <= high))[whole <= orbits * orbit_s].all()) for d in far]
        said = stays(mission, ends, orbits * orbit_s)
        agreed.append((f"ends for {orbits} orbit{'s' * (orbits > 1)}", int((said == seen).sum()), len(ends)))
    same, once = 0, whole[whole <= orbit_s]
    moments = generator.integers(1, last + 1, count)
    of = generator.integers(0, len(tracks), count)
    for flight, k in zip(of.tolist(), moments.tolist(), strict=True):
        state = tracks[flight, k, STATE].astype(np.float64)
        same += bool(nearest[flight, k] >= low) == bool(distances_from(mission, state, k, once).min() >= low)
    return [*agreed, ("failures", same, count)]


def distances_from(mission: Mission, state: Floats, sample: int, times: Floats) -> Floats:
    """Return the distances of integrated free motion from a state at a sample, m, beside a circle."""
    dynamics, elements = mission.dynamics, mission.orbit.elements
    if not isinstance(dynamics, TwoBody):
        return linear(mission.orbit.mean_motion_rad_s, state, times)
    angles = np.radians([elements.inclination_deg, elements.latitude_argument_deg])
    orbit = Orbit(elements.semi_major_axis_m, *angles, dynamics.j2, dynamics.drag_m_s2)
    return about_the_earth(orbit, state, times, sample * mission.control_period_s)


def share_in_words(is_so: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> str:
    """Return a share of flights in per cent, with its 95 % interval."""
    share = fraction(is_so, 95.0)
    return f"{100 * share.fraction:.1f} % ({100 * share.low:.1f}–{100 * share.high:.1f})"
