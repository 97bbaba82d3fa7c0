"""Text that the viewer's fonts can draw: any other character would crash it."""

import re
import unicodedata
from typing import Final

#: replaces a character without a glyph; it is in both fonts
MISSING_SIGN: Final = "□"

#: characters in both fonts of the viewer, Inter for text and JetBrains Mono for code and events: Latin,
#: Greek, Cyrillic and Vietnamese letters, punctuation, powers and indices, arrows, some mathematics
_UNKNOWN: Final = re.compile(
    "[^"
    "\n\u0020-\u007e\u00a0-\u00ac\u00ae-\u0148\u014a-\u017f"
    "\u0391-\u03a1\u03a3-\u03ce\u0401-\u040c\u040e-\u044f\u0451-\u045c\u045e\u045f\u1ea0-\u1ef9"
    "\u2010\u2013\u2014\u2018-\u201e\u2020-\u2022\u2026\u2030\u2032\u2033\u2039\u203a\u2044"
    "\u2070\u2074-\u207a\u2080-\u2089\u20ac\u2190-\u2199\u2212\u221a\u221e\u2248\u2260\u2264\u2265\u25a1"
    "]"
)


def drawable(text: str) -> str:
    """Return a text in which characters without a glyph in the viewer are empty boxes.

    Combining marks are composed first, as the file names of macOS require.
    """
    return _UNKNOWN.sub(MISSING_SIGN, unicodedata.normalize("NFC", text))
