"""The sections of a `.fis` file, and the words and numbers in their lines."""

import math
import re

from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign
from fis_tools.formats.exchange.foreign import Block

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


def sections_of(text: str, notes: list[str]) -> tuple[dict[str, Block], list[tuple[int, str]]]:
    """Part a file into its sections, by their titles, and its comments, each with its line.

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
    sections: dict[str, Block] = {}
    current: Block | None = None
    for line, raw in enumerate(text.splitlines(), start=1):
        content = _without_remark(raw)
        if content.startswith(("%", "#", "//")):
            comments.append((line, content.lstrip("%#/ ")))
        elif content.startswith("["):
            if content in sections:
                raise ControllerFileError(f"line {line}: a second {content[:40]}; keep one of them")
            current = sections[content] = Block(content, "", line)
        elif content and current is None:
            raise ControllerFileError(
                f"line {line}: {content[:40]!r} stands before [System]; is this a .fis file?"
            )
        elif content and current is not None:
            _take(current, line, content, notes)
    return sections, comments


def _take(section: Block, line: int, content: str, notes: list[str]) -> None:
    """Add a line to a section: a setting where it has keys."""
    known = next((keys for start, keys in _KEYS.items() if section.kind.startswith(start)), None)
    if known is None:
        section.listed.append((line, content))
        return
    key, equals, value = (part.strip() for part in content.partition("="))
    if not equals:
        raise ControllerFileError(f"line {line}: {content[:40]!r} is not key=value; correct it")
    if key in section.settings and key.startswith("MF"):  # MathWorks' own slcp1.fis counts MF1, MF2, MF2
        twice, key = key, f"MF{1 + sum(other.startswith('MF') for other in section.settings)}"
        notes.append(f"line {line}: {section.kind} has {twice} twice; the second is taken as {key}")
    if key in section.settings:
        raise ControllerFileError(f"line {line}: {key} appears twice in {section.kind}; keep one of them")
    if key not in known and not (key.startswith("MF") and "MF" in known):
        where = f"line {line}: in {section.kind} the key"
        foreign.choice(dict.fromkeys(known), key, where, "or drop the line if it says nothing needed")
    section.settings[key] = (line, value)


#: All before a mark that stands in no quotes; nothing is tried twice, however long the line is.
_SAID = re.compile(r"""(?:'[^']*+(?:'|$)|"[^"]*+(?:"|$)|[^'"%#/]++|/(?!/))*+""")


def _without_remark(line: str) -> str:
    """Return a line without blanks, the remark behind its content, and semicolons at its end.

    A mark begins a remark where it stands in no quotes; a line that is nothing else is kept as it is.
    """
    content = line.strip()
    if content.startswith(("%", "#", "//")):
        return content
    said = _SAID.match(content)
    return said[0].rstrip(" \t;") if said else ""


def section_of(sections: dict[str, Block], title: str) -> Block:
    """Return a section that must be there."""
    if title not in sections:
        raise ControllerFileError(f"there is no section {title}; get a whole copy of the file")
    return sections[title]


def quoted_word(section: Block, key: str) -> tuple[str, str]:
    """Return a quoted word, and where it stands."""
    where, value = section.entry(key)
    if len(value) < 2 or value[0] != value[-1] or value[0] not in "'\"":
        raise ControllerFileError(f"{where} is {value[:40]!r}; expected a word in quotes, '…'")
    return value[1:-1], where


def whole_number(section: Block, key: str, least: int = 1) -> int:
    """Return a whole number from 1, or the least that can be, on."""
    where, value = section.entry(key)
    return 0 if least == 0 and value == "0" else foreign.count(value, where, 100_000)


#: pi as MathWorks' own files have it, -pi/4
_PI = re.compile(r"([-+]?)pi(?:/(\d+))?")


def words_in(value: str, where: str) -> list[str]:
    """Read ``[1 2 3]``; commas may part the numbers."""
    inside = re.fullmatch(r"\[(.*)\]", value)
    if inside is None:
        raise ControllerFileError(f"{where} is {value[:40]!r}; expected numbers in brackets, [0 1]")
    words = re.split(r"[\s,;]+", inside[1].strip())
    return [_PI.sub(lambda pi: f"{pi[1]}{math.pi / float(pi[2] or 1)!r}", word) for word in words]
