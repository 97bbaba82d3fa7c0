"""Recordings of inspection flights: write, read, compare, rescue and replay them."""

from telemetry.errors import RecordingError
from telemetry.reader import read
from telemetry.tables import flat_table
from telemetry.writer import EpisodeWriter

__all__ = ["EpisodeWriter", "RecordingError", "flat_table", "read"]
