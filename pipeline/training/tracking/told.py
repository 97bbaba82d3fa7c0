"""The logged data of a training, and the interface of its sinks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

#: a row of the logbook
Row = Mapping[str, float]
#: how a training ends
FINISHED, INTERRUPTED, FAILED = "finished", "interrupted", "failed"


@dataclass(frozen=True)
class Told:
    """Description of a training.

    Parameters
    ----------
    name : str
        The run's folder, relative to the working directory.
    experiment : str
    facts : mapping of str to str
        Its seed, configuration hash, and so on.
    goes_on : bool
        Whether it is resumed from a checkpoint.
    """

    name: str
    experiment: str
    facts: Mapping[str, str]
    goes_on: bool


class Sink(Protocol):
    """Logs a training outside its own folder."""

    def tell(self, rows: Sequence[Row]) -> None:
        """Log a training so far; `rows` are all rows of its logbook."""

    def close(self, ending: str) -> None:
        """Log how it ends: `FINISHED`, `INTERRUPTED` or `FAILED`."""
