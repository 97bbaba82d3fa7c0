"""What is logged of a training, and the interface of what logs it."""

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
    """What logs a training besides its own folder."""

    def tell(self, rows: Sequence[Row]) -> None:
        """Log a training so far; `rows` are all rows of its logbook."""

    def close(self, ending: str) -> None:
        """Log how it ends: `FINISHED`, `INTERRUPTED` or `FAILED`."""
