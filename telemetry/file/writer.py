"""Writes an episode to an MCAP file, which gets its final name only when it is complete."""

import math
import sys
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.message import Message
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import ArrayLike

from telemetry.array_types import Booleans, Floats, Integers
from telemetry.file import RecordingError, messages, topics
from telemetry.file.messages import NANOSECONDS, encode, nanoseconds, rows
from telemetry.file.metadata import sealed
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
        `episode`, and ``fis.<name>`` for each fuzzy system, encoded by `telemetry.file.metadata`.
    attachments : mapping of str to bytes
        Files to store in the recording, by name.

    Raises
    ------
    RecordingError
        If the disk is full or read-only, if records are out of order of time or of the wrong length, or if
        the metadata does not describe a fuzzy system.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        metadata: Mapping[str, Mapping[str, str]],
        attachments: Mapping[str, bytes],
    ):
        self.path = Path(path)
        self._metadata = {name: dict(entries) for name, entries in metadata.items()}
        self._attachments = dict(attachments)
        self._channels: dict[str, tuple[int, type[Message]]] = {}
        #: times, channels and contents of the messages that are not in the file yet
        self._waiting: list[tuple[int, int, bytes]] = []
        self._waiting_times: set[int] = set()
        self._written_until_ns = 0
        self._num_written: Counter[int] = Counter()

    def __enter__(self) -> Self:
        try:
            self._file = PartialFile(self.path)
        except OSError as error:
            raise self._explained(error) from error
        try:
            self._mcap = self._begun()
        except OSError as error:
            self._file.abandon()
            raise self._explained(error) from error
        start, origin = nanoseconds(0.0), np.zeros((1, 3))
        root = messages.transform(start, topics.VIEWER_ROOT_FRAME, topics.HILL_FRAME, origin, _UPRIGHT)
        self._write(topics.TRANSFORMS, start, root)
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if exception_type is not None:
            # report the first error, but save what can be saved
            with suppress(OSError):
                self._write_waiting()
            self._file.abandon()
            return
        try:
            self._write_waiting()
            self._mcap.finish()  # type: ignore[no-untyped-call]
            self._file.commit()
        except OSError as error:
            self._file.abandon()
            raise self._explained(error) from error

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
        for child, origin, turned in (
            (topics.DEPUTY_FRAME, position, deputy),
            (topics.CHIEF_FRAME, np.zeros_like(position), chief),
        ):
            columns = messages.transform(time_ns, topics.HILL_FRAME, child, origin, turned)
            self._write(topics.TRANSFORMS, time_ns, columns)
        self._write(topics.DEPUTY_POSE, time_ns, messages.pose_in_hill(time_ns, position, deputy))

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
        self._write(topics.CHIEF_POINTS, time_ns, messages.point_cloud(time_ns, points_m, states))

    def pulls(
        self,
        time_s: ArrayLike,
        points_m: ArrayLike,
        parts: Mapping[str, Floats],
        last_light_s: Floats,
        is_missed: Booleans,
    ) -> None:
        """Record what each point adds to inputs of the controller; the metadata `pulls` gives their units.

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
        columns: dict[str, Floats | Booleans] = {
            **parts,
            "last_light_s": last_light_s,
            "is_missed": is_missed,
        }
        self._write(topics.CHIEF_PULLS, time_ns, messages.cloud_of(time_ns, points_m, columns))

    def deputy_state(
        self,
        time_s: ArrayLike,
        position_m: ArrayLike,
        velocity_m_s: ArrayLike,
        quaternion: ArrayLike,
        angular_velocity_rad_s: ArrayLike,
    ) -> None:
        """Record the deputy's state in full precision.

        Parameters
        ----------
        time_s : float
            Simulation time.
        position_m, velocity_m_s : (3,)
            Relative to the chief, Hill axes.
        quaternion : (4,)
            Hill to body, scalar last.
        angular_velocity_rad_s : (3,)
            Relative to Hill, body axes.
        """
        time_ns = nanoseconds(time_s)
        columns = {
            "position_m": rows(position_m, len(time_ns), 3, "position_m"),
            "velocity_m_s": rows(velocity_m_s, len(time_ns), 3, "velocity_m_s"),
            "quaternion": rows(quaternion, len(time_ns), 4, "quaternion"),
            "angular_velocity_rad_s": rows(angular_velocity_rad_s, len(time_ns), 3, "angular_velocity_rad_s"),
        }
        self._write(topics.DEPUTY_STATE, time_ns, columns)

    def attitude_history(
        self,
        time_s: ArrayLike,
        time_offset_s: ArrayLike,
        quaternion: ArrayLike,
        angular_velocity_rad_s: ArrayLike,
        torque_n_m: ArrayLike,
    ) -> None:
        """Record the attitude history within the control period that follows a sample.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        time_offset_s : (S,)
            Time of each attitude step after the sample; the same for all samples.
        quaternion : (S, 4)
            Hill to body, scalar last.
        angular_velocity_rad_s : (S, 3)
            Relative to Hill, body axes.
        torque_n_m : (S, 3)
            Applied from each step on, body axes.
        """
        time_ns = nanoseconds(time_s)
        offsets = np.asarray(time_offset_s, dtype=np.float64).ravel().tolist()
        count, steps = len(time_ns), len(offsets)
        columns = {
            "time_offset_s": offsets,
            "quaternion": rows(quaternion, count, 4 * steps, "quaternion"),
            "angular_velocity_rad_s": rows(
                angular_velocity_rad_s, count, 3 * steps, "angular_velocity_rad_s"
            ),
            "torque_n_m": rows(torque_n_m, count, 3 * steps, "torque_n_m"),
        }
        self._write(topics.DEPUTY_ATTITUDE, time_ns, columns)

    def control(
        self,
        time_s: ArrayLike,
        force_body_n: ArrayLike,
        force_hill_n: ArrayLike,
        force_asked_n: ArrayLike,
        reason: ArrayLike,
        foreseen: ArrayLike | None = None,
        *,
        force_commanded_n: ArrayLike | None = None,
        command_reason: ArrayLike | None = None,
        command_age_s: float = 0.0,
    ) -> None:
        """Record the force during the control period that follows a sample.

        Without commands and their reasons, the recording does not tell what was commanded.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        force_body_n : (3,)
            Demanded by the controller, before clipping, body axes.
        force_hill_n : (3,)
            Fired, Hill axes.
        force_asked_n : (3,)
            Before dead bands, clip and safety layer, in the controller's axes.
        reason : (3,) int
            A `telemetry.file.topics.Reason` along each of Hill's axes: why something was, or was not, fired.
        foreseen : (3,), optional
            Points that coasting to the end would miss, least and greatest distance on the way, m; NaN where
            the controller does not ask.
        force_commanded_n : (3,), optional
            After dead bands, clip and safety layer, Hill axes.
        command_reason : (3,) int, optional
            A reason for each component of `force_asked_n`: why it was, or was not, commanded.
        command_age_s : float
            From a command until it is fired.
        """
        time_ns = nanoseconds(time_s)
        count = len(time_ns)
        columns = {
            "force_body_n": rows(force_body_n, count, 3, "force_body_n"),
            "force_hill_n": rows(force_hill_n, count, 3, "force_hill_n"),
            "force_asked_n": rows(force_asked_n, count, 3, "force_asked_n"),
            "reason": rows(reason, count, 3, "reason"),
            "command_age_s": command_age_s,
        }
        for name, given in (("force_commanded_n", force_commanded_n), ("command_reason", command_reason)):
            if given is not None:
                columns[name] = rows(given, count, 3, name)
        if foreseen is not None:
            names = ("coasting_missed", "coasting_nearest_m", "coasting_farthest_m")
            columns.update(zip(names, rows(foreseen, count, 3, "foreseen").T, strict=True))
        self._write(topics.DEPUTY_CONTROL, time_ns, columns)

    def guidance(
        self,
        time_s: ArrayLike,
        num_candidates: ArrayLike,
        target_direction: ArrayLike,
        lambda_u_rad: ArrayLike,
        eta_u_rad: ArrayLike,
    ) -> None:
        """Record the direction in which the deputy should look next.

        Parameters
        ----------
        time_s : float
            Simulation time.
        num_candidates : int
            Number of illuminated points that are not inspected yet.
        target_direction : (3,)
            Unit vector, Hill axes; zeros if there are no candidates.
        lambda_u_rad, eta_u_rad : float
            The relative angles of target and deputy.
        """
        time_ns = nanoseconds(time_s)
        columns = {
            "num_candidates": _numbers(num_candidates, len(time_ns)),
            "target_direction": rows(target_direction, len(time_ns), 3, "target_direction"),
            "lambda_u_rad": _numbers(lambda_u_rad, len(time_ns)),
            "eta_u_rad": _numbers(eta_u_rad, len(time_ns)),
        }
        self._write(topics.GUIDANCE, time_ns, columns)

    def navigation(
        self,
        time_s: ArrayLike,
        estimate: ArrayLike,
        deviation: ArrayLike,
        fix_m: ArrayLike,
        fix_age_s: ArrayLike,
        quaternion: ArrayLike,
    ) -> None:
        """Record what the deputy knows of its place.

        Parameters
        ----------
        time_s : float
            Simulation time.
        estimate, deviation : (6,)
            Position (m) and velocity (m/s), Hill axes, and the standard deviations of both.
        fix_m : (3,)
            The fix that comes into use, Hill axes; NaN where none does.
        fix_age_s : float
            How long ago it was measured.
        quaternion : (4,)
            The attitude as it is sensed, Hill to body.
        """
        time_ns = nanoseconds(time_s)
        count = len(time_ns)
        known, doubt = rows(estimate, count, 6, "estimate"), rows(deviation, count, 6, "deviation")
        columns = {
            "position_m": known[:, :3],
            "velocity_m_s": known[:, 3:],
            "position_deviation_m": doubt[:, :3],
            "velocity_deviation_m_s": doubt[:, 3:],
            "fix_m": rows(fix_m, count, 3, "fix_m"),
            "fix_age_s": _numbers(fix_age_s, count),
            "quaternion": rows(quaternion, count, 4, "quaternion"),
        }
        self._write(topics.NAVIGATION, time_ns, columns)

    def fis(
        self,
        time_s: ArrayLike,
        name: str,
        inputs: ArrayLike,
        firing_strengths: ArrayLike,
        output_n: ArrayLike,
        shares: ArrayLike = (),
    ) -> None:
        """Record an inference of the fuzzy system `name`.

        Parameters
        ----------
        time_s : float
            Simulation time.
        name : str
            As in the metadata ``fis.<name>``.
        inputs : (I,)
            In the system's order, before clipping to their ranges.
        firing_strengths : (R,)
            In rule order.
        output_n : float
            The defuzzified output.
        shares : (R,), optional
            Of each rule in the output, in its unit.
        """
        time_ns = nanoseconds(time_s)
        count = len(time_ns)
        columns = {
            "inputs": _rows_alike(inputs, count),
            "firing_strengths": _rows_alike(firing_strengths, count),
            "output_n": _numbers(output_n, count),
            "shares_n": _rows_alike(shares, count),
        }
        self._write(topics.fis_topic(name), time_ns, columns)

    def mission(
        self,
        time_s: ArrayLike,
        *,
        sun_angle_rad: ArrayLike,
        distance_m: ArrayLike,
        inspected_mask: ArrayLike,
        delta_v_m_s: ArrayLike,
        sun_elevation_rad: ArrayLike = 0.0,
        sun_hidden_share: ArrayLike = 0.0,
        inspectable_count: ArrayLike = 0,
        mass_kg: ArrayLike = 0.0,
    ) -> None:
        """Record the progress of the inspection; the count and the rate follow from the mask.

        Parameters
        ----------
        time_s : float
            Simulation time.
        sun_angle_rad : float
            Angle of the Sun from the i axis towards the j axis, Hill frame.
        distance_m : float
            Between the centres of deputy and chief.
        inspected_mask : (P,) bool
            In point order, including this sample.
        delta_v_m_s : float
            Total before this sample.
        sun_elevation_rad : float
            Of the Sun over the i-j plane towards the k axis, Hill frame.
        sun_hidden_share : float
            Of the Sun's disc, that the Earth hides from the chief.
        inspectable_count : int
            Points that are lit at some sample of the flight; 0 where that is not known.
        mass_kg : float
            Of the deputy; 0 where that is not known.
        """
        time_ns = nanoseconds(time_s)
        count = len(time_ns)
        mask = _rows_alike(inspected_mask, count) != 0.0
        inspected_count = mask.sum(axis=1)
        columns = {
            "sun_angle_rad": _numbers(sun_angle_rad, count),
            "distance_m": _numbers(distance_m, count),
            "inspected_count": inspected_count,
            "inspection_rate_percent": 100.0 * inspected_count / max(mask.shape[1], 1),
            "delta_v_m_s": _numbers(delta_v_m_s, count),
            "inspected_mask": mask,
            "sun_elevation_rad": _numbers(sun_elevation_rad, count),
            "sun_hidden_share": _numbers(sun_hidden_share, count),
            "inspectable_count": _numbers(inspectable_count, count),
            "mass_kg": _numbers(mass_kg, count),
        }
        self._write(topics.MISSION, time_ns, columns)

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
        """
        time_ns = nanoseconds(time_s)
        self._write(topics.LOG, time_ns, messages.log(time_ns, level, text))
        self._flush(int(time_ns[0]))

    def _begun(self) -> Writer:
        """Return the file, with what is readable from the start."""
        # a chunk ends where this writer says so, between samples
        mcap = Writer(self._file.stream, chunk_size=sys.maxsize)
        mcap.start(library="fuzzy-spacecraft-inspection telemetry")
        for name, entries in self._metadata.items():
            mcap.add_metadata(name, sealed(name, entries))
        for name, content in self._attachments.items():
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            mcap.add_attachment(0, 0, name, media_type, content)
        self._file.stream.flush()
        prefix = topics.FIS_METADATA_PREFIX
        systems = [name.removeprefix(prefix) for name in self._metadata if name.startswith(prefix)]
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

    def _write(self, topic: str, time_ns: Integers, columns: Mapping[str, Any]) -> None:
        if topic not in self._channels:
            name = topic.removeprefix(topics.FIS_PREFIX)
            raise RecordingError(
                f"the metadata does not describe the fuzzy system {name!r}; "
                f"add an entry {topics.FIS_METADATA_PREFIX + name!r}"
            )
        if not len(time_ns):
            return
        times = time_ns.tolist()
        is_full = len(self._waiting_times) >= SAMPLES_PER_CHUNK
        if is_full and times[0] > max(self._waiting_times):
            self._flush()
        for before, after in pairwise([self._written_until_ns, *times]):
            if after < before:
                raise RecordingError(
                    f"a record of {after / NANOSECONDS} s follows one of {before / NANOSECONDS} s, but "
                    "recordings are in order of time; write the records of a sample together"
                )
        channel, kind = self._channels[topic]
        contents = encode(kind, columns, len(times))
        self._waiting += ((time, channel, content) for time, content in zip(times, contents, strict=True))
        self._waiting_times.update(times)

    def _flush(self, until_ns: float = math.inf) -> None:
        """Bring messages to the file, up to a time or all."""
        try:
            self._write_waiting(until_ns)
        except OSError as error:
            # after a chunk that is lost others would leave a gap
            self._waiting, self._waiting_times = [], set()
            raise self._explained(error) from error

    def _write_waiting(self, until_ns: float = math.inf) -> None:
        """Give messages to the file in order of time; those of one time in the order in which they came."""
        self._waiting.sort(key=_TIME)
        given = self._waiting[: bisect_right(self._waiting, until_ns, key=_TIME)]
        if not given:
            return
        for number, (time_ns, sample) in enumerate(groupby(given, _TIME), start=1):
            for _, channel, content in sample:
                self._mcap.add_message(channel, time_ns, content, time_ns, self._num_written[channel])
                self._num_written[channel] += 1
            if number % SAMPLES_PER_CHUNK == 0:
                self._mcap.flush()  # type: ignore[no-untyped-call]
        self._mcap.flush()  # type: ignore[no-untyped-call]
        self._written_until_ns = given[-1][0]
        self._waiting = self._waiting[len(given) :]
        self._waiting_times = {time_ns for time_ns, _, _ in self._waiting}

    def _explained(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"the recording {self.path} cannot be written: {error.strerror or error}; it needs an existing, "
            "writable folder with about 1 MiB free: make room or choose another one (`python -m telemetry "
            f"recover` reads the steps that are already in {self.path.name}{PARTIAL_SUFFIX})"
        )


def _numbers(values: ArrayLike, count: int) -> Floats:
    """Return a number for each sample, (count,)."""
    return np.broadcast_to(np.asarray(values, dtype=np.float64), count)


def _rows_alike(values: ArrayLike, count: int) -> Floats:
    """Return as many rows, of whatever length."""
    found = np.asarray(values, dtype=np.float64)
    return found.reshape(count, found.size // max(count, 1))
