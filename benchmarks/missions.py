"""Fit a controller to missions of all kinds: ``python -m benchmarks missions [NAME ...]``.

Each mission is one that no shipped champion was made for, or for which the best as shipped is hard to beat.
`+experiment=fit_mission` runs as a user would run it; printed are the best champion as shipped, what was
fitted, where the goal is missed also with the safety layer, planning (and the share of its fuel that rules
fire) and tuned, the share of starts from which full thrust could show enough points in time, and the
processor time once all is compiled. Where the goal is missed, plans of least fuel are searched for the starts
that failed, without errors: the first number of "flyable" counts these too.
The last two missions were added after the search was settled. ``--store`` keeps the results of all missions
for the picture of the pages.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from contextlib import redirect_stderr
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.formats import serialize
from fis_tools.model import FuzzyController
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation import fitting
from pipeline.evaluation.statistics import fraction
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.goals.flights import fly_all
from pipeline.optimum.plan import solve
from pipeline.run import artifacts, configuration
from pipeline.settings.equipment import Actuators, Navigation
from pipeline.settings.experiment import Optimum
from pipeline.settings.mission import Dynamics
from pipeline.stages import fit
from plain_files.document import plain

STORED = Path(__file__).with_suffix(".json")
RANDOM_SUN = "sun=random"
KNOWN = ("navigation=fixes", "actuators=real")


def shell(low: float, high: float) -> list[str]:
    """Return the settings by which flights start between two distances, m."""
    return [f"monte_carlo.min_distance_m={low}", f"monte_carlo.max_distance_m={high}"]


def chief(radius: float, near: float, far: float) -> list[str]:
    """Return the settings of a chief's radius and of the limits about it, m."""
    limits = [f"deputy.min_distance_m={near}", f"deputy.max_distance_m={far}"]
    return [f"chief.inspection_radius_m={radius}", *limits]


def deputy(mass: float, force: float, torque: float, moment: float) -> list[str]:
    """Return the settings of a deputy that is a cube: mass (kg), force (N), torque (N m), moment (kg m^2)."""
    inertia = [[moment, 0, 0], [0, moment, 0], [0, 0, moment]]
    words = [f"deputy.mass_kg={mass}", f"deputy.max_force_n={force}", f"deputy.max_torque_n_m={torque}"]
    return [*words, f"deputy.inertia_kg_m2={json.dumps(inertia, separators=(',', ':'))}"]


def camera(half_angle: float, incidence: float, reach: float) -> list[str]:
    """Return the settings of a camera: half angle and greatest incidence (deg), range (m)."""
    angles = [f"sensor.half_angle_deg={half_angle}", f"sensor.max_incidence_deg={incidence}"]
    return [*angles, f"sensor.max_range_m={reach}"]


def elevation(low: float, high: float) -> str:
    """Return the setting of the Sun's elevations, deg."""
    return f"sun.elevation_range_deg=[{low},{high}]"


