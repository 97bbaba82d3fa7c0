"""Hashes of flights: every shipped controller in every shipped world, and every kind of flight besides.

``python -m benchmarks flights --write FILE`` stores them; ``--against FILE`` names the kinds that fly
otherwise. A kind is a command's settings; its hash covers outcomes, tracks and one logged flight.
"""

import argparse
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.command_line.config import compose_experiment, conf_folder
from pipeline.controllers import source
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import check_course
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.scenarios import evaluation_scenarios

#: of which each kind flies so many
NUM_STARTS = 24
#: controllers that need a file besides
NEEDS_A_FILE = ("file", "open_loop", "policy")
#: an orbit by its elements, whose perigee is 350 km high at an eccentricity of 0.3
ELLIPSE = ("orbit=elements", "orbit.semi_major_axis_m=9615714")
#: ways of flying in the paper's world, and along an ellipse
WAYS: tuple[tuple[str, ...], ...] = (
    (),
    ("sun=random",),
    ("sun=random", "safety=filter"),
    ("guidance=clusters",),
    ("guidance=clusters", "safety=filter"),
    ("world=leo",),
    ("world=leo", "safety=filter"),
    ("world=afrl",),
    ("dynamics=two_body", *ELLIPSE, "orbit.eccentricity=0.3", "sun=random"),
)
#: with oblateness and drag along a transfer orbit to geostationary height, and a chief that tumbles slowly
TRANSFER = (
    *("dynamics=low_orbit", "orbit=elements"),
    *("orbit.semi_major_axis_m=24478137", "orbit.eccentricity=0.725", "sun=random"),
)
TUMBLING = "chief.initial_angular_velocity_rad_s=[0.001,0,0.002]"
#: flown by two controllers that sense what others do not
MORE_WAYS: tuple[tuple[str, ...], ...] = (
    ("attitude=ideal",),
    ("attitude.pole_blending=true",),
    (
        "chief.initial_angular_velocity_rad_s=[0.01,0.004,-0.006]",
        "chief.inertia_kg_m2=[[1,0,0],[0,2,0],[0,0,2.5]]",
    ),
    ("deputy.inertia_kg_m2=[[1,0,0],[0,1.4,0.1],[0,0.1,1.8]]",),
    ("light=shadow", "sun.elevation_deg=20"),
    ("sensor.max_incidence_deg=60", "sensor.max_range_m=120", "sensor.min_sun_angle_deg=20"),
    ("light=blinn_phong",),
    ("navigation=fixes",),
    ("navigation=range_bearing", "navigation.delay_s=10"),
    ("actuators=real",),
    ("actuators=real", "actuators.delay_s=10"),
    ("dynamics=low_orbit",),
    ("dynamics=two_body",),
    ("world=leo", "guidance=clusters", "attitude=ideal"),
    (*TRANSFER, "navigation=fixes", "actuators=real"),
    (*TRANSFER, "safety=filter"),
    ("dynamics=low_orbit", "orbit.course=true", "orbit.epoch=2026-11-26T12:00:00", TUMBLING, "safety=filter"),
)
PAIR = ("champion_27", "paper_champion")
#: of a log, what follows from the rest and so is left out of its hash, and what is hashed by another name: so
#: hashes stay those of revisions that did not tell commands from what is fired, nor points, rehearsals and
#: wheels
FOLLOWING = (
    *("force_commanded_n", "reason", "is_missed", "is_candidate", "looks", "last_light_s"),
    *("push_costs_m_s", "tour_costs_m_s", "fix_m", "innovation_m", "innovation_square"),
    *("ahead_delta_v_m_s", "foresight_at", "foresight_plans", "foresight_prices_m_s", "foresight_ends_m_s"),
    *("wheel_momentum_b_n_m_s", "full_wheel_s"),
)
KNOWN_AS = {"command_reason": "reason"}


def kinds() -> list[tuple[str, ...]]:
    """Return the settings of every kind of flight."""
    shipped = sorted(path.stem for path in (conf_folder() / "controller").glob("*.yaml"))
    ways = [(f"controller={name}", *way) for name in shipped if name not in NEEDS_A_FILE for way in WAYS]
    return ways + [(f"controller={name}", *way) for name in PAIR for way in MORE_WAYS]


def hash_of(settings: Sequence[str]) -> str:
    """Return the hash of a kind's flights, or the reason why there are none."""
    try:
        experiment = compose_experiment(["+experiment=evaluate", *settings]).experiment
        mission = experiment.mission
        controller = source.load(experiment.controller, mission)
        check_course(controller, mission)
    except (ValueError, ControllerError) as error:
        return f"refused: {str(error)[:60]}"
    scenarios = evaluation_scenarios(experiment, range(NUM_STARTS))
    tracks = np.zeros((NUM_STARTS, mission.num_controls + 1, NUM_TRACKED), dtype=np.float32)
    digest = hashlib.sha256()
    _add(digest, fly_all(mission, controller, scenarios, tracks=tracks))
    digest.update(tracks.tobytes())
    _add(digest, fly_logged(mission, controller, scenarios[0]))
    return digest.hexdigest()[:16]


def _add(digest: Any, arrays: Any) -> None:
    fields = vars(arrays) if hasattr(arrays, "__dict__") else arrays._asdict()
    hashed = {KNOWN_AS.get(name, name): values for name, values in fields.items() if name not in FOLLOWING}
    for name, values in sorted(hashed.items()):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(values).tobytes())


def main(words: Sequence[str]) -> int:
    """Print, store or compare the hashes."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks flights", description=__doc__)
    parser.add_argument("--write", type=Path, help="file to store the hashes in")
    parser.add_argument("--against", type=Path, help="file with the hashes of another revision")
    parser.add_argument("--only", default="", help="kinds whose settings hold this text")
    chosen = parser.parse_args(words)
    before = json.loads(chosen.against.read_text(encoding="utf-8")) if chosen.against else {}
    hashes, different = {}, []
    for settings in kinds():
        name = " ".join(settings)
        if chosen.only not in name:
            continue
        hashes[name] = hash_of(settings)
        is_other = name in before and before[name] != hashes[name]
        print(f"{hashes[name]}  {name}{'  DIFFERENT' if is_other else ''}", flush=True)
        if is_other:
            different.append(name)
    if chosen.write:
        chosen.write.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
    print(f"{len(hashes)} kinds of flight" + (f", {len(different)} different" if before else ""))
    return 1 if different else 0
