"""Writing an episode to an MCAP file, which gets its final name only when it is complete."""

import math
import shlex
import sys
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import ArrayLike

from telemetry.array_types import Booleans, Floats, Integers
from telemetry.file import RecordingError, explained, topics
from telemetry.file.messages import LOG_LEVELS, cloud_of, encode, nanoseconds, point_cloud, rows, transform
from telemetry.file.metadata import epoch_ns_of, sealed
from telemetry.file.partial_file import PARTIAL_SUFFIX, PartialFile
from telemetry.file.schema import inspection_pb2

#: a process that is killed loses at most this many samples
SAMPLES_PER_CHUNK: Final = 60
_TIME: Final = itemgetter(0)
_KIND_OF_TOPIC: Final[Mapping[str, type[Message]]] = {
    topics.TRANSFORMS: FrameTransform,
    topics.DEPUTY_POSE: PoseInFrame,
    topics.CHIEF_POINTS: PointCloud,
    topics.DEPUTY_STATE: inspection_pb2.DeputyState,
    topics.DEPUTY_ATTITUDE: inspection_pb2.AttitudeHistory,
    topics.DEPUTY_CONTROL: inspection_pb2.Control,
    topics.GUIDANCE: inspection_pb2.Guidance,
    topics.NAVIGATION: inspection_pb2.Navigation,
    topics.MISSION: inspection_pb2.MissionStatus,
    topics.LOG: Log,
}
_UPRIGHT: Final = np.array([[0.0, 0.0, 0.0, 1.0]])
_MEDIA_TYPES: Final = {".yaml": "application/yaml", ".yml": "application/yaml", ".json": "application/json"}


