"""Writes one episode as one MCAP file that appears under its name only when it is complete."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.message import Message
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import ArrayLike

from telemetry.file import messages, topics
from telemetry.file.errors import RecordingError
from telemetry.file.messages import NANOSECONDS, row
from telemetry.file.metadata import sealed
from telemetry.file.partial_file import PARTIAL_SUFFIX, PartialFile
from telemetry.file.schema.inspection_pb2 import (
    AttitudeHistory,
    Control,
    DeputyState,
    FisActivation,
    Guidance,
    MissionStatus,
)

#: a process killed without warning loses at most this many samples
SAMPLES_PER_FLUSH: Final = 60

_SCHEMA_OF_TOPIC: Final[Mapping[str, type[Message]]] = {
    topics.TRANSFORMS: FrameTransform,
    topics.DEPUTY_POSE: PoseInFrame,
    topics.CHIEF_POINTS: PointCloud,
    topics.DEPUTY_STATE: DeputyState,
    topics.DEPUTY_ATTITUDE: AttitudeHistory,
    topics.DEPUTY_CONTROL: Control,
    topics.GUIDANCE: Guidance,
    topics.MISSION: MissionStatus,
    topics.LOG: Log,
}
_ORIGIN: Final = [0.0, 0.0, 0.0]
_UPRIGHT: Final = [0.0, 0.0, 0.0, 1.0]
_MEDIA_TYPES: Final = {".yaml": "application/yaml", ".yml": "application/yaml", ".json": "application/json"}


class EpisodeWriter:
    """A context manager that records an episode, message by message, in the order of time.

    While it is open the file is called ``<path>.partial``; on a clean end it is brought safely to disk and
    renamed. If the block ends in an exception, or the process is killed, the partial file stays: every
    flushed step of it is readable after ``python -m telemetry recover``.

    Parameters
    ----------
    path : Path or str
        The file to make; one of the same name is replaced when the new one is complete.
    metadata : mapping of str to mapping of str to str
        `episode` and one ``fis.<name>`` for each fuzzy system; `telemetry.file.metadata` spells them.
    attachments : mapping of str to bytes
        Whole files to carry along, by name.

    Raises
    ------
    RecordingError
        On a full or read-only disk, on records out of the order of time or of a wrong length, and on a fuzzy
        system that the metadata does not describe.
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
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._time_ns = -1
        self._unflushed_samples = 0

    def __enter__(self) -> Self:
        try:
            self._file = PartialFile(self.path)
        except OSError as error:
            raise self._explained(error) from error
        self._mcap = Writer(self._file.stream, compression=CompressionType.ZSTD)
        try:
            self._write_preamble()
        except OSError as error:
            self._file.abandon()
            raise self._explained(error) from error
        self._register_channels()
        self._transform(0.0, topics.VIEWER_ROOT_FRAME, topics.HILL_FRAME, _ORIGIN, _UPRIGHT)
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if exception_type is not None:
            # the first error is the one to report; what can still be saved is saved
            with suppress(OSError):
                self._mcap.flush()  # type: ignore[no-untyped-call]
            self._file.abandon()
            return
        try:
            self._mcap.finish()  # type: ignore[no-untyped-call]
            self._file.commit()
        except OSError as error:
            self._file.abandon()
            raise self._explained(error) from error

    def poses(
        self,
        time_s: float,
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
        position = row(position_m, 3, "position_m")
        deputy = row(quaternion_b_from_h, 4, "quaternion_b_from_h")
        chief = row(quaternion_c_from_h, 4, "quaternion_c_from_h")
        self._transform(time_s, topics.HILL_FRAME, topics.DEPUTY_FRAME, position, deputy)
        self._transform(time_s, topics.HILL_FRAME, topics.CHIEF_FRAME, _ORIGIN, chief)
        self._write(topics.DEPUTY_POSE, time_s, messages.pose_in_hill(_nanoseconds(time_s), position, deputy))

    def points(self, time_s: float, points_m: ArrayLike, states: ArrayLike) -> None:
        """Record the inspection points and their states.

        Parameters
        ----------
        time_s : float
            Simulation time.
        points_m : (P, 3)
            In point order, chief axes.
        states : (P,) int
            A `telemetry.file.topics.PointState` for each point.
        """
        self._write(topics.CHIEF_POINTS, time_s, messages.point_cloud(_nanoseconds(time_s), points_m, states))

    def deputy_state(
        self,
        time_s: float,
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
        message = DeputyState(
            position_m=row(position_m, 3, "position_m"),
            velocity_m_s=row(velocity_m_s, 3, "velocity_m_s"),
            quaternion=row(quaternion, 4, "quaternion"),
            angular_velocity_rad_s=row(angular_velocity_rad_s, 3, "angular_velocity_rad_s"),
        )
        self._write(topics.DEPUTY_STATE, time_s, message)

    def attitude_history(
        self,
        time_s: float,
        time_offset_s: ArrayLike,
        quaternion: ArrayLike,
        angular_velocity_rad_s: ArrayLike,
        torque_n_m: ArrayLike,
    ) -> None:
        """Record the attitude clock inside the control period that follows a sample.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        time_offset_s : (S,)
            Of each attitude instant after the sample.
        quaternion : (S, 4)
            Hill to body, scalar last.
        angular_velocity_rad_s : (S, 3)
            Relative to Hill, body axes.
        torque_n_m : (S, 3)
            As applied from each instant on, body axes.
        """
        offsets = np.asarray(time_offset_s, dtype=np.float64).ravel().tolist()
        message = AttitudeHistory(
            time_offset_s=offsets,
            quaternion=row(quaternion, 4 * len(offsets), "quaternion"),
            angular_velocity_rad_s=row(angular_velocity_rad_s, 3 * len(offsets), "angular_velocity_rad_s"),
            torque_n_m=row(torque_n_m, 3 * len(offsets), "torque_n_m"),
        )
        self._write(topics.DEPUTY_ATTITUDE, time_s, message)

    def control(self, time_s: float, force_body_n: ArrayLike, force_hill_n: ArrayLike) -> None:
        """Record the force over the control period that follows a sample.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        force_body_n : (3,)
            As the controller asked for it, before the clip, body axes.
        force_hill_n : (3,)
            As applied, Hill axes.
        """
        message = Control(
            force_body_n=row(force_body_n, 3, "force_body_n"),
            force_hill_n=row(force_hill_n, 3, "force_hill_n"),
        )
        self._write(topics.DEPUTY_CONTROL, time_s, message)

    def guidance(
        self,
        time_s: float,
        num_candidates: int,
        target_direction: ArrayLike,
        lambda_u_rad: float,
        eta_u_rad: float,
    ) -> None:
        """Record where the deputy is asked to look next.

        Parameters
        ----------
        time_s : float
            Simulation time.
        num_candidates : int
            Points lit and not yet inspected.
        target_direction : (3,)
            Unit vector, Hill axes; zeros without candidates.
        lambda_u_rad, eta_u_rad : float
            The relative angles of target and deputy.
        """
        message = Guidance(
            num_candidates=int(num_candidates),
            target_direction=row(target_direction, 3, "target_direction"),
            lambda_u_rad=lambda_u_rad,
            eta_u_rad=eta_u_rad,
        )
        self._write(topics.GUIDANCE, time_s, message)

    def fis(
        self, time_s: float, name: str, inputs: ArrayLike, firing_strengths: ArrayLike, output_n: float
    ) -> None:
        """Record one inference of the fuzzy system called `name`.

        Parameters
        ----------
        time_s : float
            Simulation time.
        name : str
            As in the metadata ``fis.<name>``.
        inputs : (I,)
            In the system's order, before they are clipped to their ranges.
        firing_strengths : (R,)
            In rule order.
        output_n : float
            The defuzzified output.
        """
        message = FisActivation(
            inputs=np.asarray(inputs, dtype=np.float64).ravel().tolist(),
            firing_strengths=np.asarray(firing_strengths, dtype=np.float64).ravel().tolist(),
            output_n=output_n,
        )
        self._write(topics.fis_topic(name), time_s, message)

    def mission(
        self,
        time_s: float,
        *,
        sun_angle_rad: float,
        distance_m: float,
        inspected_mask: ArrayLike,
        delta_v_m_s: float,
    ) -> None:
        """Record the progress of the inspection; the count and the rate follow from the mask.

        Parameters
        ----------
        time_s : float
            Simulation time.
        sun_angle_rad : float
            Of the Sun from the i axis towards the j axis, Hill.
        distance_m : float
            Between the centres of deputy and chief.
        inspected_mask : (P,) bool
            In point order, this sample included.
        delta_v_m_s : float
            Spent by the forces before this sample.
        """
        mask = np.asarray(inspected_mask, dtype=np.bool_).ravel()
        inspected_count = int(mask.sum())
        message = MissionStatus(
            sun_angle_rad=sun_angle_rad,
            distance_m=distance_m,
            inspected_count=inspected_count,
            inspection_rate_percent=100.0 * inspected_count / max(mask.size, 1),
            delta_v_m_s=delta_v_m_s,
            inspected_mask=mask.tobytes(),
        )
        self._write(topics.MISSION, time_s, message)

    def log(self, time_s: float, level: str, text: str) -> None:
        """Record an event in words, and flush everything so far to the file.

        Parameters
        ----------
        time_s : float
            Simulation time.
        level : str
            ``debug``, ``info``, ``warning`` or ``error``.
        text : str
            One sentence.
        """
        self._write(topics.LOG, time_s, messages.log(_nanoseconds(time_s), level, text))
        self._flush()

    def _write_preamble(self) -> None:
        self._mcap.start(profile="", library="fuzzy-spacecraft-inspection telemetry")
        for name, entries in self._metadata.items():
            self._mcap.add_metadata(name, sealed(name, entries))
        for name, content in self._attachments.items():
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            self._mcap.add_attachment(0, 0, name, media_type, content)
        # whoever looks at the file now finds out what it is
        self._mcap.flush()  # type: ignore[no-untyped-call]

    def _register_channels(self) -> None:
        prefix = topics.FIS_METADATA_PREFIX
        systems = [name.removeprefix(prefix) for name in self._metadata if name.startswith(prefix)]
        schema_of_topic = {
            **_SCHEMA_OF_TOPIC,
            **{topics.fis_topic(name): FisActivation for name in systems},
        }
        schema_ids: dict[type[Message], int] = {}
        for topic, schema in schema_of_topic.items():
            if schema not in schema_ids:
                schema_ids[schema] = register_schema(self._mcap, schema)
            self._channels[topic] = self._mcap.register_channel(topic, "protobuf", schema_ids[schema])
            self._sequence[topic] = 0

    def _transform(
        self, time_s: float, parent: str, child: str, translation_m: list[float], quaternion: list[float]
    ) -> None:
        message = messages.transform(_nanoseconds(time_s), parent, child, translation_m, quaternion)
        self._write(topics.TRANSFORMS, time_s, message)

    def _write(self, topic: str, time_s: float, message: Message) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            name = topic.removeprefix(topics.FIS_PREFIX)
            raise RecordingError(
                f"the metadata does not describe the fuzzy system {name!r}; "
                f"give the writer an entry {topics.FIS_METADATA_PREFIX + name!r}"
            )
        time_ns = _nanoseconds(time_s)
        if time_ns != self._time_ns:
            self._begin_sample(time_ns)
        sequence = self._sequence[topic]
        self._sequence[topic] = sequence + 1
        try:
            self._mcap.add_message(channel, time_ns, message.SerializeToString(), time_ns, sequence)
        except OSError as error:
            raise self._explained(error) from error

    def _begin_sample(self, time_ns: int) -> None:
        if time_ns < self._time_ns:
            raise RecordingError(
                f"a record of {time_ns / NANOSECONDS} s follows one of {self._time_ns / NANOSECONDS} s, but "
                "a recording goes forward in time; write the records of a sample together"
            )
        if self._unflushed_samples == SAMPLES_PER_FLUSH:
            self._flush()
        self._time_ns = time_ns
        self._unflushed_samples += 1

    def _flush(self) -> None:
        try:
            self._mcap.flush()  # type: ignore[no-untyped-call]
        except OSError as error:
            raise self._explained(error) from error
        self._unflushed_samples = 0

    def _explained(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"the recording {self.path} cannot be written: {error.strerror or error}; it needs an existing "
            "folder that may be written to, with about 1 MiB free: make room or choose another one (steps "
            f"already written are in {self.path.name}{PARTIAL_SUFFIX}, for `python -m telemetry recover`)"
        )


def _nanoseconds(time_s: float) -> int:
    return round(time_s * NANOSECONDS)
