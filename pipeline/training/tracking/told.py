"""What is told of a training, and how those who are told of it are spoken to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

#: a row of the logbook
Row = Mapping[str, float]
#: how a training ends
FINISHED, INTERRUPTED, FAILED = "finished", "interrupted", "failed"


@dataclass(frozen=True)
class Told:
    """Which training it is.

    Parameters
    ----------
    name : str
        The run's folder, from where the program runs.
    experiment : str
    facts : mapping of str to str
        Its seed, what its configuration comes to, and so on.
    goes_on : bool
        Whether it goes on from a checkpoint.
    """

    name: str
    experiment: str
    facts: Mapping[str, str]
    goes_on: bool


class Sink(Protocol):
    """Who is told."""

    def tell(self, rows: Sequence[Row]) -> None:
        """Tell of a training so far: all rows of its logbook."""

    def close(self, ending: str) -> None:
        """Tell that it ends, and how: `FINISHED`, `INTERRUPTED` or `FAILED`."""
