"""Settings of motion estimation: keys of the configuration's motion sections."""

import math
from dataclasses import dataclass
from typing import Annotated

from h2nav.errors import BadInput
from h2nav.maths.se2 import Matrix3
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.wheels import Chassis, CorrectedChassis, DifferentialDrive, OmniDrive
from h2nav.validation import OneOf, Within

Gain = Annotated[float, Within(1e-3, 1e3)]


@dataclass(frozen=True, slots=True)
class TwistObserverSettings:
    """The twist observer; the second exponent is always 2 a1 - 1.

    Attributes:
        k1: correction of the pose, 1/s (for a1 = 1).
        k2: correction of the bias, 1/s^2 (for a1 = 1).
        a1: exponent above 0.5, at most 1; smaller = faster and noisier; 1 = linear observer.
        velocity: where the linear velocity comes from: `integrated` specific force (autopilots),
            or `measured` in the body with a constant bias (wheels, flow, airspeed).
        pose_frame: fixed frame that poses must have; `auto` = that of the first pose.
        pose_delay_ms: delay of the pose source that its time stamps do not show.
        pose_gate_deg: an attitude error above this is a jump of the pose source.
        pose_gate_m: a position error above this is a jump of the pose source.
        jump_poses: so many agreeing poses in a row beyond the gate restart the pose from them.
        pose_hold_ms: a pose corrects for at most so long a time since the one before.
        pose_gap_ms: integrated velocity: a pause of the poses above this starts pose and velocity
            anew from the next two.
        history_ms: how old a pose may be on arrival.
        imu_gap_ms: an IMU pause above this restarts from the next pose.

    Raises:
        BadInput: an exponent or gain outside its range.
    """

    k1: Gain = 3.0
    k2: Gain = 3.0
    a1: Annotated[float, Within(0.5, 1.0)] = 0.85
    velocity: Annotated[str, OneOf(("integrated", "measured"))] = "integrated"
    pose_frame: Annotated[str, OneOf(("auto", "local_frd", "local_ned"))] = "auto"
    pose_delay_ms: Annotated[float, Within(0.0, 1000.0)] = 0.0
    pose_gate_deg: Annotated[float, Within(1.0, 180.0)] = 30.0
    pose_gate_m: Annotated[float, Within(0.01, 1e4)] = 1.0
    jump_poses: Annotated[int, Within(1, 100)] = 5
    pose_hold_ms: Annotated[float, Within(1.0, 1000.0)] = 150.0
    pose_gap_ms: Annotated[float, Within(200.0, 60000.0)] = 2000.0
    history_ms: Annotated[float, Within(10.0, 2000.0)] = 500.0
    imu_gap_ms: Annotated[float, Within(10.0, 5000.0)] = 300.0

    def __post_init__(self) -> None:
        errors = []
        if not 0.5 < self.a1 <= 1.0:
            errors.append(f"a1 = {self.a1}, expected above 0.5 and at most 1")
        for key, gain in (("k1", self.k1), ("k2", self.k2)):
            if not 1e-3 <= gain <= 1e3:
                errors.append(f"{key} = {gain}, expected a number from 0.001 to 1000")
        if errors:
            raise BadInput(*(f"twist observer: {error}" for error in errors))

    @property
    def gains(self) -> FiniteTimeGains:
        """The gains as the correction takes them."""
        return FiniteTimeGains(self.k1, self.k2, self.a1)


UNIT: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
RadiusM = Annotated[float, Within(1e-4, 1e3)]
AngleDeg = Annotated[float, Within(-360.0, 360.0)]
Correction = Annotated[float, Within(-1e3, 1e3)]


@dataclass(frozen=True, slots=True)
class OdometrySettings:
    """The wheels of a ground vehicle; `h2nav odometry calibrate` writes this section.

    Attributes:
        layout: `differential` (wheels left, right) or `omni` (three wheels).
        track_m: differential: distance of the wheels' contact points.
        radius_left_m: differential.
        radius_right_m: differential.
        arm_m: omni: distance of the wheels from the centre.
        angle_1_deg: omni: where wheel 1 stands, counter-clockwise from ahead.
        angle_2_deg: wheel 2.
        angle_3_deg: wheel 3.
        radius_1_m: omni.
        radius_2_m: omni.
        radius_3_m: omni.
        autopilot_radius_m: the radius with which the autopilot makes WHEEL_DISTANCE of the
            wheels' angles. With 1 and radii of 1 its distances are taken as they are.
        ahead_per_ahead: correction of the increments, row (ahead), column (ahead); the other
            eight alike. The unit matrix is no correction.
        slip_wheel_m_rtm: one sigma of each wheel's way after 1 m.
        slip_side_m_rtm: one sigma of the sideways shift after 1 m.
        max_wheel_speed_m_s: a wheel faster than this is a jump of its counter.
    """

    layout: Annotated[str, OneOf(("differential", "omni"))] = "differential"
    track_m: Annotated[float, Within(1e-3, 100.0)] = 0.5
    radius_left_m: RadiusM = 1.0
    radius_right_m: RadiusM = 1.0
    arm_m: Annotated[float, Within(1e-3, 100.0)] = 0.2
    angle_1_deg: AngleDeg = 0.0
    angle_2_deg: AngleDeg = 120.0
    angle_3_deg: AngleDeg = 240.0
    radius_1_m: RadiusM = 1.0
    radius_2_m: RadiusM = 1.0
    radius_3_m: RadiusM = 1.0
    autopilot_radius_m: RadiusM = 1.0
    ahead_per_ahead: Correction = 1.0
    ahead_per_left: Correction = 0.0
    ahead_per_turn: Correction = 0.0
    left_per_ahead: Correction = 0.0
    left_per_left: Correction = 1.0
    left_per_turn: Correction = 0.0
    turn_per_ahead: Correction = 0.0
    turn_per_left: Correction = 0.0
    turn_per_turn: Correction = 1.0
    slip_wheel_m_rtm: Annotated[float, Within(0.0, 1.0)] = 0.005
    slip_side_m_rtm: Annotated[float, Within(0.0, 1.0)] = 0.003
    max_wheel_speed_m_s: Annotated[float, Within(0.01, 100.0)] = 20.0

    @property
    def correction(self) -> Matrix3:
        """The matrix that the body increments are multiplied by."""
        return (
            (self.ahead_per_ahead, self.ahead_per_left, self.ahead_per_turn),
            (self.left_per_ahead, self.left_per_left, self.left_per_turn),
            (self.turn_per_ahead, self.turn_per_left, self.turn_per_turn),
        )

    @property
    def scales(self) -> tuple[float, ...]:
        """Metres rolled per unit of each wheel's reading."""
        radii: tuple[float, ...] = (self.radius_left_m, self.radius_right_m)
        if self.layout == "omni":
            radii = (self.radius_1_m, self.radius_2_m, self.radius_3_m)
        return tuple(radius / self.autopilot_radius_m for radius in radii)

    def chassis(self) -> Chassis:
        """The layout with its (corrected) kinematics.

        Raises:
            BadInput: a singular layout of omni wheels.
        """
        if self.layout == "differential":
            nominal: Chassis = DifferentialDrive(self.track_m)
        else:
            angles = (self.angle_1_deg, self.angle_2_deg, self.angle_3_deg)
            a, b, c = (math.radians(angle) for angle in angles)
            nominal = OmniDrive((a, b, c), self.arm_m)
        if self.correction == UNIT:
            return nominal
        return CorrectedChassis(nominal, self.correction)
