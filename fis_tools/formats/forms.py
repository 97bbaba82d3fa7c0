"""The kinds of files of other programs, and what reading and writing them comes to.

The module of `exchange` named after a kind writes and reads it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

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


@dataclass(frozen=True)
class Form:
    """A kind of file that holds one system.

    Parameters
    ----------
    program : str
        What it is a file of.
    endings : tuple of str
        How its names end; the first is written.
    is_read : bool
        Whether it is read as well as written.
    is_latin : bool
        Whether text that is not UTF-8 is Latin-1, which old programs write.
    """

    program: str
    endings: tuple[str, ...]
    is_read: bool = True
    is_latin: bool = True


FORMS = {
    "fis": Form("MATLAB and Octave", (".fis",)),
    "fll": Form("fuzzylite", (".fll",)),
    "fml": Form("IEEE 1855", (".fml", ".xml"), is_latin=False),
    "fcl": Form("IEC 61131-7", (".fcl",)),
}


def writer(name: str) -> Callable[[FuzzyController], Written]:
    """Return what writes a kind of file."""
    write: Callable[[FuzzyController], Written] = _module(name).write
    return write


def reader(name: str) -> Callable[[str], Reading]:
    """Return what reads a kind of file."""
    read: Callable[[str], Reading] = _module(name).read
    return read


def _module(name: str) -> Any:
    """Import a kind's module, which few files need."""
    return import_module(f"fis_tools.formats.exchange.{name}")
