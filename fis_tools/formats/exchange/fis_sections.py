"""The sections of a `.fis` file, and the words and numbers in their lines."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange import foreign

#: ``key=value`` lines: the line's number and the value, by key.
Entries = dict[str, tuple[int, str]]


@dataclass
class Section:
    """A section of a file.

    Parameters
    ----------
    title : str
        Such as ``[Input1]``.
    line : int
        Where it begins.
    lines : list of (int, str)
        What it contains, each with its number.
    notes : list of str
        What was put right.
    """

    title: str
    line: int
    lines: list[tuple[int, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def entries(self, known: Sequence[str]) -> Entries:
        """Return ``key=value`` lines by key."""
        found: Entries = {}
        for line, content in self.lines:
            key, equals, value = content.partition("=")
            key = key.strip()
            if key in found and key.startswith("MF"):  # MathWorks' own slcp1.fis counts MF1, MF2, MF2
                twice, key = key, f"MF{1 + sum(other.startswith('MF') for other in found)}"
                self.notes.append(
                    f"line {line}: {self.title} has {twice} twice; the second is taken as {key}"
                )
            if not equals:
                raise ControllerFileError(f"line {line}: {content[:40]!r} is not key=value; correct it")
            if key in found:
                raise ControllerFileError(
                    f"line {line}: {key} appears twice in {self.title}; keep one of them"
                )
            if key not in known and not (key.startswith("MF") and "MF" in known):
                where = f"line {line}: in {self.title} the key"
                foreign.choice(dict.fromkeys(known), key, where, "or drop the line if it says nothing needed")
            found[key] = (line, value.strip())
        return found


def sections_of(text: str) -> tuple[dict[str, Section], list[tuple[int, str]]]:
    """Part a file into its sections, by their titles, and its comments, each with its line.

    Raises
    ------
    ControllerFileError
        If a section appears twice, or something stands before the first.
    """
    comments: list[tuple[int, str]] = []
    sections: dict[str, Section] = {}
    current: Section | None = None
    for line, raw in enumerate(text.splitlines(), start=1):
        content = _without_remark(raw)
        if content.startswith(("%", "#", "//")):
            comments.append((line, content.lstrip("%#/ ")))
        elif content.startswith("["):
            if content in sections:
                raise ControllerFileError(f"line {line}: a second {content[:40]}; keep one of them")
            current = sections[content] = Section(content, line)
        elif content and current is None:
            raise ControllerFileError(
                f"line {line}: {content[:40]!r} stands before [System]; is this a .fis file?"
            )
        elif content and current is not None:
            current.lines.append((line, content))
    return sections, comments


#: All before a mark that stands in no quotes.
_SAID = re.compile(r"""(?:'[^']*(?:'|$)|"[^"]*(?:"|$)|(?!//)[^'"%#])*""")


def _without_remark(line: str) -> str:
    """Return a line without blanks, the remark behind its content, and semicolons at its end.

    A mark begins a remark where it stands in no quotes; a line that is nothing else is kept as it is.
    """
    content = line.strip()
    if content.startswith(("%", "#", "//")):
        return content
    said = _SAID.match(content)
    return said[0].rstrip(" \t;") if said else ""


def section_of(sections: dict[str, Section], title: str) -> Section:
    """Return a section that must be there."""
    if title not in sections:
        raise ControllerFileError(f"there is no section {title}; get a whole copy of the file")
    return sections[title]


def quoted_word(entries: Entries, key: str) -> tuple[str, str]:
    """Return a quoted word, and where it stands."""
    line, value = entries[key]
    if len(value) < 2 or value[0] != value[-1] or value[0] not in "'\"":
        raise ControllerFileError(f"line {line}: {key} is {value[:40]!r}; expected a word in quotes, '…'")
    return value[1:-1], f"line {line}: {key}"


def whole_number(entries: Entries, key: str, least: int = 1) -> int:
    """Return a whole number from 1, or the least that can be, on."""
    line, value = entries[key]
    if least == 0 and value.strip() == "0":
        return 0
    return foreign.count(value, f"line {line}: {key}", 100_000)


#: pi as MathWorks' own files have it, -pi/4
_PI = re.compile(r"([-+]?)pi(?:/(\d+))?")


def words_in(value: str, where: str) -> list[str]:
    """Read ``[1 2 3]``; commas may part the numbers."""
    inside = re.fullmatch(r"\[(.*)\]", value)
    if inside is None:
        raise ControllerFileError(f"{where} is {value[:40]!r}; expected numbers in brackets, [0 1]")
    words = re.split(r"[\s,;]+", inside[1].strip())
    return [_PI.sub(lambda pi: f"{pi[1]}{math.pi / float(pi[2] or 1)!r}", word) for word in words]


def numbers_in(value: str, where: str, expected: int) -> list[float]:
    """Read so many numbers in brackets."""
    found = foreign.numbers(words_in(value, where), where)
    if len(found) != expected:
        raise ControllerFileError(f"{where} has {len(found)} numbers; expected {expected}")
    return found
