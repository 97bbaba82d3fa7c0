"""The right word nearest to a wrong one, for messages."""

from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher
from itertools import takewhile

LIKENESS = 0.6


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word most like one that is not, or None where none is like it.

    In a group that exists, its keys come first; else a dotted key is also compared by its last part, so that
    a key in the wrong group finds the right one. A common beginning counts as likeness.
    """
    candidates = sorted(known)
    group, dot, last = word.lower().rpartition(".")
    siblings = [key for key in candidates if key.rpartition(".")[0] == group]
    found = _most_alike(last, [key.rpartition(".")[2] for key in siblings]) if dot else None
    if found is not None:
        return siblings[found]
    found = _most_alike(word.lower(), candidates)
    if found is None:
        found = _most_alike(last, [key.rpartition(".")[2] for key in candidates])
    return None if found is None else candidates[found]


def _most_alike(word: str, candidates: Sequence[str]) -> int | None:
    """Return the index of the candidate most like a word, or None."""

    def likeness(candidate: str) -> float:
        alike = takewhile(lambda pair: pair[0] == pair[1], zip(word, candidate.lower(), strict=False))
        beginning = sum(1 for _ in alike) / max(len(word), 3)
        return max(SequenceMatcher(None, word, candidate.lower()).ratio(), beginning)

    scores = [likeness(candidate) for candidate in candidates]
    best = max(range(len(scores)), key=scores.__getitem__, default=None)
    return best if best is not None and scores[best] >= LIKENESS else None


def did_you_mean(word: str, known: Iterable[str], prefix: str = "") -> str:
    """Return ``; did you mean …?``, or nothing where no known word is like it."""
    found = nearest(word, known)
    return f"; did you mean {prefix}{found}?" if found else ""
