"""Messages that wait for their chunk of the file, and are brought into order of time."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from telemetry.file.container import Messages
from telemetry.file.errors import RecordingError
from telemetry.file.messages import NANOSECONDS

#: a process that is killed loses at most this many samples
SAMPLES_PER_CHUNK: Final = 60


class Waiting:
    """Takes messages topic by topic, of one sample or of many, and gives them in chunks of few samples."""

    def __init__(self) -> None:
        self._batches: list[Messages] = []
        self._samples: set[int] = set()
        self._last_ns = 0
        self._given_until_ns = 0

    def is_full_before(self, time_ns: int) -> bool:
        """Return whether enough samples wait, and none of them gets messages of this time or later ones."""
        return len(self._samples) >= SAMPLES_PER_CHUNK and time_ns > self._last_ns

    def add(self, batch: Messages) -> None:
        """Take messages.

        Raises
        ------
        RecordingError
            If one is earlier than the one before it, or than those that have been given.
        """
        times = np.concatenate([[self._given_until_ns], batch.time_ns])
        early = np.flatnonzero(times[1:] < times[:-1])
        if early.size:
            before, after = times[early[0] : early[0] + 2].tolist()
            raise RecordingError(
                f"a record of {after / NANOSECONDS} s follows one of {before / NANOSECONDS} s, but "
                "recordings are in order of time; write the records of a sample together"
            )
        # topics of the same samples come one after the other
        if not (self._batches and np.array_equal(batch.time_ns, self._batches[-1].time_ns)):
            self._samples.update(batch.time_ns.tolist())
            self._last_ns = max(self._last_ns, int(times[-1]))
        self._batches.append(batch)

    def give(self, until_ns: int | None = None) -> tuple[list[Messages], NDArray[np.int64], list[int]] | None:
        """Return messages up to a time, by default all, in what order they are, and where chunks begin in it.

        Those of one time are in the order in which they came. Where none wait there is nothing to return.
        """
        last_ns = self._last_ns if until_ns is None else until_ns
        cuts = [int(np.searchsorted(batch.time_ns, last_ns, side="right")) for batch in self._batches]
        given = [batch.part(slice(cut)) for batch, cut in zip(self._batches, cuts, strict=True) if cut]
        left = [batch.part(slice(cut, None)) for batch, cut in zip(self._batches, cuts, strict=True)]
        self._batches = [batch for batch in left if len(batch.time_ns)]
        self._samples = {time_ns for time_ns in self._samples if time_ns > last_ns}
        self._given_until_ns = max(self._given_until_ns, last_ns)
        if not given:
            return None
        time_ns = np.concatenate([batch.time_ns for batch in given])
        order = np.argsort(time_ns, kind="stable")
        sample = np.cumsum(np.diff(time_ns[order], prepend=time_ns[order[:1]]) > 0)
        starts = np.searchsorted(sample, np.arange(0, sample[-1] + 1, SAMPLES_PER_CHUNK)).tolist()
        return given, order, starts
