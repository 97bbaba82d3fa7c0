"""What shipped code was made from, as a digest that no version of Python, numba or NumPy changes.

Of each function that is reached it takes the words of its source, without comments and docstrings, and the
values that it names, as they are in this process. Of vectors it takes the modules that say how numba compiles
them.
"""

import hashlib
import inspect
import io
import tokenize
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

from fis_tools.compiled.fingerprint import described_values, reached
from plain_files.file_access import read_shipped

#: Beside the functions: how vectors are compiled.
VECTORS = ("borrowed_code", "vector_code", "vector_memory", "vector_types", "vectors")
_FORMATTED_START, _FORMATTED_END = (getattr(tokenize, f"FSTRING_{end}", -1) for end in ("START", "END"))
_LAYOUT = (tokenize.COMMENT, tokenize.NL, tokenize.ENCODING, tokenize.ENDMARKER)


def digest(compiled: Any, known: Mapping[str, Any]) -> str:
    """Return 32 hexadecimal digits for all that the code of a function is made from.

    Parameters
    ----------
    compiled : Compiled
    known : mapping
        By module: the SHA-256 of its file, and the digests of its functions' words by their names.

    Raises
    ------
    fis_tools.compiled.fingerprint.UnknownPartError
        If something cannot be described.
    OSError
        If a source cannot be read.
    """
    total = hashlib.sha256("".join(_module_digests(known)).encode())
    for function, callees in reached(compiled).items():
        python: FunctionType = function.py_func
        words = _words_of(python, known)
        values = described_values(function)
        options = sorted(function.targetoptions.items())
        names = [f"{callee.py_func.__module__}.{callee.py_func.__qualname__}" for callee in callees]
        described = python.__module__, python.__qualname__, options, words, values, names
        total.update(repr(described).encode())
    return total.hexdigest()[:32]


def _module_digests(known: Mapping[str, Any]) -> Iterator[str]:
    for name in VECTORS:
        path = Path(__file__).parents[1] / f"{name}.py"
        facts = known.get(f"fis_tools.compiled.{name}", {})
        is_known = facts.get("sha256") == _sha256(path)
        yield facts["functions"][""] if is_known else _digest_of(_words(read_shipped(path)))


def _words_of(function: FunctionType, known: Mapping[str, Any]) -> str:
    facts = known.get(function.__module__, {})
    if facts and facts["sha256"] == _sha256(Path(function.__code__.co_filename)):
        digested = facts["functions"].get(function.__qualname__)
        if digested is not None:
            return str(digested)
    return words_digest(function)


@cache
def _sha256(path: Path) -> str:
    return hashlib.sha256(read_shipped(path).encode()).hexdigest()


def words_digest(function: FunctionType) -> str:
    """Return the digest of a function's words, without comments and docstrings."""
    return _digest_of(_words(inspect.cleandoc("\n" + inspect.getsource(function))))


def facts_of(functions: Iterator[FunctionType]) -> dict[str, Any]:
    """Return what `digest` takes as known, for the modules of some functions and those of vectors."""
    facts: dict[str, Any] = {}
    for function in functions:
        held = facts.setdefault(
            function.__module__, {"sha256": _sha256(Path(function.__code__.co_filename)), "functions": {}}
        )
        held["functions"][function.__qualname__] = words_digest(function)
    for name in VECTORS:
        path = Path(__file__).parents[1] / f"{name}.py"
        held = facts.setdefault(f"fis_tools.compiled.{name}", {"sha256": _sha256(path), "functions": {}})
        held["functions"][""] = _digest_of(_words(read_shipped(path)))
    return {name: facts[name] for name in sorted(facts)}


def _words(source: str) -> Iterator[str]:
    """Yield the words of a source; a text that is a statement is a docstring."""
    kept = [token for token in _tokens(source) if token.type not in _LAYOUT]
    ends = (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    for index, token in enumerate(kept):
        is_alone = token.type == tokenize.STRING and kept[index + 1].type == tokenize.NEWLINE
        if is_alone and (index == 0 or kept[index - 1].type in ends):
            continue
        yield tokenize.tok_name[token.type] if token.type in ends else token.string


def _tokens(source: str) -> Iterator[tokenize.TokenInfo]:
    """Yield tokens as Python 3.11 has them: since 3.12 a formatted text is several."""
    lines, depth, start = source.splitlines(keepends=True), 0, (1, 0)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == _FORMATTED_START:
            start = start if depth else token.start
            depth += 1
        elif token.type == _FORMATTED_END:
            depth -= 1
            if not depth:
                (first, left), (last, right) = start, token.end
                rows = lines[first - 1 : last]
                rows[-1] = rows[-1][:right]
                rows[0] = rows[0][left:]
                yield tokenize.TokenInfo(tokenize.STRING, "".join(rows), start, token.end, token.line)
        elif not depth:
            yield token


def _digest_of(words: Iterator[str]) -> str:
    return hashlib.sha256("\x00".join(words).encode()).hexdigest()[:32]
