"""The functions that written systems call: of ``parts.c``, or transcribed from those that Python runs."""

import re
from functools import cache
from pathlib import Path

from fis_tools.formats.c.transcribed.entries import ENTRIES
from fis_tools.formats.c.transcribed.writer import C
from plain_files.file_access import read_shipped

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CALL = re.compile(r"\b(\w+)\(")


@cache
def _parts() -> dict[str, str]:
    """Return the texts of the functions in ``parts.c`` by their names."""
    text = read_shipped(Path(__file__).with_name("parts.c"))
    _opening, *functions = re.split(r"\n\n(?=/\*|static)", text.rstrip("\n"))
    return {_CALL.findall(_COMMENT.sub("", function))[0]: f"{function}\n" for function in functions}


def called(text: str) -> list[str]:
    """Return the functions that a text calls, and those that these call, callees first.

    Parameters
    ----------
    text : str
        C source; what its comments say calls nothing.
    """
    parts = _parts()
    reached: set[str] = set()
    waiting = [text]
    while waiting:
        names = set(_CALL.findall(_COMMENT.sub("", waiting.pop())))
        new = (names & parts.keys()) - reached
        reached |= new
        waiting += (parts[name] for name in new)
    names = set(_CALL.findall(_COMMENT.sub("", text)))
    functions = {each.name: each for name in ENTRIES if name in names for each in ENTRIES[name]().called}
    return [*(part for name, part in parts.items() if name in reached), *map(C().text, functions.values())]
