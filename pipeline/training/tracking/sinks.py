"""The sink named in the configuration."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pipeline.settings.experiment import SettingError, Tracking
from pipeline.training.tracking.told import FAILED, FINISHED, INTERRUPTED, Row, Sink, Told


class _Nobody:
    """Logs nothing."""

    def tell(self, rows: Sequence[Row]) -> None:
        """Do nothing."""

    def close(self, ending: str) -> None:
        """Do nothing."""


@contextmanager
def tracked(tracking: Tracking, told: Told) -> Iterator[Sink]:
    """Open the sink of a training, and close it when the training ends.

    Raises
    ------
    SettingError
        If its package is not installed, or it cannot be written to.
    """
    sink, ending = _sink(tracking, told), FAILED
    try:
        yield sink
        ending = FINISHED
    except KeyboardInterrupt:
        ending = INTERRUPTED
        raise
    finally:
        sink.close(ending)


def _sink(tracking: Tracking, told: Told) -> Sink:
    place = tracking.place or ""
    try:
        if tracking.kind == "tensorboard":
            from pipeline.training.tracking.to_tensorboard import Board  # noqa: PLC0415 - an extra

            return Board(place, told)
        if tracking.kind == "mlflow":
            from pipeline.training.tracking.to_mlflow import Store  # noqa: PLC0415 - an extra

            return Store(place, told)
    except ModuleNotFoundError as error:
        raise SettingError(
            f"tracking={tracking.kind} needs the package {error.name}; install the extra: pip install "
            f"'fuzzy-spacecraft-inspection[{tracking.kind}]'"
        ) from error
    return _Nobody()


def name_of(folder: Path) -> str:
    """Return a run's name: its folder, relative to the working directory if below it."""
    whole, here = folder.absolute(), Path.cwd()
    return whole.relative_to(here if whole.is_relative_to(here) else whole.anchor).as_posix()
