"""Errors that the user can correct; their messages say how."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice

#: Most names that a suggestion compares.
MOST_NAMES = 50
#: This many equal letters at the beginning of two keys of a group count as similar.
COMMON = 3


class MissingExtra(ImportError):  # noqa: N818
    """An optional package is needed but not installed.

    Parameters
    ----------
    use : str
        What needs the package.
    package : str
        The missing package.
    cure : str
        The arguments of ``python -m pip install`` that install it.
    """

    def __init__(self, use: str, package: str, cure: str) -> None:
        super().__init__(
            f"{use} needs {package}, which is not installed; install it: python -m pip install {cure}"
        )


class Mistake(ValueError):  # noqa: N818
    """An error that the user can correct, in a sentence; commands print that alone."""


class ControllerFileError(Mistake):
    """A controller file that cannot be read; the message says why and how to correct it."""


@contextmanager
def raised_as(kind: type[Exception], *causes: type[Exception], where: str = "") -> Iterator[None]:
    """Re-raise errors of some kinds in a block as another kind; ``where`` begins the sentences."""
    try:
        yield
    except causes as error:
        raise kind(f"{where}{error}") from error


def require_known(names: Iterable[str], known: Collection[str], fault: str, kind: type[Exception]) -> None:
    """Raise an error for an unknown name; ``fault`` is the sentence up to the name."""
    for name in names:
        if name not in known:
            raise kind(f"{fault} {name!r}; {suggestion(str(name), known)}")


def suggestion(wrong: str, known: Iterable[str]) -> str:
    """Return the nearest known name, or a list of them; of very many names only the first are compared."""
    names = list(islice(known, MOST_NAMES))
    if match := nearest(wrong, names):
        return f"did you mean {match!r}?"
    return f"choose one of {', '.join(names)}" if names else "none is declared"


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known name most like an unknown one, whatever the case, or None if none is similar.

    Names with dots are keys of groups. In a group that exists, its keys come first; else a key is also
    compared by its last name, so that a key in the wrong group finds the right one.
    """
    names = {name.lower(): name for name in known}
    word = word.lower()
    group, dot, last = word.rpartition(".")
    siblings = {name.rpartition(".")[2]: name for name in names if dot and name.rpartition(".")[0] == group}
    if matches := get_close_matches(last, siblings, n=1):
        return names[siblings[matches[0]]]
    alike = (name for end, name in siblings.items() if len(last) >= COMMON and end[:COMMON] == last[:COMMON])
    if (name := next(alike, None)) or (name := next(iter(get_close_matches(word, names, n=1)), None)):
        return names[name]
    lasts = {name.rpartition(".")[2]: name for name in names}
    return names[lasts[matches[0]]] if (matches := get_close_matches(last, lasts, n=1)) else None
