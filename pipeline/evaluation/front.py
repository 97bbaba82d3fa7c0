"""The front of a training as a table, with its controllers as files.

A row for each controller, the cheapest on the validation starts first, by which files are numbered.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from fis_tools.formats import serialize
from pipeline.evaluation.paired_runs import on_front
from pipeline.evaluation.selection import MEMBER, Selection, SelectionJudgement
from pipeline.run import artifacts, tables, writing
from pipeline.settings.experiment import Experiment
from pipeline.training.genome import Genome
from pipeline.training.judging import named_after

#: columns of the table about the validation starts
MEASURES: Final[Mapping[str, Callable[[SelectionJudgement], float | None]]] = {
    "delta_v_m_s": lambda judgement: judgement.delta_v,
    "inspection_rate_percent": lambda judgement: judgement.rate_percent,
    "success_percent": lambda judgement: 100.0 * judgement.success.fraction,
    "outside_percent": lambda judgement: judgement.outside_percent,
    "spent_m_s": lambda judgement: judgement.spent,
    "missed_m_s": lambda judgement: judgement.cost - judgement.spent,
    "fitness_m_s": lambda judgement: judgement.cost,
    "training_fitness_m_s": lambda judgement: judgement.candidate.training_fitness,
}
#: before them its number and, as 1 or 0, whether it is the champion, and no other spends and misses less
COLUMNS: Final = ("controller", "handed_back", "stands", *MEASURES)


def write_front(
    folder: Path, experiment: Experiment, genome: Genome, selection: Selection, facts: Mapping[str, str]
) -> None:
    """Write the table and a controller file for each row; remove those of an earlier training.

    Parameters
    ----------
    folder : Path
    experiment : Experiment
    genome : Genome
    selection : Selection
        Of a training for a front.
    facts : mapping of str to str
        Provenance of all of them.
    """
    judged = [judgement for judgement in selection.judged if judgement.candidate.name == MEMBER]
    judged.sort(key=lambda judgement: judgement.delta_v)
    spent = np.array([judgement.spent for judgement in judged])
    stands = on_front(spent, spent - [judgement.cost for judgement in judged])
    rows, files = [], folder / artifacts.FRONT_CONTROLLERS
    for index, (judgement, is_on_front) in enumerate(zip(judged, stands.tolist(), strict=True)):
        assert judgement.candidate.genome is not None  # noqa: S101 - of every member
        measures = {name: measure(judgement) for name, measure in MEASURES.items()}
        rows.append([index, int(judgement is selection.chosen), int(is_on_front), *measures.values()])
        controller = named_after(experiment, genome, judgement.candidate.genome)
        known = {**facts, "front": f"{index:02d} of {len(judged)}"}
        known |= {name: repr(value) for name, value in measures.items()}
        described = serialize.described(replace(controller, name=f"{controller.name}_{index:02d}"), known)
        writing.write_atomically(files / f"{index:02d}.json", serialize.dump_json(described) + "\n")
    tables.write_csv(folder / artifacts.FRONT, COLUMNS, rows)
    for path in files.glob("*.json"):
        if path.name not in {f"{index:02d}.json" for index in range(len(judged))}:
            path.unlink()
