"""Recordings of inspection flights: write, read, compare, rescue and replay them."""

from pathlib import Path
from typing import Any

from telemetry.file.errors import RecordingError
from telemetry.file.reader import read
from telemetry.file.tables import flat_table
from telemetry.file.writer import EpisodeWriter

__all__ = ["EpisodeWriter", "RecordingError", "flat_table", "read", "show"]


def show(*paths: str | Path) -> Any:
    """Show flights or a run in a notebook; see `telemetry.scene.notebook.show`."""
    # the viewer takes half a second to import; writing and reading do without it
    from telemetry.scene import notebook  # noqa: PLC0415

    return notebook.show(*paths)
