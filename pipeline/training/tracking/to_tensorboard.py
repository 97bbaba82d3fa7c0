"""Generations for TensorBoard; the only module that imports tensorboardX."""

from collections.abc import Sequence
from pathlib import Path

from tensorboardX import SummaryWriter

from pipeline.training.tracking.told import Row, Told

#: rows are written to the disk at least so often, s
FLUSH_S = 5


class Board:
    """A training's scalars, one for each column of its logbook, over its generations.

    A training that goes on writes all of them anew; what was written before, in a file of its own,
    TensorBoard then leaves out.

    Parameters
    ----------
    place : str
        Folder of all trainings; this one's is named in it as the run's folder.
    told : Told
    """

    def __init__(self, place: str, told: Told) -> None:
        self._num_told = 0
        self._writer = SummaryWriter(str(Path(place, told.name)), purge_step=0, flush_secs=FLUSH_S)

    def tell(self, rows: Sequence[Row]) -> None:
        """Write the rows that are new."""
        for step in range(self._num_told, len(rows)):
            for name, value in rows[step].items():
                self._writer.add_scalar(name, value, step)
        self._num_told = max(self._num_told, len(rows))

    def close(self, ending: str) -> None:
        """End, whatever the ending."""
        self._writer.close()
