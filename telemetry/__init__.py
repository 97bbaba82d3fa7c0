"""Recordings of inspection flights: write, read, compare, rescue and replay them."""

from pathlib import Path
from typing import Any

from telemetry.file import RecordingError
from telemetry.file.reader import read
from telemetry.file.tables import flat_table
from telemetry.file.writer import EpisodeWriter

__all__ = ["EpisodeWriter", "RecordingError", "flat_table", "read", "show"]


def show(*paths: str | Path) -> Any:
    """Show flights or an evaluation in a notebook; needs ``rerun-sdk[notebook]``.

    Parameters
    ----------
    *paths : str or Path
        Flights, the first in full and the others overlaid; or the folder of a run, of which the evaluation
        is shown.

    Returns
    -------
    rerun.notebook.Viewer
        Displays itself as the value of a cell.

    Raises
    ------
    RecordingError
        If no path is given, a file cannot be read, or rerun's notebook extra is not installed.
    """
    # the viewer takes half a second to import; writing and reading do without it
    from telemetry.scene import campaign, replay, viewer  # noqa: PLC0415

    if not paths:
        raise RecordingError("there is nothing to show; give flights (.mcap), or the folder of a run")
    given = [Path(path) for path in paths]
    if len(given) > 1 or given[0].suffix not in ("", ".parquet"):
        return viewer.in_notebook(replay.scene(given))
    return viewer.in_notebook(campaign.scene(given[0]))
