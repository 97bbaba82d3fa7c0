"""The front of a training: each of its controllers flown from the validation starts, as a table and as files.

Columns, one row per controller, the cheapest on the validation starts first: ``controller``, the number of
its file; ``champion``, the one of least fitness on the validation starts; ``stands``, whether it is
nondominated there too; then its results there (``validation_...``) and on the starts of the last round
of training (``training_...``). If rule consistency is an objective, ``rule_consistency`` is the mean
over all its rules.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.formats import serialize
from fis_tools.formats.serialize import described
from fis_tools.model import FuzzyController
from pipeline.array_types import Floats
from pipeline.run import artifacts, tables
from pipeline.training.evolution.genetic import OBJECTIVE, Front, objectives_of
from pipeline.training.judging import INCONSISTENCY

Columns = dict[str, NDArray[Any]]

#: columns in the provenance of each controller
TOLD = (
    "training_fitness_m_s",
    "validation_fitness_m_s",
    "validation_delta_v_m_s",
    "validation_inspection_rate_percent",
    "validation_success_percent",
    "validation_outside_percent",
)


def judged_front(
    front: Front, validation: Mapping[str, Floats], num_points: int, num_cases: int
) -> tuple[Columns, Floats]:
    """Combine a front with the results of its controllers on the validation starts.

    Parameters
    ----------
    front : Front
        With the parts of `pipeline.training.fitness.fitness_parts` and the objectives.
    validation : mapping of str to (n,) array
        The fitness and the same parts, on the validation starts.
    num_points, num_cases : int
        All points; number of validation starts.

    Returns
    -------
    columns : dict of (n,) arrays
    genomes : (n, num_genes) array
        In the same order.
    """
    order = np.argsort(validation["delta_v_m_s"], kind="stable")
    training = {"fitness": front.fitness, **front.parts}
    there = {name: values[order] for name, values in validation.items()}
    columns: Columns = {
        "controller": np.arange(len(order)),
        "champion": np.arange(len(order)) == np.argmin(there["fitness"]),
        "stands": _stands(objectives_of(there)),
    }
    if INCONSISTENCY in there:
        columns["rule_consistency"] = 1.0 - there[INCONSISTENCY]
    columns |= _columns("validation", there, num_points)
    columns["validation_success_percent"] = 100.0 * (1.0 - there["failed"] / num_cases)
    columns["validation_outside_percent"] = 100.0 * there["outside"] / num_cases
    columns |= _columns("training", {name: values[order] for name, values in training.items()}, num_points)
    return columns, front.genomes[order]


def _columns(starts: str, parts: Mapping[str, Floats], num_points: int) -> Columns:
    return {
        f"{starts}_delta_v_m_s": parts["delta_v_m_s"],
        f"{starts}_inspection_rate_percent": 100.0 * parts["points"] / num_points,
        f"{starts}_spent_m_s": parts[f"{OBJECTIVE}spent"],
        f"{starts}_missed_m_s": parts[f"{OBJECTIVE}missed"],
        f"{starts}_fitness_m_s": parts["fitness"],
    }


def _stands(objectives: Floats) -> NDArray[np.bool_]:
    """Return which rows are nondominated."""
    no_worse = np.all(objectives[:, None] <= objectives, axis=-1)
    better = np.any(objectives[:, None] < objectives, axis=-1)
    return np.asarray(~np.any(no_worse & better, axis=0))


def write_front(
    folder: Path,
    columns: Columns,
    genomes: Floats,
    controllers: Sequence[FuzzyController],
    provenance: Mapping[str, str],
) -> None:
    """Write the table, with and without genomes, and a controller file per row; remove earlier ones."""
    names = [f"{index:02d}" for index in columns["controller"]]
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    tables.write_csv(folder / artifacts.FRONT, list(columns), list(rows))
    tables.write_parquet(folder / artifacts.FRONT_GENOMES, {**columns, "genome": genomes})
    place = folder / artifacts.FRONT_CONTROLLERS
    for row, (name, controller) in enumerate(zip(names, controllers, strict=True)):
        told = {column: repr(float(columns[column][row])) for column in TOLD}
        told |= {"front": f"{name} of {len(names)}", **provenance}
        known = described(replace(controller, name=f"{controller.name}_{name}"), told)
        artifacts.write_atomically(place / f"{name}.json", serialize.dump_json(known) + "\n")
    for path in place.glob("*.json"):
        if path.stem not in names:
            path.unlink()
