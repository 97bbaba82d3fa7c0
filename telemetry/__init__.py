"""Recordings of inspection flights: write, read, rescue and replay them."""

from telemetry.errors import RecordingError
from telemetry.reader import read
from telemetry.writer import EpisodeWriter

__all__ = ["EpisodeWriter", "RecordingError", "read"]
