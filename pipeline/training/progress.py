"""The progress of a training, wherever it is shown: the terminal, TensorBoard."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from pipeline.run import artifacts
from pipeline.run.extras import require_package
from pipeline.run.progress import Progress
from pipeline.settings.experiment import Logger, Optimizer
from pipeline.training.evolution.state import Generation

#: logs a training so far, given all rows of its logbook
Log = Callable[[Sequence[Mapping[str, float]]], None]

#: longest time between writes to the disk, s
FLUSH_S = 5


class TrainingProgress(Progress):
    """The generations of all rounds, each with its first population."""

    def __init__(self, settings: Optimizer) -> None:
        self._per_round = settings.generations + 1
        super().__init__("generation", settings.rounds * self._per_round)

    def show_generation(self, generation: Generation) -> None:
        """Show a generation that has just been evaluated."""
        parts = generation.parts
        self.show(
            generation.round * self._per_round + generation.generation + 1,
            f"round {generation.round + 1}, fitness {generation.best:.4g}: "
            f"delta-v {parts['delta_v_m_s']:.3f} m/s, {parts['points']:.2f} points, "
            f"{parts['short']:.0f} short, {parts['outside']:.0f} outside",
        )


@contextmanager
def logged(logger: Logger, folder: Path) -> Iterator[Log]:
    """Open the logger of a training, and close it when the training ends.

    TensorBoard gets one scalar for each column of the logbook, over the generations. A resumed training
    writes all of them again; TensorBoard then ignores what was written before, in another file.

    Parameters
    ----------
    logger : Logger
    folder : Path
        Of the run.

    Raises
    ------
    SettingError
        If the logger's package is not installed.
    """
    if logger.kind == "none":
        yield lambda rows: None
        return
    require_package("tensorboardX", f"logger={logger.kind}")
    from tensorboardX import SummaryWriter  # noqa: PLC0415 - an extra

    num_logged = 0
    with SummaryWriter(str(folder / artifacts.TENSORBOARD), purge_step=0, flush_secs=FLUSH_S) as board:

        def log(rows: Sequence[Mapping[str, float]]) -> None:
            nonlocal num_logged
            for step in range(num_logged, len(rows)):
                for column, value in rows[step].items():
                    board.add_scalar(column, value, step)
            num_logged = max(num_logged, len(rows))

        yield log
