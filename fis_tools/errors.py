"""Errors that a person can put right, each with a sentence that says how."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice

#: Most names that a suggestion compares.
MOST_NAMES = 50


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
    """A controller file that cannot be read, told in a sentence."""


@contextmanager
def told_as(kind: type[Exception], *causes: type[Exception], where: str = "") -> Iterator[None]:
    """Re-raise errors of some kinds in a block as another kind; ``where`` begins the sentences."""
    try:
        yield
    except causes as error:
        raise kind(f"{where}{error}") from error


def require_known(names: Iterable[str], known: Collection[str], fault: str, kind: type[Exception]) -> None:
    """Raise an error for an unknown name; ``fault`` is the sentence up to the name."""
    for name in names:
        if name not in known:
            raise kind(f"{fault} {name!r}; {nearest(str(name), known)}")


def nearest(wrong: str, known: Iterable[str]) -> str:
    """Return the nearest known name, or a list of them; of very many names only the first are compared."""
    names = list(islice(known, MOST_NAMES))
    matches = get_close_matches(wrong, names, n=1)
    if matches:
        return f"did you mean {matches[0]!r}?"
    return f"choose one of {', '.join(names)}" if names else "none is declared"
