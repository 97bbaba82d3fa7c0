"""The syntax of `.fis` files: sections of settings, comments, and words in brackets."""

import math
import re

from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign
from fis_tools.formats.exchange.foreign import FileBlock

#: The keys of sections by what their titles begin with; terms are MF1, MF2 and so on, rules have no keys.
_VARIABLE = ("Name", "Range", "NumMFs", "MF", "Enabled", "Default", "LockRange", "LockPrevious")
_KEYS = {
    "[System]": (
        *("Name", "Type", "Version", "NumInputs", "NumOutputs", "NumRules", "AndMethod", "OrMethod"),
        *("ImpMethod", "AggMethod", "DefuzzMethod", "DisableStructuralChecks"),
    ),
    "[Input": _VARIABLE,
    "[Output": _VARIABLE,
}


def sections_of(text: str, notes: list[str]) -> tuple[dict[str, FileBlock], list[tuple[int, str]]]:
    """Split a file into sections by title, and comments, each with its line.

    Parameters
    ----------
    text : str
    notes : list of str
        Gets what was put right.

    Raises
    ------
    ControllerFileError
        If a section appears twice, or something stands before the first.
    """
    comments: list[tuple[int, str]] = []
    sections: dict[str, FileBlock] = {}
    current: FileBlock | None = None
    for line, raw in enumerate(text.splitlines(), start=1):
        content = _without_remark(raw)
        if content.startswith(("%", "#", "//")):
            comments.append((line, content.lstrip("%#/ ")))
        elif content.startswith("["):
            if content in sections:
                raise ControllerFileError(f"line {line}: a second {content[:40]}; keep one of them")
            current = sections[content] = FileBlock(content, "", line)
        elif content and current is None:
            raise ControllerFileError(
                f"line {line}: {content[:40]!r} stands before [System]; is this a .fis file?"
            )
        elif content and current is not None:
            _take(current, line, content, notes)
    return sections, comments


def _take(section: FileBlock, line: int, content: str, notes: list[str]) -> None:
    """Add a line to a section: a setting where it has keys."""
    known = next((keys for start, keys in _KEYS.items() if section.kind.startswith(start)), None)
    if known is None:
        section.add(line, content)
        return
    key, equals, value = (part.strip() for part in content.partition("="))
    if not equals:
        raise ControllerFileError(f"line {line}: {content[:40]!r} is not key=value; correct it")
    if key in section.settings and key.startswith("MF"):  # MathWorks' own slcp1.fis counts MF1, MF2, MF2
        twice, key = key, f"MF{1 + sum(other.startswith('MF') for other in section.settings)}"
        if len(notes) > MOST_TWICE:
            raise ControllerFileError(
                f"line {line}: {twice} and others appear twice; number them from MF1 on"
            )
        notes.append(f"line {line}: {section.kind} has {twice} twice; the second is taken as {key}")
    if key in section.settings:
        raise ControllerFileError(f"line {line}: {key} appears twice in {section.kind}; keep one of them")
    if key not in known and not (key.startswith("MF") and "MF" in known):
        where = f"line {line}: in {section.kind} the key"
        foreign.choice(dict.fromkeys(known), key, where, "or drop the line if it says nothing needed")
    section.set(line, key, value)


#: terms of one number that are numbered anew
MOST_TWICE = 1000
#: what is in quotes, or a mark that begins a remark
_QUOTED = re.compile(r"""'[^']*(?:'|$)|"[^"]*(?:"|$)|(?P<mark>[%#]|//)""")


def _without_remark(line: str) -> str:
    """Return a line without blanks, the remark behind its content, and semicolons at its end.

    A mark begins a remark where it stands in no quotes; a line that is nothing else is kept as it is.
    """
    content = line.strip()
    if content.startswith(("%", "#", "//")):
        return content
    marks = (match.start() for match in _QUOTED.finditer(content) if match["mark"])
    return content[: next(marks, None)].rstrip(" \t;")


def section_of(sections: dict[str, FileBlock], title: str) -> FileBlock:
    """Return a required section."""
    if title not in sections:
        raise ControllerFileError(f"there is no section {title}; get a whole copy of the file")
    return sections[title]


def quoted_word(section: FileBlock, key: str) -> tuple[str, str]:
    """Return a quoted word, and its location."""
    where, value = section.entry(key)
    if len(value) < 2 or value[0] != value[-1] or value[0] not in "'\"":
        raise ControllerFileError(f"{where} is {value[:40]!r}; expected a word in quotes, '…'")
    return value[1:-1], where


def whole_number(section: FileBlock, key: str, least: int = 1) -> int:
    """Return a whole number of at least 1, or of `least`."""
    where, value = section.entry(key)
    if value == "0" and least > 0:
        raise ControllerFileError(f"{where} is 0: the file is unfinished; add what is missing")
    return 0 if least == 0 and value == "0" else foreign.count(value, where, 100_000)


#: pi as MathWorks' own files have it, -pi/4
_PI = re.compile(r"([-+]?)pi(?:/([1-9]\d*))?")


def words_in(value: str, where: str) -> list[str]:
    """Read ``[1 2 3]``; commas may part the numbers."""
    inside = re.fullmatch(r"\[(.*)\]", value)
    if inside is None:
        raise ControllerFileError(f"{where} is {value[:40]!r}; expected numbers in brackets, [0 1]")
    words = re.split(r"[\s,;]+", inside[1].strip())
    return [_PI.sub(lambda pi: f"{pi[1]}{math.pi / float(pi[2] or 1)!r}", word) for word in words]
