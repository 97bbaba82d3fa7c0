"""Messages that wait for their chunk of the file, and are brought into order of time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np

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
        self._given_until_ns = 0

    def is_full_before(self, time_ns: int) -> bool:
        """Return whether enough samples wait, and none of them gets messages of this time or later ones."""
        return len(self._samples) >= SAMPLES_PER_CHUNK and time_ns > max(self._samples)

    def add(self, batch: Messages) -> None:
        """Take messages.

        Raises
        ------
        RecordingError
            If one is earlier than the one before it, or than those that have been given.
        """
        times = [self._given_until_ns, *batch.time_ns.tolist()]
        if times != sorted(times):
            before, after = next(pair for pair in pairwise(times) if pair[1] < pair[0])
            raise RecordingError(
                f"a record of {after / NANOSECONDS} s follows one of {before / NANOSECONDS} s, but "
                "recordings are in order of time; write the records of a sample together"
            )
        self._batches.append(batch)
        self._samples.update(times[1:])

    def give(self, until_ns: int | None = None) -> Iterator[Messages]:
        """Yield chunks of all messages up to a time, by default all; those of one time as they came."""
        last_ns = max(self._samples, default=0) if until_ns is None else until_ns
        heads, tails = [], []
        for channel, time_ns, contents in self._batches:
            cut = int(np.searchsorted(time_ns, last_ns, side="right"))
            heads.append(Messages(channel[:cut], time_ns[:cut], contents[:cut]))
            if cut < len(contents):
                tails.append(Messages(channel[cut:], time_ns[cut:], contents[cut:]))
        self._batches = tails
        self._samples = {time_ns for time_ns in self._samples if time_ns > last_ns}
        self._given_until_ns = max(self._given_until_ns, last_ns)
        yield from _chunks(heads)


def _chunks(batches: list[Messages]) -> Iterator[Messages]:
    if not batches:
        return
    time_ns = np.concatenate([batch.time_ns for batch in batches])
    order = np.argsort(time_ns, kind="stable")
    channel, time_ns = np.concatenate([batch.channel for batch in batches])[order], time_ns[order]
    unordered = [content for batch in batches for content in batch.contents]
    contents = [unordered[place] for place in order.tolist()]
    sample = np.cumsum(np.diff(time_ns, prepend=time_ns[:1]) > 0)
    starts = np.searchsorted(sample, np.arange(0, sample[-1] + 1, SAMPLES_PER_CHUNK)).tolist()
    for start, end in pairwise([*starts, len(contents)]):
        yield Messages(channel[start:end], time_ns[start:end], contents[start:end])
