"""What the names of an export begin with, so that several link into one program."""

import re

from fis_tools.formats.c.text import WORDS

USUAL = "controller"
#: what other files see: functions and types, the state, and constants
_SEEN = re.compile(r"\bcontroller_(?=[a-z])|\bstruct controller\b|\bCONTROLLER_(?=[A-Z])|\bREASON_(?=[A-Z])")


class PrefixError(ValueError):
    """Names cannot begin in this way; the message says how they can."""


def check_prefix(prefix: str) -> None:
    """Raise PrefixError unless names of C can begin so, in small letters."""
    if re.fullmatch(r"[a-z][a-z0-9_]{0,30}", prefix) is None or prefix in WORDS:
        raise PrefixError(
            f"names of C cannot begin with {prefix!r}; give small letters, digits and underscores, the first "
            "a letter, at most 31, and no word of C"
        )


def renamed(text: str, prefix: str) -> str:
    """Return a text of an export in which the names that other files see begin with a prefix."""

    def rename(match: re.Match[str]) -> str:
        seen = match[0]
        if seen.startswith("REASON"):
            return f"{prefix.upper()}_{seen}"
        return seen.replace(USUAL, prefix).replace(USUAL.upper(), prefix.upper())

    return text if prefix == USUAL else _SEEN.sub(rename, text)
