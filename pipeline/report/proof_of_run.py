"""The proof that a run has of its controller's flights: checked once more, and drawn over flights."""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.formats.serialize import fingerprint
from pipeline.evaluation.assurance.conditions import box_in_words
from pipeline.evaluation.assurance.tube import TubeProof
from pipeline.flight.control.controller import Controller
from pipeline.proof.apart import check_apart, is_installed
from pipeline.proof.verdict import NotProvable, theorem_of
from pipeline.report.figures.flights import draw_tube
from pipeline.report.figures.style import Illustration
from pipeline.run import artifacts, tables
from pipeline.settings.experiment import Experiment
from plain_files.file_access import read_bytes
from plain_files.plain_text import parse_json

#: of a theorem
MOST_BYTES = 1024**2


def tube_proof(experiment: Experiment, controller: Controller, folder: Path) -> TubeProof:
    """Return the result of the stage prove in this run, if it is about these flights.

    What it proves nothing by is told in the result's `fault`; nothing is raised.
    """
    if not (folder / artifacts.THEOREM).exists() or controller.fuzzy is None:
        return TubeProof("no proof of these rules is in this run; add the stage prove before assure")
    try:
        written = read_theorem(folder)
    except (OSError, ValueError, RecursionError):
        return TubeProof(f"{artifacts.THEOREM} cannot be read; repeat the stage prove")
    try:
        theorem = theorem_of(experiment)
    except NotProvable as error:
        return TubeProof(str(error))
    wanted = {**json.loads(json.dumps(asdict(theorem))), "controller_sha256": fingerprint(controller.fuzzy)}
    if not isinstance(written, dict) or any(written.get(name) != value for name, value in wanted.items()):
        return TubeProof(f"{artifacts.THEOREM} is of other flights; repeat the stage prove")
    fault, is_checked = f"not proved: {written.get('fault')}", False
    if not written.get("fault"):
        fault, is_checked = _check(folder, written)
    if fault:
        return TubeProof(fault)
    return TubeProof(
        fault="",
        is_checked=is_checked,
        starts=f"every start with {box_in_words(theorem.start_low, theorem.start_high)}",
        model=(
            f"motion by Clohessy and Wiltshire's equations, n = {theorem.mean_motion_rad_s:g} rad/s, "
            f"{theorem.mass_kg:g} kg, at most {theorem.max_force_n:g} N on each axis, decided every "
            f"{theorem.period_s:g} s, without any error"
        ),
        end_s=written["num_periods"] * theorem.period_s,
        limit=theorem.limit,
        goal=theorem.goal,
    )


def read_theorem(folder: Path) -> Any:
    """Return what a run's theorem says; OSError, ValueError or RecursionError where it cannot be read."""
    return parse_json(read_bytes(folder / artifacts.THEOREM, MOST_BYTES))


def _check(folder: Path, written: Mapping[str, Any]) -> tuple[str, bool]:
    """Return why a run's certificate proves nothing, if so, and whether the checker has checked it."""
    count = written.get("num_periods")
    if not isinstance(count, int) or count < 1:
        return f"{artifacts.THEOREM} has no number of control periods; repeat the stage prove", False
    if not is_installed():
        return "", False
    sys.stderr.write("  checking the proof\n")
    if refusal := check_apart(folder):
        return f"the checker refuses the proof in this run ({refusal}); repeat the stage prove", False
    if read_theorem(folder) != written:
        return f"{artifacts.THEOREM} was changed while it was checked; repeat the stage prove", False
    return "", True


def tube_drawn(experiment: Experiment, folder: Path, tracks: NDArray[np.float32]) -> Illustration:
    """Draw the tube of a run's proof over flights, (n, K+1, 6 or more) in m and m/s; see `draw_tube`."""
    boxes = tables.read_parquet(folder, artifacts.TUBE)
    return draw_tube(boxes, tracks, experiment.mission, experiment.report.dots_per_inch)
