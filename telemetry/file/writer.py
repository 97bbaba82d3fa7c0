"""Writes an episode to an MCAP file, which gets its final name only when it is complete."""

from collections.abc import Mapping, Sequence
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
    Navigation,
)

#: a process that is killed loses at most this many samples
SAMPLES_PER_FLUSH: Final = 60

_SCHEMA_OF_TOPIC: Final[Mapping[str, type[Message]]] = {
    topics.TRANSFORMS: FrameTransform,
    topics.DEPUTY_POSE: PoseInFrame,
    topics.CHIEF_POINTS: PointCloud,
    topics.DEPUTY_STATE: DeputyState,
    topics.DEPUTY_ATTITUDE: AttitudeHistory,
    topics.DEPUTY_CONTROL: Control,
    topics.GUIDANCE: Guidance,
    topics.NAVIGATION: Navigation,
    topics.MISSION: MissionStatus,
    topics.LOG: Log,
}
_ORIGIN: Final = [0.0, 0.0, 0.0]
_UPRIGHT: Final = [0.0, 0.0, 0.0, 1.0]
_MEDIA_TYPES: Final = {".yaml": "application/yaml", ".yml": "application/yaml", ".json": "application/json"}


class EpisodeWriter:
    """Context manager that records an episode, message by message, in order of time.

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
            # report the first error, but save what can be saved
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
        """Record the attitude history within the control period that follows a sample.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        time_offset_s : (S,)
            Time of each attitude step after the sample.
        quaternion : (S, 4)
            Hill to body, scalar last.
        angular_velocity_rad_s : (S, 3)
            Relative to Hill, body axes.
        torque_n_m : (S, 3)
            Applied from each step on, body axes.
        """
        offsets = np.asarray(time_offset_s, dtype=np.float64).ravel().tolist()
        message = AttitudeHistory(
            time_offset_s=offsets,
            quaternion=row(quaternion, 4 * len(offsets), "quaternion"),
            angular_velocity_rad_s=row(angular_velocity_rad_s, 3 * len(offsets), "angular_velocity_rad_s"),
            torque_n_m=row(torque_n_m, 3 * len(offsets), "torque_n_m"),
        )
        self._write(topics.DEPUTY_ATTITUDE, time_s, message)

    def control(
        self,
        time_s: float,
        force_body_n: ArrayLike,
        force_hill_n: ArrayLike,
        force_asked_n: ArrayLike,
        reason: Sequence[topics.Reason],
        foreseen: ArrayLike | None = None,
    ) -> None:
        """Record the force during the control period that follows a sample.

        Parameters
        ----------
        time_s : float
            Simulation time of the sample.
        force_body_n : (3,)
            Demanded by the controller, before clipping, body axes.
        force_hill_n : (3,)
            Applied, Hill axes.
        force_asked_n : (3,)
            Before dead bands, clip and safety layer, in the controller's axes.
        reason : sequence of telemetry.file.topics.Reason, length 3
            Why each of these components was, or was not, fired.
        foreseen : (3,), optional
            Points that coasting to the end would miss, least and greatest distance on the way, m.
        """
        message = Control(
            force_body_n=row(force_body_n, 3, "force_body_n"),
            force_hill_n=row(force_hill_n, 3, "force_hill_n"),
            force_asked_n=row(force_asked_n, 3, "force_asked_n"),
            reason=[topics.Reason(int(one)).name for one in row(reason, 3, "reason")],
        )
        if foreseen is not None:
            missed, nearest, farthest = row(foreseen, 3, "foreseen")
            message.coasting_missed = missed
            message.coasting_nearest_m = nearest
            message.coasting_farthest_m = farthest
        self._write(topics.DEPUTY_CONTROL, time_s, message)

    def guidance(
        self,
        time_s: float,
        num_candidates: int,
        target_direction: ArrayLike,
        lambda_u_rad: float,
        eta_u_rad: float,
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
        message = Guidance(
            num_candidates=int(num_candidates),
            target_direction=row(target_direction, 3, "target_direction"),
            lambda_u_rad=lambda_u_rad,
            eta_u_rad=eta_u_rad,
        )
        self._write(topics.GUIDANCE, time_s, message)

    def navigation(
        self,
        time_s: float,
        estimate: ArrayLike,
        deviation: ArrayLike,
        fix_m: ArrayLike,
        fix_age_s: float,
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
        known, doubt = row(estimate, 6, "estimate"), row(deviation, 6, "deviation")
        message = Navigation(
            position_m=known[:3],
            velocity_m_s=known[3:],
            position_deviation_m=doubt[:3],
            velocity_deviation_m_s=doubt[3:],
            fix_m=row(fix_m, 3, "fix_m"),
            fix_age_s=fix_age_s,
            quaternion=row(quaternion, 4, "quaternion"),
        )
        self._write(topics.NAVIGATION, time_s, message)

    def fis(
        self,
        time_s: float,
        name: str,
        inputs: ArrayLike,
        firing_strengths: ArrayLike,
        output_n: float,
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
        message = FisActivation(
            inputs=np.asarray(inputs, dtype=np.float64).ravel().tolist(),
            firing_strengths=np.asarray(firing_strengths, dtype=np.float64).ravel().tolist(),
            output_n=output_n,
            shares_n=np.asarray(shares, dtype=np.float64).ravel().tolist(),
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
        sun_elevation_rad: float = 0.0,
        sun_hidden_share: float = 0.0,
        inspectable_count: int = 0,
        mass_kg: float = 0.0,
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
        mask = np.asarray(inspected_mask, dtype=np.bool_).ravel()
        inspected_count = int(mask.sum())
        message = MissionStatus(
            sun_angle_rad=sun_angle_rad,
            distance_m=distance_m,
            inspected_count=inspected_count,
            inspection_rate_percent=100.0 * inspected_count / max(mask.size, 1),
            delta_v_m_s=delta_v_m_s,
            inspected_mask=mask.tobytes(),
            sun_elevation_rad=sun_elevation_rad,
            sun_hidden_share=sun_hidden_share,
            inspectable_count=inspectable_count,
            mass_kg=mass_kg,
        )
        self._write(topics.MISSION, time_s, message)

    def log(self, time_s: float, level: str, text: str) -> None:
        """Record an event as text, and flush everything to the file.

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
        # the description is readable from the start
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
                f"add an entry {topics.FIS_METADATA_PREFIX + name!r}"
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
                "recordings are in order of time; write the records of a sample together"
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
            f"the recording {self.path} cannot be written: {error.strerror or error}; it needs an existing, "
            "writable folder with about 1 MiB free: make room or choose another one (`python -m telemetry "
            f"recover` reads the steps that are already in {self.path.name}{PARTIAL_SUFFIX})"
        )


def _nanoseconds(time_s: float) -> int:
    return round(time_s * NANOSECONDS)
