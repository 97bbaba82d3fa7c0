from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DeputyState(_message.Message):
    __slots__ = ("position_m", "velocity_m_s", "quaternion", "angular_velocity_rad_s")
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_VELOCITY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    position_m: _containers.RepeatedScalarFieldContainer[float]
    velocity_m_s: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    angular_velocity_rad_s: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, position_m: _Optional[_Iterable[float]] = ..., velocity_m_s: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., angular_velocity_rad_s: _Optional[_Iterable[float]] = ...) -> None: ...

class AttitudeHistory(_message.Message):
    __slots__ = ("time_offset_s", "quaternion", "angular_velocity_rad_s", "torque_n_m")
    TIME_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_VELOCITY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    TORQUE_N_M_FIELD_NUMBER: _ClassVar[int]
    time_offset_s: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    angular_velocity_rad_s: _containers.RepeatedScalarFieldContainer[float]
    torque_n_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, time_offset_s: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., angular_velocity_rad_s: _Optional[_Iterable[float]] = ..., torque_n_m: _Optional[_Iterable[float]] = ...) -> None: ...

class Control(_message.Message):
    __slots__ = ("force_body_n", "force_hill_n", "force_asked_n", "reason", "coasting_missed", "coasting_nearest_m", "coasting_farthest_m", "force_commanded_n", "command_reason", "command_age_s")
    class Reason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        UNKNOWN: _ClassVar[Control.Reason]
        FIRED: _ClassVar[Control.Reason]
        SILENT: _ClassVar[Control.Reason]
        DEAD_BAND: _ClassVar[Control.Reason]
        WAITING: _ClassVar[Control.Reason]
        COASTING: _ClassVar[Control.Reason]
        COMPLETE: _ClassVar[Control.Reason]
        CLIPPED: _ClassVar[Control.Reason]
        SAFETY: _ClassVar[Control.Reason]
        REHEARSED: _ClassVar[Control.Reason]
        BELOW_LEAST_IMPULSE: _ClassVar[Control.Reason]
        DELAYED: _ClassVar[Control.Reason]
        EMPTY_TANK: _ClassVar[Control.Reason]
        PARKED: _ClassVar[Control.Reason]
    UNKNOWN: Control.Reason
    FIRED: Control.Reason
    SILENT: Control.Reason
    DEAD_BAND: Control.Reason
    WAITING: Control.Reason
    COASTING: Control.Reason
    COMPLETE: Control.Reason
    CLIPPED: Control.Reason
    SAFETY: Control.Reason
    REHEARSED: Control.Reason
    BELOW_LEAST_IMPULSE: Control.Reason
    DELAYED: Control.Reason
    EMPTY_TANK: Control.Reason
    PARKED: Control.Reason
    FORCE_BODY_N_FIELD_NUMBER: _ClassVar[int]
    FORCE_HILL_N_FIELD_NUMBER: _ClassVar[int]
    FORCE_ASKED_N_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    COASTING_MISSED_FIELD_NUMBER: _ClassVar[int]
    COASTING_NEAREST_M_FIELD_NUMBER: _ClassVar[int]
    COASTING_FARTHEST_M_FIELD_NUMBER: _ClassVar[int]
    FORCE_COMMANDED_N_FIELD_NUMBER: _ClassVar[int]
    COMMAND_REASON_FIELD_NUMBER: _ClassVar[int]
    COMMAND_AGE_S_FIELD_NUMBER: _ClassVar[int]
    force_body_n: _containers.RepeatedScalarFieldContainer[float]
    force_hill_n: _containers.RepeatedScalarFieldContainer[float]
    force_asked_n: _containers.RepeatedScalarFieldContainer[float]
    reason: _containers.RepeatedScalarFieldContainer[Control.Reason]
    coasting_missed: float
    coasting_nearest_m: float
    coasting_farthest_m: float
    force_commanded_n: _containers.RepeatedScalarFieldContainer[float]
    command_reason: _containers.RepeatedScalarFieldContainer[Control.Reason]
    command_age_s: float
    def __init__(self, force_body_n: _Optional[_Iterable[float]] = ..., force_hill_n: _Optional[_Iterable[float]] = ..., force_asked_n: _Optional[_Iterable[float]] = ..., reason: _Optional[_Iterable[_Union[Control.Reason, str]]] = ..., coasting_missed: _Optional[float] = ..., coasting_nearest_m: _Optional[float] = ..., coasting_farthest_m: _Optional[float] = ..., force_commanded_n: _Optional[_Iterable[float]] = ..., command_reason: _Optional[_Iterable[_Union[Control.Reason, str]]] = ..., command_age_s: _Optional[float] = ...) -> None: ...

