"""The known word nearest to a misspelt one, for messages."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

#: this many equal letters at the beginning count as similar
COMMON = 3


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word most like an unknown one, or None if none is similar.

    In a group that exists, its keys come first; else a dotted key is also compared by its last name, so that
    a key in the wrong group finds the right one.
    """
    candidates = sorted(known)
    group, dot, last = word.lower().rpartition(".")
    names = {key: key.lower().rpartition(".") for key in candidates}
    siblings = {name[2]: key for key, name in names.items() if dot and name[0] == group}
    if found := get_close_matches(last, siblings, n=1):
        return siblings[found[0]]
    if begun := [
        key for name, key in siblings.items() if len(last) >= COMMON and name[:COMMON] == last[:COMMON]
    ]:
        return begun[0]
    lower = {key.lower(): key for key in candidates}
    if found := get_close_matches(word.lower(), lower, n=1):
        return lower[found[0]]
    lasts = {name[2]: key for key, name in names.items()}
    found = get_close_matches(last, lasts, n=1)
    return lasts[found[0]] if found else None


def choices_of(word: str, known: Sequence[str], plural: str = "choices") -> str:
    """Return ``; did you mean …? The choices are …``; the choices may be called something else."""
    guess = did_you_mean(word, known)
    return (f"{guess} The" if guess else "; the") + f" {plural} are {', '.join(known)}"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean …?``, or nothing if no known word is similar."""
    found = nearest(word, known)
    return f"; did you mean {found}?" if found else ""
