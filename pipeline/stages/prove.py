"""Prove that every start in a box reaches the goal within the speed limit: prove/."""

import sys
from dataclasses import asdict
from pathlib import Path

from fis_tools.engines.interval import NotBounded
from fis_tools.formats.serialize import dump_json, fingerprint
from pipeline.controllers.source import controller_of_run
from pipeline.physics.motion import motion_over
from pipeline.proof.tube import CELLS
from pipeline.proof.verdict import COLUMNS, NotProvable, prove, theorem_of
from pipeline.run import artifacts, tables, writing
from pipeline.run.progress import Progress
from pipeline.settings.experiment import Experiment


def run(experiment: Experiment, folder: Path) -> str:
    """Write the tube of all starts, the theorem and the controller: a certificate that others can check.

    Return why nothing is proved, empty if it is.
    """
    try:
        proved, unproved = _proved(experiment, folder)
    except (NotProvable, NotBounded) as error:
        # no certificate of an earlier run is of this one
        for name in (artifacts.THEOREM, artifacts.PROVED_CONTROLLER, artifacts.TUBE):
            (folder / name).unlink(missing_ok=True)
        return f"not proved: {error}"
    sys.stderr.write(proved)
    return unproved


def _proved(experiment: Experiment, folder: Path) -> tuple[str, str]:
    """Follow all starts, and write the certificate; return what is proved, and why it is not."""
    theorem, mission = theorem_of(experiment), experiment.mission
    controller = controller_of_run(experiment, folder).fuzzy
    if controller is None:
        raise NotProvable("proofs follow the rules of a fuzzy controller, and this is none")
    motion = motion_over(mission.orbit, mission.deputy, (theorem.period_s,))
    with Progress("followed", mission.num_controls) as progress:
        proof = prove(
            theorem, controller, motion, experiment.prove.cells, mission.num_controls, progress.show
        )
    outcome = {
        "num_periods": proof.num_periods,
        "fault": proof.fault,
        "cells": CELLS,
        "controller_sha256": fingerprint(controller),
    }
    writing.write_json(folder / artifacts.THEOREM, asdict(theorem) | outcome)
    writing.write_atomically(folder / artifacts.PROVED_CONTROLLER, dump_json(controller))
    tables.write_parquet(folder / artifacts.TUBE, dict(zip(COLUMNS, proof.rows.T, strict=True)))
    kept = f"every start keeps the limit at all times of {proof.num_periods * theorem.period_s:g} s"
    if proof.fault:
        return "", f"not proved: {kept}, but then {proof.fault}"
    ends = f"within {proof.distance_m:.3f} m at up to {proof.speed_m_s:.3f} m/s"
    return f"proved: {kept}, and is then {ends}\n", ""
