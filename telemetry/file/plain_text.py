"""Text of a recording: it is shown in terminals and on pages, so that it holds what is read and no more."""

import re
from typing import Final

#: control characters but line ends and tabs, what turns the direction of writing, and halves of pairs
UNFIT: Final = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069\\ud800-\\udfff]"
)
MISSING_SIGN: Final = "\N{REPLACEMENT CHARACTER}"


def plain(text: str) -> str:
    """Return text in which `UNFIT` characters are replaced."""
    return UNFIT.sub(MISSING_SIGN, text)