LOW_ORBIT = (*KNOWN, "light=shadow", "dynamics=low_orbit")
#: what each mission is in words, and its settings
MISSIONS: dict[str, tuple[str, list[str]]] = {
    "sun_synchronous": (
        "550 km, 24 kg, 0.2 N, range 60 m",
        [
            *("light=shadow", "navigation=range_bearing", "actuators=real", "dynamics=low_orbit"),
            *("duration_s=7200", "orbit.radius_m=6928137", "orbit.mean_motion_rad_s=0.00109483"),
            *("orbit.inclination_deg=97.6", elevation(10, 30), *chief(4, 8, 120)),
            *("deputy.mass_kg=24", "deputy.max_force_n=0.2", "deputy.max_torque_n_m=0.004"),
            "deputy.inertia_kg_m2=[[0.9,0.03,-0.02],[0.03,0.7,0.01],[-0.02,0.01,1.1]]",
            *(*camera(20, 65, 60), "sensor.min_sun_angle_deg=20", *shell(40, 90)),
            *("actuators.least_impulse_n_s=0.02", "actuators.scale_error=0.03"),
            *("actuators.misalignment_deg=1.5", "actuators.specific_impulse_s=60"),
            "actuators.propellant_kg=0.5",
        ],
    ),
    "small_chief": (
        "chief of 1 m, keep-out 4 m, range 30 m",
        [
            *(*KNOWN, "duration_s=5680", *chief(1, 4, 60), *camera(15, 75, 30), *shell(12, 28)),
            *("deputy.max_force_n=0.1", "actuators.least_impulse_n_s=0.005", "navigation.noise_m=0.1"),
        ],
    ),
    "station": (
        "station of 50 m, 100 kg, 5 N",
        [
            *(*KNOWN, "duration_s=5680", *chief(50, 80, 1000), *deputy(100, 5, 0.1, 8), *shell(250, 450)),
            "actuators.least_impulse_n_s=0.1",
        ],
    ),
    "geostationary": (
        "geostationary, a day, range 300 m",
        [
            *(*KNOWN, "duration_s=86400", "control_period_s=60", "attitude_period_s=2"),
            *("orbit.mean_motion_rad_s=7.292e-5", elevation(-20, 20), *chief(5, 30, 500)),
            *(*deputy(100, 1, 0.1, 8), *camera(15, 75, 300), *shell(100, 250)),
            *("actuators.least_impulse_n_s=0.02", "navigation.fix_period_s=60"),
        ],
    ),
    "wide_camera": (
        "400 km, half angle 60 deg",
        [
            *(*LOW_ORBIT, "duration_s=5550", "orbit.mean_motion_rad_s=0.0011314", elevation(-20, 20)),
            *(*chief(10, 12, 150), *camera(60, 70, 100), *shell(40, 90)),
        ],
    ),
    "twenty_minutes": ("20 minutes", ["duration_s=1200"]),
    "low_thrust": ("10 mN on 12 kg", ["deputy.max_force_n=0.01", "duration_s=5680"]),
    "eccentric": (
        "eccentricity 0.1, two bodies",
        [
            *(*KNOWN, "light=shadow", "dynamics=two_body", "orbit.eccentricity=0.1", elevation(-20, 20)),
            *("orbit.mean_motion_rad_s=0.001", "duration_s=6280"),
        ],
    ),
    "tumbling": ("tumbling chief", [*KNOWN, "chief=tumbling", "duration_s=5680", *camera(15, 75, 150)]),
    "ideal_attitude": ("ideal attitude", ["attitude=ideal"]),
    "cubesat": (
        "6U, chief of 2 m, half angle 8 deg, 20 mN",
        [
            *(*LOW_ORBIT, "duration_s=11400", "orbit.mean_motion_rad_s=0.00108", elevation(-15, 15)),
            *(*chief(2, 10, 150), *camera(8, 70, 80), *shell(30, 80), *deputy(8, 0.02, 0.001, 0.08)),
            "actuators.least_impulse_n_s=0.002",
        ],
    ),
    "too_weak": (
        "10 mN on 50 kg",
        [
            *(*LOW_ORBIT, "duration_s=11400", elevation(-20, 20), *deputy(50, 0.01, 0.05, 3)),
            *(*camera(15, 70, 120), "actuators.least_impulse_n_s=0.002"),
        ],
    ),
    "navigation_satellite": (
        "20,200 km, chief of 6 m, 60 kg, half a day",
        [
            *(*KNOWN, "duration_s=43200", "control_period_s=60", "attitude_period_s=4"),
            *("orbit.mean_motion_rad_s=1.4585e-4", elevation(-40, 40), *chief(6, 20, 300)),
            *(*deputy(60, 0.5, 0.05, 4), *camera(18, 72, 200), "actuators.least_impulse_n_s=0.02"),
            "navigation.fix_period_s=60",
        ],
    ),
    "debris": (
        "1,000 km, a stage of 3 m, 30 kg, 0.1 N",
        [
            *(*LOW_ORBIT, "duration_s=6310", "orbit.mean_motion_rad_s=0.00099627", elevation(-25, 25)),
            *(*chief(3, 9, 100), *deputy(30, 0.1, 0.01, 1), *camera(25, 68, 90)),
            "actuators.least_impulse_n_s=0.02",
        ],
    ),
}


def fitted(name: str, words: Sequence[str]) -> dict[str, Any]:
    """Return the summary of a fit of a mission, with the processor time that it took."""
    job = compose_experiment(["+experiment=fit_mission", RANDOM_SUN, *MISSIONS[name][1], *words])
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        configuration.write(Path(folder), job.config)
        fit.run(job.experiment, Path(folder))
        summary: dict[str, Any] = artifacts.read_json(Path(folder), artifacts.FIT)
        summary["seconds"] = time.process_time() - began
        is_missed = 100.0 * summary["last"]["success"]["low"] < summary["goal_percent"]
        controller = serialize.load(Path(folder) / artifacts.CHAMPION)
    is_searched = is_missed and COMPILE[0] not in words
    return summary | {"solved": solved(name, words, controller) if is_searched else None}


