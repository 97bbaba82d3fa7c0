"""A file as it was written, with its losses, and a controller as it was read, with its assumptions."""

from dataclasses import dataclass

from fis_tools.model import FuzzyController


@dataclass(frozen=True)
class Written:
    """A file, and what it cannot hold.

    Parameters
    ----------
    text : str
        The whole file.
    losses : tuple of str
        What the format has no place for, one sentence each.
    """

    text: str
    losses: tuple[str, ...]


@dataclass(frozen=True)
class Reading:
    """A controller, and what was assumed to read it.

    Parameters
    ----------
    controller : FuzzyController
        It has no problems.
    assumptions : tuple of str
        What the file did not state, one sentence each.
    """

    controller: FuzzyController
    assumptions: tuple[str, ...]
