"""The progress of a training, wherever it is shown: the terminal, TensorBoard."""

import logging
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import accumulate
from pathlib import Path
from typing import Any

from pipeline.run import artifacts
from pipeline.run.extras import require_package
from pipeline.run.progress import Progress
from pipeline.settings import plugged
from pipeline.settings.experiment import Experiment, Optimizer
from pipeline.training.evolution.state import Generation

_LOG = logging.getLogger("pipeline")

#: logs a training so far, given all rows of its logbook
Log = Callable[[Sequence[Mapping[str, float]]], None]

#: longest time between writes to the disk, s
FLUSH_S = 5.0


class TrainingProgress(Progress):
    """The generations of all rounds, each with its first population."""

    def __init__(self, settings: Optimizer) -> None:
        per_round = (settings.of_round(index).generations + 1 for index in range(settings.rounds))
        #: generations before each round, and all
        self._before = [*accumulate(per_round, initial=0)]
        super().__init__("generation", self._before[-1])

    def show_generation(self, generation: Generation) -> None:
        """Show a generation that has just been evaluated."""
        parts = generation.parts
        self.show(
            self._before[generation.round] + generation.generation + 1,
            f"round {generation.round + 1}, fitness {generation.best:.4g}: "
            f"delta-v {parts['delta_v_m_s']:.3f} m/s, {parts['points']:.2f} points, "
            f"{parts['short']:.0f} short, {parts['outside']:.0f} outside",
        )


@contextmanager
def logged(experiment: Experiment, folder: Path) -> Iterator[Log]:
    """Open the logger of a training, and close it when the training ends.

    TensorBoard gets one scalar for each column of the logbook, over the generations. A resumed training
    writes all of them again; TensorBoard then ignores what was written before, in another file. What cannot
    be written is reported once, and the training goes on without it.

    Parameters
    ----------
    experiment : Experiment
    folder : Path
        Of the run.

    Raises
    ------
    SettingError, pipeline.settings.plugged.PluginError
        If the logger's package is not installed, or cannot be used.
    """
    logger = experiment.logger
    if logger.kind == "none":
        yield lambda rows: None
        return
    if not logger.is_own:
        require_package("tensorboardX", f"logger={logger.kind}")
    board = _OfferedLogger(experiment, folder) if logger.is_own else _Board(folder / artifacts.TENSORBOARD)
    try:
        yield board.log
    finally:
        board.close()


class _OfferedLogger:
    """A logger that an installed package offers; once it fails, the training goes on without it."""

    def __init__(self, experiment: Experiment, folder: Path) -> None:
        self._kind, self._stack = experiment.logger.kind, ExitStack()
        opened = plugged.function(plugged.LOGGERS, self._kind)
        self._log: Log = lambda rows: None
        with self._reporting():
            self._log = self._stack.enter_context(opened(experiment, folder))

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Report an error of the package's, and call it no more."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - whatever it is, the training goes on
            self._log = lambda rows: None
            _LOG.exception("logger.kind=%s", self._kind)
            sys.stderr.write(
                f"note: logger.kind={self._kind} failed ({type(error).__name__}: {error}); the training goes "
                f"on, and is not logged there from here on\n"
            )

    def log(self, rows: Sequence[Mapping[str, float]]) -> None:
        """Pass the rows on."""
        with self._reporting():
            self._log(rows)

    def close(self) -> None:
        """Close it."""
        with self._reporting():
            self._stack.close()


class _Board:
    """Events for TensorBoard in a folder, written at once: tensorboardX's own thread hangs on a full disk."""

    def __init__(self, folder: Path) -> None:
        from tensorboardX.proto.event_pb2 import Event, SessionLog  # noqa: PLC0415 - an extra
        from tensorboardX.record_writer import RecordWriter  # noqa: PLC0415 - as above

        self._folder, self._num_logged, self._due = folder, 0, 0.0
        self._writer: Any = None
        with self._reporting():
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"events.out.tfevents.{time.time():.0f}.{socket.gethostname()}"
            self._writer = RecordWriter(str(path))  # file: in a run's folder, where no links are
            self._write(Event(file_version="brain.Event:2"))
            self._write(Event(session_log=SessionLog(status=SessionLog.START)))

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Report what cannot be written, and write no more."""
        try:
            yield
        except OSError as error:
            writer, self._writer = self._writer, None
            if writer is not None:
                with suppress(OSError):  # what is buffered fails again
                    writer.close()
            sys.stderr.write(
                f"note: {self._folder} cannot be written ({error.strerror or error}); "
                "the training is not logged there from here on\n"
            )

    def _write(self, event: Any) -> None:
        event.wall_time = time.time()
        self._writer.write(event.SerializeToString())

    def log(self, rows: Sequence[Mapping[str, float]]) -> None:
        """Write the rows that are new."""
        from tensorboardX.proto.event_pb2 import Event  # noqa: PLC0415 - as above
        from tensorboardX.summary import scalar  # noqa: PLC0415 - as above

        with self._reporting():
            for step in range(self._num_logged, len(rows) if self._writer else 0):
                for column, value in rows[step].items():
                    self._write(Event(step=step, summary=scalar(column, value)))
                self._num_logged = step + 1
            if self._writer and time.monotonic() >= self._due:
                self._writer.flush()
                self._due = time.monotonic() + FLUSH_S

    def close(self) -> None:
        """Close the file."""
        with self._reporting():
            if self._writer:
                self._writer.close()
