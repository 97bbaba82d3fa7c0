"""The one error a user of recordings meets."""


class RecordingError(Exception):
    """A recording cannot be written, read or shown; its text gives the fact, the expectation and the cure."""