def solved(name: str, words: Sequence[str], controller: FuzzyController) -> dict[str, Any]:
    """Return the share of unseen starts from which a controller or a plan found without errors succeeds."""
    settings = ["+experiment=fit_mission", RANDOM_SUN, *MISSIONS[name][1], *words]
    experiment = compose_experiment(settings).experiment
    starts = fitting.rung_scenarios(experiment, len(experiment.fit.cases))
    flown = fly_all(experiment.mission, from_fuzzy(controller), starts, 1)
    is_solved = flown.is_success(experiment.mission.inspection_threshold_percent) & ~flown.is_violated
    exact: dict[str, Any] = {
        "navigation": Navigation(),
        "actuators": Actuators(),
        "dynamics": Dynamics(),
        "dispersions": {},
    }
    mission = replace(experiment.mission, **exact)
    for index in np.flatnonzero(~is_solved).tolist():
        plan = solve(mission, starts[index], EFFORT, np.random.SeedSequence(index))
        is_solved[index] = plan.flight.is_feasible(plan.needed)
    share: dict[str, Any] = plain(fraction(is_solved, experiment.monte_carlo.confidence_percent))
    return share


#: how hard plans of least fuel are searched for
EFFORT = Optimum(restarts=12, burns=4, kicks=6)
#: a fit that compiles, or loads, all that a real one calls
COMPILE: tuple[str, ...] = (
    "fit.draws=1",
    "fit.cases=[1,1]",
    "fit.kept=[1]",
    "fit.num_cases=2",
    "fit.neighbours=0",
)
COMPILE += ("fit.tunes=always", "optimizer.generations=1", "optimizer.population_size=5")
COMPILE += ("starts.num_cases=2", "optimizer.validation_cases=2")


#: results of a fit, by their keys in its summary
FLOWN = ("shipped", "fitted", "layered", "planned", "tuned")


def share_in_words(tally: dict[str, Any] | None) -> str:
    """Return the success of a tally with its interval, %."""
    if tally is None:
        return "-"
    success = tally["success"]
    return f"{100 * success['fraction']:.1f} [{100 * success['low']:.1f}, {100 * success['high']:.1f}]"


def flyable_in_words(summary: dict[str, Any]) -> str:
    """Return from which share of the starts a flight may succeed, after that for which one was found, %."""
    most = f"{100 * summary['flyable']['fraction']:.1f}"
    return f"{100 * summary['solved']['fraction']:.1f} to {most}" if summary["solved"] else most


def by_rules(summary: dict[str, Any]) -> str:
    """Return the share of fuel that rules fire in the flights of what plans, %."""
    return f"{100 - summary['planned']['ahead_percent']:.1f}" if summary["planned"] else "-"


def main(given: Sequence[str]) -> int:
    """Fit the chosen missions, or all of them, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks missions", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {', '.join(MISSIONS)}; all unless given"
    )
    parser.add_argument("--seed", type=int, default=11, help="of all starts and draws; 11 unless given")
    parser.add_argument("--store", action="store_true", help="keep the results for the picture of the pages")
    options = parser.parse_args(given)
    if unknown := [name for name in options.names if name not in MISSIONS]:
        parser.error(f"no mission {unknown[0]!r}; the missions are {', '.join(MISSIONS)}")
    columns = (
        "mission",
        "as shipped",
        "fitted",
        "with layer",
        "planning",
        "by rules",
        "tuned",
        "flyable",
        "delta-v",
        "CPU s",
    )
    print("{:38s} {:19s} {:19s} {:19s} {:19s} {:8s} {:19s} {:13s} {:>8s} {:>6s}".format(*columns))
    stored = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    for name in options.names or MISSIONS:
        with redirect_stderr(StringIO()):
            fitted(name, (*COMPILE, f"seed={options.seed}"))
            summary = fitted(name, (f"seed={options.seed}", "fit.workers=1", "optimizer.workers=1"))
        *shares, tuned = (f"{share_in_words(summary[key]):19s}" for key in FLOWN)
        print(
            f"{MISSIONS[name][0]:38s} {' '.join(shares)} {by_rules(summary):8s} {tuned} "
            f"{flyable_in_words(summary):13s} {summary['last']['delta_v']:8.3f} {summary['seconds']:6.0f}",
            flush=True,
        )
        for limit in (limit for limit in summary["limits"] if not limit["kept"]):
            print(f"    limited by the {limit['sentence']}")
        keys = (*FLOWN, "last", "flyable", "solved", "seconds")
        stored[name] = {"words": MISSIONS[name][0]} | {key: summary[key] for key in keys}
        if options.store:
            ordered = {name: stored[name] for name in MISSIONS if name in stored}
            STORED.write_text(json.dumps(ordered, indent=1) + "\n", encoding="utf-8")
    return 0
