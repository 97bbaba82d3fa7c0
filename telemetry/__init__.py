"""Recordings of inspection flights: write, read, compare, rescue and replay them."""

from pathlib import Path
from typing import Any

from telemetry.errors import RecordingError
from telemetry.reader import read
from telemetry.tables import flat_table
from telemetry.writer import EpisodeWriter

__all__ = ["EpisodeWriter", "RecordingError", "flat_table", "read", "show"]


def show(*paths: str | Path) -> Any:
    """Show flights or a run in a notebook; see `telemetry.notebook.show`."""
    # the viewer takes half a second to import, which nobody who only writes or reads should pay
    from telemetry import notebook  # noqa: PLC0415

    return notebook.show(*paths)
