"""Evaluate `.fll` files with pyfuzzylite, in a separate environment: JOBS.json.

Each job has ``engine``, ``inputs`` and ``outputs`` (files, the last one written) and ``resolution``. If
pyfuzzylite cannot read or compute something, this is reported in a line, ``engine: reason``.
"""

import json
import sys
from pathlib import Path
from typing import Any

import fuzzylite
import numpy as np


def main() -> None:
    """Run all jobs, one after the other."""
    for job in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
        try:
            np.save(job["outputs"], answers(job))
        except Exception as error:  # noqa: BLE001 - the other jobs must go on
            print(f"{job['engine']}: {type(error).__name__} {error}".replace("\n", " ")[:200])


def answers(job: dict[str, Any]) -> Any:
    """Return the outputs, (n, num_outputs)."""
    engine = fuzzylite.FllImporter().from_string(Path(job["engine"]).read_text(encoding="utf-8"))
    for output in engine.output_variables:
        if "resolution" in job and hasattr(output.defuzzifier, "resolution"):
            output.defuzzifier.resolution = job["resolution"]
    rows = np.load(job["inputs"])
    outputs = np.empty((len(rows), len(engine.output_variables)))
    for row, values in zip(rows, outputs, strict=True):
        for variable, value in zip(engine.input_variables, row, strict=True):
            variable.value = value
        for output in engine.output_variables:
            output.previous_value = float("nan")
            output.value = float("nan")
        engine.process()
        values[:] = [float(np.ravel(output.value)[0]) for output in engine.output_variables]
    return outputs


if __name__ == "__main__":
    main()