class Navigation(_message.Message):
    __slots__ = ("position_m", "velocity_m_s", "position_deviation_m", "velocity_deviation_m_s", "fix_m", "fix_age_s", "quaternion", "innovation_m", "innovation_square")
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    POSITION_DEVIATION_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_DEVIATION_M_S_FIELD_NUMBER: _ClassVar[int]
    FIX_M_FIELD_NUMBER: _ClassVar[int]
    FIX_AGE_S_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_M_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_SQUARE_FIELD_NUMBER: _ClassVar[int]
    position_m: _containers.RepeatedScalarFieldContainer[float]
    velocity_m_s: _containers.RepeatedScalarFieldContainer[float]
    position_deviation_m: _containers.RepeatedScalarFieldContainer[float]
    velocity_deviation_m_s: _containers.RepeatedScalarFieldContainer[float]
    fix_m: _containers.RepeatedScalarFieldContainer[float]
    fix_age_s: float
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    innovation_m: _containers.RepeatedScalarFieldContainer[float]
    innovation_square: float
    def __init__(self, position_m: _Optional[_Iterable[float]] = ..., velocity_m_s: _Optional[_Iterable[float]] = ..., position_deviation_m: _Optional[_Iterable[float]] = ..., velocity_deviation_m_s: _Optional[_Iterable[float]] = ..., fix_m: _Optional[_Iterable[float]] = ..., fix_age_s: _Optional[float] = ..., quaternion: _Optional[_Iterable[float]] = ..., innovation_m: _Optional[_Iterable[float]] = ..., innovation_square: _Optional[float] = ...) -> None: ...

class Guidance(_message.Message):
    __slots__ = ("num_candidates", "target_direction", "lambda_u_rad", "eta_u_rad")
    NUM_CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    TARGET_DIRECTION_FIELD_NUMBER: _ClassVar[int]
    LAMBDA_U_RAD_FIELD_NUMBER: _ClassVar[int]
    ETA_U_RAD_FIELD_NUMBER: _ClassVar[int]
    num_candidates: int
    target_direction: _containers.RepeatedScalarFieldContainer[float]
    lambda_u_rad: float
    eta_u_rad: float
    def __init__(self, num_candidates: _Optional[int] = ..., target_direction: _Optional[_Iterable[float]] = ..., lambda_u_rad: _Optional[float] = ..., eta_u_rad: _Optional[float] = ...) -> None: ...

class FisActivation(_message.Message):
    __slots__ = ("inputs", "firing_strengths", "output_n", "shares_single_n", "shares_n")
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    FIRING_STRENGTHS_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_N_FIELD_NUMBER: _ClassVar[int]
    SHARES_SINGLE_N_FIELD_NUMBER: _ClassVar[int]
    SHARES_N_FIELD_NUMBER: _ClassVar[int]
    inputs: _containers.RepeatedScalarFieldContainer[float]
    firing_strengths: _containers.RepeatedScalarFieldContainer[float]
    output_n: float
    shares_single_n: _containers.RepeatedScalarFieldContainer[float]
    shares_n: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, inputs: _Optional[_Iterable[float]] = ..., firing_strengths: _Optional[_Iterable[float]] = ..., output_n: _Optional[float] = ..., shares_single_n: _Optional[_Iterable[float]] = ..., shares_n: _Optional[_Iterable[float]] = ...) -> None: ...

class MissionStatus(_message.Message):
    __slots__ = ("sun_angle_rad", "distance_m", "inspected_count", "inspection_rate_percent", "delta_v_m_s", "inspected_mask", "sun_elevation_rad", "sun_hidden_share", "inspectable_count", "mass_kg")
    SUN_ANGLE_RAD_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    INSPECTED_COUNT_FIELD_NUMBER: _ClassVar[int]
    INSPECTION_RATE_PERCENT_FIELD_NUMBER: _ClassVar[int]
    DELTA_V_M_S_FIELD_NUMBER: _ClassVar[int]
    INSPECTED_MASK_FIELD_NUMBER: _ClassVar[int]
    SUN_ELEVATION_RAD_FIELD_NUMBER: _ClassVar[int]
    SUN_HIDDEN_SHARE_FIELD_NUMBER: _ClassVar[int]
    INSPECTABLE_COUNT_FIELD_NUMBER: _ClassVar[int]
    MASS_KG_FIELD_NUMBER: _ClassVar[int]
    sun_angle_rad: float
    distance_m: float
    inspected_count: int
    inspection_rate_percent: float
    delta_v_m_s: float
    inspected_mask: bytes
    sun_elevation_rad: float
    sun_hidden_share: float
    inspectable_count: int
    mass_kg: float
    def __init__(self, sun_angle_rad: _Optional[float] = ..., distance_m: _Optional[float] = ..., inspected_count: _Optional[int] = ..., inspection_rate_percent: _Optional[float] = ..., delta_v_m_s: _Optional[float] = ..., inspected_mask: _Optional[bytes] = ..., sun_elevation_rad: _Optional[float] = ..., sun_hidden_share: _Optional[float] = ..., inspectable_count: _Optional[int] = ..., mass_kg: _Optional[float] = ...) -> None: ...