class EpisodeWriter:
    """Context manager that records an episode: sample by sample in order of time, or topic by topic at once.

    Every method takes one sample, or N: then `time_s` is (N,), and what differs from sample to sample has a
    first axis of N besides the shape that is given.

    While open, the file is called ``<path>.partial``; it is synced to disk and renamed at the end. If the
    block raises an exception, or the process is killed, the partial file stays;
    ``python -m telemetry recover`` makes every flushed step of it readable.

    Parameters
    ----------
    path : Path or str
        The file to write; an existing one is replaced when the new one is complete.
    metadata : mapping of str to mapping of str to str
        `episode`, and ``fis.<name>`` for each fuzzy system, encoded by `telemetry.file.metadata`. Time stamps
        count from the episode's epoch, if it has one.
    attachments : mapping of str to bytes
        Files to store in the recording, by name.

    Raises
    ------
    RecordingError
        If the disk is full or read-only, if records are out of order of time or of the wrong length, or if
        the metadata does not describe a fuzzy system.
    """

    def __init__(
        self, path: Path | str, *, metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]
    ):
        self.path = Path(path)
        self._metadata = {name: dict(entries) for name, entries in metadata.items()}
        self._attachments = dict(attachments)
        self._epoch_ns = epoch_ns_of(self._metadata.get(topics.EPISODE_METADATA, {}))
        self._channels: dict[str, tuple[int, type[Message]]] = {}
        #: times, channels and contents of the messages that are not in the file yet
        self._waiting: list[tuple[int, int, bytes]] = []
        self._waiting_times: set[int] = set()
        self._written_until_ns = 0
        self._num_written: Counter[int] = Counter()

    def __enter__(self) -> Self:
        with self._explained():
            self._file = PartialFile(self.path)
            try:
                self._mcap = self._begun()
            except OSError:
                self._file.abandon()
                raise
        start, origin = nanoseconds(0.0), np.zeros((1, 3))
        root = transform(topics.VIEWER_ROOT_FRAME, topics.HILL_FRAME, origin, _UPRIGHT)
        self._write(topics.TRANSFORMS, start, root)
        return self

    def __exit__(self, exception_type: type[BaseException] | None, *_: object) -> None:
        # report the first error, but save what can be saved
        with self._explained() if exception_type is None else suppress(OSError):
            try:
                self._write_waiting()
                if exception_type is None:
                    self._mcap.finish()  # type: ignore[no-untyped-call]
                    self._file.commit()
            finally:
                # after a commit there is nothing left to close
                self._file.abandon()

    def poses(
        self,
        time_s: ArrayLike,
        position_m: ArrayLike,
        quaternion_b_from_h: ArrayLike,
        quaternion_c_from_h: ArrayLike,
    ) -> None:
        """Record the deputy's pose and the transforms of deputy and chief.

        Parameters
        ----------
        time_s : float
            Simulation time.
        position_m : (3,)
            Of the deputy, Hill axes.
        quaternion_b_from_h, quaternion_c_from_h : (4,)
            Hill to deputy body and Hill to chief body, scalar last.
        """
        time_ns = nanoseconds(time_s)
        position = rows(position_m, len(time_ns), 3, "position_m")
        deputy = rows(quaternion_b_from_h, len(time_ns), 4, "quaternion_b_from_h")
        chief = rows(quaternion_c_from_h, len(time_ns), 4, "quaternion_c_from_h")
        origin = np.zeros_like(position)
        bodies = {topics.DEPUTY_FRAME: (position, deputy), topics.CHIEF_FRAME: (origin, chief)}
        for child, (location, turned) in bodies.items():
            columns = transform(topics.HILL_FRAME, child, location, turned)
            self._write(topics.TRANSFORMS, time_ns, columns)
        pose = {
            "position": dict(zip("xyz", position.T, strict=True)),
            "orientation": dict(zip("xyzw", deputy.T, strict=True)),
        }
        self._write(topics.DEPUTY_POSE, time_ns, {"frame_id": topics.HILL_FRAME, "pose": pose})

    def points(self, time_s: ArrayLike, points_m: ArrayLike, states: ArrayLike) -> None:
        """Record the inspection points and their states.

        Parameters
        ----------
        time_s : float
            Simulation time.
        points_m : (P, 3)
            In point order, chief axes; the same in all samples.
        states : (P,) int
            A `telemetry.file.topics.PointState` for each point.
        """
        time_ns = nanoseconds(time_s)
        self._write(topics.CHIEF_POINTS, time_ns, point_cloud(len(time_ns), points_m, states))

    def pulls(
        self,
        time_s: ArrayLike,
        points_m: ArrayLike,
        parts: Mapping[str, Floats],
        last_light_s: Floats,
        is_missed: Booleans,
    ) -> None:
        """Record each point's contribution to inputs of the controller; the metadata `pulls` gives the units.

        Parameters
        ----------
        time_s : float
            Simulation time.
        points_m : (P, 3)
            As in `points`.
        parts : mapping of str to (P,)
            By the name of the input.
        last_light_s : (P,)
            When each point is lit for the last time; the same in all samples.
        is_missed : (P,) bool
            Whether coasting to the end would leave it unseen.
        """
        time_ns = nanoseconds(time_s)
        columns: dict[str, Any] = {**parts, "last_light_s": last_light_s, "is_missed": is_missed}
        self._write(topics.CHIEF_PULLS, time_ns, cloud_of(len(time_ns), points_m, columns))

    def record(self, topic: str, time_s: ArrayLike, **fields: ArrayLike) -> None:
        """Record messages of one of the project's own schemas.

        Parameters
        ----------
        topic : str
            One of `telemetry.file.topics`, or of a fuzzy system: `telemetry.file.topics.fis_topic`.
        time_s : float
            Simulation time.
        fields
            By their names in the topic's schema (``telemetry/file/schema/inspection.proto``), which tells
            units, frames and lengths; those left out stay empty. NaN leaves an optional field out.
            ``time_offset_s`` (S,) is the same for all samples.
        """
        time_ns = nanoseconds(time_s)
        schema = self._channel(topic)[1].DESCRIPTOR
        instants = np.size(fields["time_offset_s"]) if "time_offset_s" in fields else 1
        columns: dict[str, Any] = {}
        for name, values in fields.items():
            field = schema.fields_by_name.get(name)
            if field is None:
                known = ", ".join(schema.fields_by_name)
                raise RecordingError(f"{topic} has no field {name!r}; {schema.full_name} has {known}")
            if name == "time_offset_s":
                columns[name] = np.ravel(values).tolist()
            elif name in topics.LENGTHS:
                columns[name] = rows(values, len(time_ns), topics.LENGTHS[name] * instants, name)
            elif field.is_repeated or field.type == FieldDescriptor.TYPE_BYTES:
                columns[name] = rows(values, len(time_ns), np.size(values) // max(len(time_ns), 1), name)
            else:
                every = np.full(len(time_ns), values) if np.ndim(values) == 0 else values
                columns[name] = rows(every, len(time_ns), 1, name)[:, 0]
        self._write(topic, time_ns, columns)

    def log(self, time_s: float, level: str, text: str) -> None:
        """Record an event as text, and flush everything up to it to the file.

        Parameters
        ----------
        time_s : float
            Simulation time.
        level : str
            ``debug``, ``info``, ``warning`` or ``error``.
        text : str
            One sentence.

        Raises
        ------
        RecordingError
            If there is no such level.
        """
        if level not in LOG_LEVELS:
            raise RecordingError(f"there is no log level {level!r}; choose one of {', '.join(LOG_LEVELS)}")
        time_ns = nanoseconds(time_s)
        self._write(topics.LOG, time_ns, {"level": LOG_LEVELS[level], "message": text, "name": "episode"})
        self._flush(int(time_ns[0]))

    def _begun(self) -> Writer:
        """Return the writer, with the header already readable."""
        # a chunk ends where this writer says so, between samples
        mcap = Writer(self._file.stream, chunk_size=sys.maxsize)
        mcap.start(library="fuzzy-spacecraft-inspection telemetry")
        for name, entries in self._metadata.items():
            mcap.add_metadata(name, sealed(name, entries))
        for name, content in self._attachments.items():
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            mcap.add_attachment(0, 0, name, media_type, content)
        self._file.stream.flush()
        systems = topics.under(topics.FIS_METADATA_PREFIX, self._metadata)
        kinds: dict[str, type[Message]] = {
            **_KIND_OF_TOPIC,
            **({topics.CHIEF_PULLS: PointCloud} if topics.PULLS_METADATA in self._metadata else {}),
            **{topics.fis_topic(name): inspection_pb2.FisActivation for name in systems},
        }
        schemas: dict[str, int] = {}
        for topic, kind in kinds.items():
            name = kind.DESCRIPTOR.full_name
            if name not in schemas:
                schemas[name] = register_schema(mcap, kind)
            self._channels[topic] = mcap.register_channel(topic, "protobuf", schemas[name]), kind
        return mcap

    def _channel(self, topic: str) -> tuple[int, type[Message]]:
        """Return a topic's channel and the kind of its messages."""
        if topic not in self._channels:
            name = topic.removeprefix(topics.FIS_PREFIX)
            raise RecordingError(
                f"the metadata does not describe the fuzzy system {name!r}; "
                f"add an entry {topics.FIS_METADATA_PREFIX + name!r}"
            )
        return self._channels[topic]

    def _write(self, topic: str, time_ns: Integers, columns: Mapping[str, Any]) -> None:
        """Add messages of a topic, encoded, to those waiting to be written in order of time."""
        channel, kind = self._channel(topic)
        if not len(time_ns):
            return
        if "timestamp" in kind.DESCRIPTOR.fields_by_name:
            seconds, nanos = np.divmod(time_ns + self._epoch_ns, topics.NANOSECONDS)
            columns = {"timestamp": {"seconds": seconds, "nanos": nanos}, **columns}
        times = time_ns.tolist()
        is_full = len(self._waiting_times) >= SAMPLES_PER_CHUNK
        if is_full and times[0] > max(self._waiting_times):
            self._flush()
        for before, after in pairwise([self._written_until_ns, *times]):
            if after < before:
                raise RecordingError(
                    f"a record of {after / topics.NANOSECONDS} s follows one of "
                    f"{before / topics.NANOSECONDS} s, but recordings are in order of time; write the "
                    "records of a sample together"
                )
        contents = encode(kind, columns, len(times))
        self._waiting += ((time, channel, content) for time, content in zip(times, contents, strict=True))
        self._waiting_times.update(times)

    def _flush(self, until_ns: float = math.inf) -> None:
        """Write pending messages up to a time, or all."""
        with self._explained():
            try:
                self._write_waiting(until_ns)
            except OSError:
                # chunks after one that is lost would leave a gap
                self._waiting, self._waiting_times = [], set()
                raise

    def _write_waiting(self, until_ns: float = math.inf) -> None:
        """Write pending messages in order of time; equal times keep the order of arrival."""
        self._waiting.sort(key=_TIME)
        given = self._waiting[: bisect_right(self._waiting, until_ns, key=_TIME)]
        if not given:
            return
        for number, (time_ns, sample) in enumerate(groupby(given, _TIME), start=1):
            stamp = self._epoch_ns + time_ns
            for _, channel, content in sample:
                self._mcap.add_message(channel, stamp, content, stamp, self._num_written[channel])
                self._num_written[channel] += 1
            if number % SAMPLES_PER_CHUNK == 0:
                self._mcap.flush()  # type: ignore[no-untyped-call]
        self._mcap.flush()  # type: ignore[no-untyped-call]
        self._written_until_ns = given[-1][0]
        self._waiting = self._waiting[len(given) :]
        self._waiting_times = {time_ns for time_ns, _, _ in self._waiting}

    def _explained(self) -> AbstractContextManager[None]:
        """Turn errors in writing this recording into a RecordingError with a cure."""
        partial = f"{self.path}{PARTIAL_SUFFIX}"
        cure = (
            "it needs an existing, writable folder with about 1 MiB free: make room or choose another one; "
            f"rescue what is written already with `python -m telemetry recover {shlex.quote(partial)}`"
        )
        return explained(f"the recording {self.path} cannot be written", cure)
