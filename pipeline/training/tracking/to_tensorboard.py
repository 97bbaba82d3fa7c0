"""Generations for TensorBoard; the only module that imports tensorboardX."""

from collections.abc import Sequence
from pathlib import Path

from tensorboardX import SummaryWriter

from pipeline.training.tracking.told import Row, Told

#: longest time between writes to the disk, s
FLUSH_S = 5


class Board:
    """A training's scalars, one for each column of its logbook, over its generations.

    A resumed training writes all of them again; TensorBoard then ignores what was written before, in
    another file.

    Parameters
    ----------
    place : str
        Folder of all trainings; this one's subfolder is named after the run's folder.
    told : Told
    """

    def __init__(self, place: str, told: Told) -> None:
        self._num_told = 0
        self._writer = SummaryWriter(str(Path(place, told.name)), purge_step=0, flush_secs=FLUSH_S)

    def tell(self, rows: Sequence[Row]) -> None:
        """Write the new rows."""
        for step in range(self._num_told, len(rows)):
            for name, value in rows[step].items():
                self._writer.add_scalar(name, value, step)
        self._num_told = max(self._num_told, len(rows))

    def close(self, ending: str) -> None:
        """Close the writer, whatever the ending."""
        self._writer.close()
