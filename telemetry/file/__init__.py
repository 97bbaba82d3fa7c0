"""Recordings as files: write, read, recover, compare, and export to tables."""


class RecordingError(Exception):
    """A recording cannot be written, read or shown; the message says what is wrong and how to fix it."""
