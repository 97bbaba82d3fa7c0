"""Recordings of inspection flights: write, read, compare, rescue and replay them."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from telemetry.file.errors import RecordingError
from telemetry.file.writer import EpisodeWriter

if TYPE_CHECKING:
    from telemetry.file.reader import read
    from telemetry.file.tables import flat_table

__all__ = ["EpisodeWriter", "RecordingError", "flat_table", "read", "show"]


def show(*paths: str | Path) -> Any:
    """Show flights or a run in a notebook; see `telemetry.scene.notebook.show`."""
    # the viewer takes half a second to import; writing and reading do without it
    from telemetry.scene import notebook  # noqa: PLC0415

    return notebook.show(*paths)


def __getattr__(name: str) -> Any:
    """Import what reads recordings when it is asked for: a flight is recorded without it."""
    if name not in {"flat_table", "read"}:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(
        import_module("telemetry.file.reader" if name == "read" else "telemetry.file.tables"), name
    )
