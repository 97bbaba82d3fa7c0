"""What the checker accepts of forged proofs: why the claim stays true, and flights that show it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fis_tools.formats import serialize
from pipeline.command_line.config import Job, compose_experiment
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.proof.certificate import read_proof
from pipeline.proof.check import check
from tests.hostile.forge import CONTROLLER, Mutant, mutants
from tests.pipeline.proof.cases import NEAR
from tests.pipeline.stages.cases import carried_out

NUM_FLIGHTS = 12
#: least and greatest starts of certificates, m and m/s
STARTS = {
    "plane": "[[3.0,4.0,0.0,-0.03,-0.03,0.0],[3.2,4.2,0.0,0.03,0.03,0.0]]",
    "exact coordinate": "[[2.5,3.21,0.0,-0.03,0.013,0.0],[2.7,3.21,0.0,0.03,0.013,0.0]]",
    "start on a cell's edge": "[[0.0,2.0,0.0,0.0,-0.03,0.0],[0.0,2.2,0.0,0.0,0.03,0.0]]",
    "space": "[[2.0,2.0,1.0,-0.03,-0.03,-0.01],[2.1,2.1,1.1,0.03,0.03,0.01]]",
}


class Accepted(NamedTuple):
    """A mutant that the checker accepts.

    Parameters
    ----------
    change : str
    reason : str
        Why its claim is true.
    num_false : int
        Flights of which it is not.
    """

    change: str
    reason: str
    num_false: int


@cache
def job(name: str) -> Job:
    """Return the proof of some starts, of those nearer than 1.7 m at its end."""
    return compose_experiment([*NEAR, f"monte_carlo.box={STARTS[name]}", "problem.goal_radius_m=1.7"])


def certificate(name: str, folder: Path) -> Mapping[str, bytes]:
    """Prove that flights from some starts arrive; return the certificate's files."""
    carried_out(job(name), folder)
    return {path.name: path.read_bytes() for path in (folder / "prove").iterdir()}


def forge(name: str, number: int, seed: int, folder: Path) -> Iterator[Accepted | None]:
    """Yield what becomes of each mutant of a certificate: None where it is refused."""
    files = certificate(name, folder)
    put = folder / "prove"
    check(put)
    before = read_proof(put)
    for mutant in mutants(files, number, seed):
        for path, content in mutant.files.items():
            (put / path).write_bytes(content)
        try:
            check(put)
        except (ArithmeticError, ValueError):
            yield None
            continue
        after = read_proof(put)
        yield Accepted(mutant.change, reason(before, after), num_false(job(name), mutant, after.theorem))


def reason(before: Any, after: Any) -> str:
    """Return why a claim is true beside one that was proved."""
    old, new = before.theorem, after.theorem
    changed = {key for key in old if old[key] != new[key]} - {"controller_sha256"}
    same_rules = list(map(rules, before.systems)) == list(map(rules, after.systems))
    is_part = np.all(np.less_equal(old["start_low"], new["start_low"]))
    is_part &= np.all(np.less_equal(new["start_high"], old["start_high"]))
    reasons = {
        "other rules or dead bands, whose force is within all residuals": (
            not same_rules or before.dead_bands_n != after.dead_bands_n
        ),
        "the same rules; texts, points and what applies where no rule fires do not count": (
            before.systems != after.systems
        ),
        "other boxes, which hold the same flights": before.boxes != after.boxes,
        "the same claim": not changed,
        "fewer starts": is_part and changed <= {"start_low", "start_high"},
        "a wider goal": changed == {"goal"} and np.all(np.greater_equal(new["goal"], old["goal"])),
        "the same claim, checked over another grid": changed == {"cells"},
    }
    room = f"the tube has room for another {', '.join(sorted(changed))}"
    return next((text for text, holds in reasons.items() if holds), room)


def rules(system: Mapping[str, Any]) -> Any:
    """Return what makes up the force of a system."""
    terms = [[tuple(term[key] for key in ("left", "peak", "right")) for term in v["terms"]]
             for v in (*system["inputs"], *system["outputs"])]  # fmt: skip
    peaks = {term["name"]: term["peak"] for term in system["outputs"][0]["terms"]}
    return terms, [v["range"] for v in system["inputs"]], [peaks[name] for name in system["rules"]]


def num_false(run: Job, mutant: Mutant, theorem: Mapping[str, Any]) -> int:
    """Fly a mutant's controller from its starts, most of them corners; count the flights that belie it."""
    controller = from_fuzzy(serialize.loads(mutant.files[CONTROLLER].decode(), "json"))
    mission, period, periods = run.experiment.mission, theorem["period_s"], theorem["num_periods"]
    mission = replace(
        mission,
        problem=replace(mission.problem, goal_radius_m=1e-6),
        orbit=replace(mission.orbit, mean_motion_rad_s=theorem["mean_motion_rad_s"]),
        deputy=replace(mission.deputy, mass_kg=theorem["mass_kg"], max_force_n=theorem["max_force_n"]),
        attitude_period_s=period,
        control_period_s=period,
        duration_s=periods * period,
    )
    generator = np.random.default_rng(5)
    low, high = np.array(theorem["start_low"]), np.array(theorem["start_high"])
    corners = [np.where(generator.integers(0, 2, 6) == 0, low, high) for _ in range(NUM_FLIGHTS - 2)]
    (base, slope, offset), count = theorem["limit"], 0
    for start in [*corners, *(low + (high - low) * generator.uniform(size=(2, 6)))]:
        log = fly_logged(mission, controller, Scenario(start[:3], start[3:], 0.0))
        distance, speed = (np.linalg.norm(x, axis=1) for x in (log.position_m, log.velocity_m_s))
        is_kept = np.all(speed <= base + slope * (distance - offset))
        count += not (is_kept and distance[-1] <= theorem["goal"][0] and speed[-1] <= theorem["goal"][1])
    return count
