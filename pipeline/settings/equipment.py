"""What the deputy sees, knows and acts with: its camera, its navigation and its thrusters."""

from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import types
from pipeline.settings.conditions import Only
from pipeline.settings.groups import Settings


class Sensor(Settings, group="sensor"):
    """The deputy's camera."""

    half_angle_deg: Annotated[types.Positive, Field(le=180), Only("sensor.rectangle_deg=null")] = 15.0
    """Half angle of the field of view, a cone."""
    rectangle_deg: types.Rectangle | None = None
    """Half angles across and up the image, of a rectangular field of view; null: a cone."""
    up: Annotated[types.UnitVector, Only("sensor.rectangle_deg")] = (0.0, 0.0, 1.0)
    """What is up in the image, body axes; only its part perpendicular to the boresight counts."""
    boresight: types.UnitVector = (-1.0, 0.0, 0.0)
    """Where the camera looks, body axes."""
    max_incidence_deg: Annotated[types.Positive, Field(le=90)] = 90.0
    """Greatest angle between a point's normal and the direction to the deputy."""
    max_range_m: types.Positive | None = None
    """Greatest range from which a point is resolved; null: any."""
    min_range_m: types.NotNegative = 0.0
    """Least range from which a point is in focus."""
    min_sun_angle_deg: Annotated[types.NotNegative, Field(le=180)] = 0.0
    """Least angle between boresight and Sun; nearer to it the camera is blind."""

    @property
    def narrowest_deg(self) -> float:
        """Half angle of the greatest cone inside the field of view."""
        return self.half_angle_deg if self.rectangle_deg is None else min(self.rectangle_deg)


class Navigation(Settings, group="navigation"):
    """The deputy's knowledge of its own state: the truth, or a filter's estimate from fixes."""

    mode: Literal["perfect", "fixes"] = "perfect"
    """The truth, or what a Kalman filter makes of fixes."""


class PerfectNavigation(Navigation, mode="perfect"):
    """The truth."""


class FilteredNavigation(Navigation, mode="fixes"):
    """What a Kalman filter makes of fixes."""

    fix_period_s: types.Positive = 10.0
    """Time between two fixes; a multiple of control_period_s."""
    delay_s: types.NotNegative = 0.0
    """Time from a fix to its use; a multiple of control_period_s."""
    bias_m: types.NotNegative = 0.0
    """Standard deviation of a flight's constant error along each axis."""
    outlier_share: types.Share = 0.0
    """Share of fixes that are outliers."""
    outlier_m: types.NotNegative = 20.0
    """Standard deviation of an outlier along each axis."""
    gate_sigma: types.Positive | None = 5.0
    """Standard deviations beyond which a fix is not believed; null: all are."""
    process_noise_m_s2: types.NotNegative | None = None
    """Standard deviation of accelerations unknown to the filter; null: 0.06 of the bound on those that
    Clohessy and Wiltshire's equations neglect, and more with the distance from the chief if thrusters are
    ideal or have a tank."""
    execution_error: Annotated[types.NotNegative, Field(le=1)] = 0.0
    """Standard deviation, a share, of further errors of forces that the filter allows for."""
    initial_position_m: Annotated[types.Positive, Field(le=1e4)] = 1.0
    """Standard deviation of the first estimate of the position, each axis."""
    initial_velocity_m_s: Annotated[types.Positive, Field(le=1e3)] = 0.001
    """Standard deviation of the first estimate of the velocity, each axis."""
    measures: Literal["position", "range_bearing"] = "position"
    """What a fix is: a position, or range and bearing."""
    attitude_bias_deg: Annotated[types.NotNegative, Field(le=30)] = 0.0
    """Standard deviation of the sensed attitude's constant error, each axis."""
    attitude_noise_deg: Annotated[types.NotNegative, Field(le=30)] = 0.0
    """Standard deviation of the sensed attitude, drawn anew, each axis."""


class PositionFixes(FilteredNavigation, measures="position"):
    """Fixes of the place."""

    noise_m: types.Positive = 1.0
    """Standard deviation of a fix along each axis."""


class RangeBearingFixes(FilteredNavigation, measures="range_bearing"):
    """Fixes of range and bearing."""

    range_noise_m: types.Positive = 0.1
    """Standard deviation of a range."""
    bearing_noise_deg: Annotated[types.Positive, Field(le=10)] = 0.1
    """Standard deviation of a bearing along each of two angles."""


class Actuators(Settings, group="actuators"):
    """How the thrusters deviate from their commands."""

    kind: Literal["ideal", "real"] = "ideal"
    """Thrusters that fire as commanded, or with errors."""


class IdealActuators(Actuators, kind="ideal"):
    """Thrusters that fire as commanded."""


class RealActuators(Actuators, kind="real"):
    """Thrusters with errors."""

    delay_s: types.NotNegative = 0.0
    """Time from a command to its force; a multiple of control_period_s."""
    scale_error: Annotated[types.NotNegative, Field(le=1)] = 0.05
    """Standard deviation of the scale along each Hill axis, a share, drawn once per flight."""
    misalignment_deg: Annotated[types.NotNegative, Field(le=90)] = 2.0
    """Standard deviation of the thrust's turn about each Hill axis, drawn once per flight."""
    impulse_step_n_s: types.Step = 0.0
    """Impulses along each axis are multiples of this; 0: any."""
    least_impulse_n_s: types.NotNegative = 0.04
    """Least impulse along an axis in a control period; less is not fired."""
    thrust_arm_m: types.NotNegative = 0.0
    """Standard deviation of where thrust acts, from the centre of mass, along each body axis."""
    specific_impulse_s: types.Positive | None = None
    """Specific impulse with which propellant is used up; null: the mass stays."""
    thrusters: types.Thrusters | None = None
    """A row each: place (m), direction of force, greatest force (N), body axes; null: one an axis."""
    failed_thruster: Annotated[types.Natural | None, Only("actuators.thrusters")] = None
    """Row of `thrusters` that fails, from 0; null: none does."""
    failure_s: Annotated[types.NotNegative, Only("actuators.failed_thruster")] = 0.0
    """Time from which it fires nothing."""
    propellant_kg: Annotated[types.Positive, Only("actuators.specific_impulse_s")] = 1.0
    """Part of the deputy's mass; without any left nothing is fired."""
