"""Recordings as files: write, read, recover, compare, and export to tables."""

from collections.abc import Iterator
from contextlib import contextmanager


class RecordingError(ValueError):
    """A recording cannot be written, read or shown; the message says what is wrong and how to fix it."""


@contextmanager
def explained(what: str, cure: str, *also: type[Exception]) -> Iterator[None]:
    """Turn errors of the operating system, and others, into a `RecordingError`: what, why, and the cure."""
    expected: tuple[type[Exception], ...] = (OSError, *also)
    try:
        yield
    except expected as error:
        raise RecordingError(f"{what}: {getattr(error, 'strerror', None) or error}; {cure}") from error
