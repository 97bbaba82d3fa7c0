"""The syntax of FCL: a file as a tree of its blocks, and its comments."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark
from lark.exceptions import UnexpectedEOF, UnexpectedInput

from fis_tools.errors import ControllerFileError
from fis_tools.model.validate import MOST_RULES
from plain_files.file_access import read_shipped

#: A node of the tree that the parser makes: a rule's name and children, or a word.
Node = Any
#: Of a file: its parser, written in Python, takes seconds for so much.
MAX_BYTES = 2 * 1024 * 1024
MOST_COMMENTS = 100_000


@cache
def _parser() -> Lark:
    grammar = read_shipped(Path(__file__).with_name("fcl.lark"))
    return Lark(grammar, parser="lalr", propagate_positions=True)


_COMMENT = re.compile(r"//|/\*|\(\*")
_RULE = re.compile(r"\brule\b", re.IGNORECASE)


def without_comments(text: str) -> tuple[str, list[tuple[int, str]]]:
    """Return a text with blanks for its comments, and these, each with its line.

    Raises
    ------
    ControllerFileError
        If one does not end.
    """
    parts, comments = list[str](), list[tuple[int, str]]()
    position, line, counted = 0, 1, 0
    while comment := _COMMENT.search(text, position):
        start, opening = comment.start(), comment[0]
        line, counted = line + text.count("\n", counted, start), start
        if opening == "//":
            end = closed if (closed := text.find("\n", start)) >= 0 else len(text)
        else:
            closing = text.find("*/" if opening == "/*" else "*)", start + 2)
            if closing < 0:
                raise ControllerFileError(f"line {line}: the comment does not end; get a whole copy")
            end = closing + 2
        comments.append((line, text[start:end].strip("/* \n()")))
        if len(comments) > MOST_COMMENTS:
            raise ControllerFileError(f"line {line}: it has more than {MOST_COMMENTS} comments; drop some")
        parts += [text[position:start], " ", "\n" * text.count("\n", start, end)]
        position = end
    return "".join([*parts, text[position:]]), comments


def parse(text: str) -> Node:
    """Parse a file without comments; its children are the function blocks."""
    if len(text) > MAX_BYTES:
        raise ControllerFileError(
            f"it is longer than {MAX_BYTES} characters, comments apart; keep so much as JSON"
        )
    if sum(1 for _ in _RULE.finditer(text)) > MOST_RULES:
        raise ControllerFileError(f"it has more than {MOST_RULES} rules; make it smaller")
    try:
        return _parser().parse(text)
    except UnexpectedEOF as error:
        raise ControllerFileError("the file ends inside a block; get a whole copy") from error
    except UnexpectedInput as error:
        seen = str(getattr(error, "token", text[error.pos_in_stream or 0 :])).split("\n")[0][:40]
        where = f"line {error.line}" if error.line > 0 else "the end"
        raise ControllerFileError(f"{where}: {seen!r} is not FCL here; correct it") from error
