"""The user's settings of the service; keys of the configuration file's sections."""

from dataclasses import dataclass, field
from typing import Annotated

from h2nav.motion.settings import OdometrySettings, TwistObserverSettings
from h2nav.validation import AutoOrWithin, OneOf, Within

RateHz = Annotated[float, Within(0.0, 1000.0)]
SystemId = Annotated[int, Within(0, 255)]
Delay = Annotated[float | str, AutoOrWithin(0.0, 0.2)]
Lanes = Annotated[int | str, OneOf(("auto", 1, 2, 3))]

IMU_MESSAGE_CHOICES = (
    "auto",
    "HIGHRES_IMU",
    "RAW_IMU",
    "SCALED_IMU",
    "SCALED_IMU2",
    "SCALED_IMU3",
)
MIN_WHEEL_RATE_HZ = 20.0
POSE_MESSAGE_CHOICES = ("auto", "ODOMETRY", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP")


@dataclass(frozen=True, slots=True)
class AutopilotSettings:
    """The autopilot and the streams requested from it.

    Attributes:
        system_id: its MAVLink system id; 0 = the first autopilot received.
        component_id: its component id; 0 = the first autopilot received.
        imu_message: the IMU message to use; `auto` = the best one that this autopilot sends.
        imu_rate_hz: requested rate of it.
        compare_rate_hz: requested rate of ATTITUDE, which is compared with ours; AHRS2 is requested
            at half of it. 0 = compare only what comes without a request.
        lanes: number of IMUs, each with a filter of its own; `auto` = as many as the link carries,
            but one where `imu_message` is set. With 1 the autopilot decides what HIGHRES_IMU
            holds.
        request_streams: request streams at all (False on a link where another program does).
        simulation_truth: also request SIMSTATE, so that the log of a simulated vehicle holds the
            truth.
        gyro_delay_s: age of rates and forces at the time stamp of their message; `auto` = by the
            make of autopilot and its low-pass. Attitudes are propagated by it.
        field_delay_s: likewise of the magnetic field.
    """

    system_id: SystemId = 0
    component_id: SystemId = 0
    imu_message: Annotated[str, OneOf(IMU_MESSAGE_CHOICES)] = "auto"
    imu_rate_hz: Annotated[float, Within(5.0, 1000.0)] = 100.0
    compare_rate_hz: Annotated[float, Within(0.0, 10.0)] = 10.0
    lanes: Lanes = "auto"
    request_streams: bool = True
    simulation_truth: bool = False
    gyro_delay_s: Delay = "auto"
    field_delay_s: Delay = "auto"


@dataclass(frozen=True, slots=True)
class OutputSettings:
    """The messages that the daemon sends; a rate of 0 switches a message off.

    Attributes:
        component_id: our own component id; 191 is MAV_COMP_ID_ONBOARD_COMPUTER.
        attitude_rate_hz: ATTITUDE.
        attitude_quaternion_rate_hz: ATTITUDE_QUATERNION.
        attitude_covariance_rate_hz: ATTITUDE_QUATERNION_COV.
        estimator_status_rate_hz: ESTIMATOR_STATUS.
        difference_rate_hz: NAMED_VALUE_FLOAT `h2_tiltdif` and `h2_yaw_dif`, the difference of the
            autopilot's attitude to ours in degrees.
        status_text: send STATUSTEXT on state changes.
        allow_remote_changes: obey PARAM_SET and SET_MESSAGE_INTERVAL for our own outputs.
        arming_opinion: give an opinion on arming: reply to PX4's arm authorization request, and
            send NAMED_VALUE_INT `h2_arm` once a second for the applet on ArduPilot.
    """

    component_id: Annotated[int, Within(1, 255)] = 191
    attitude_rate_hz: RateHz = 50.0
    attitude_quaternion_rate_hz: RateHz = 10.0
    attitude_covariance_rate_hz: RateHz = 0.0
    estimator_status_rate_hz: RateHz = 1.0
    difference_rate_hz: RateHz = 0.0
    status_text: bool = True
    allow_remote_changes: bool = False
    arming_opinion: bool = False


@dataclass(frozen=True, slots=True)
class NorthSettings:
    """The reference of yaw: true or magnetic north.

    Attributes:
        declination: `wmm` = World Magnetic Model at the position that the autopilot reports,
            `fixed` = `declination_deg`, `none` = yaw stays magnetic.
        declination_deg: positive east; used with `fixed`.
    """

    declination: Annotated[str, OneOf(("wmm", "fixed", "none"))] = "wmm"
    declination_deg: Annotated[float, Within(-180.0, 180.0)] = 0.0


@dataclass(frozen=True, slots=True)
class AidingSettings:
    """What the filter may use from the autopilot besides its IMU.

    Attributes:
        gps_velocity: fuse the GPS velocity of GPS_RAW_INT.
        autopilot_velocity: fuse LOCAL_POSITION_NED, the autopilot's own estimate. The result is
            then *not independent* of the autopilot, and every log says so.
        airspeed: use the measured airspeed (AIRSPEED) on a fixed wing.
    """

    gps_velocity: bool = True
    autopilot_velocity: bool = False
    airspeed: bool = True


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Motion estimation besides the attitude; sent as ODOMETRY.

    Attributes:
        estimator: `none`; `twist` = the twist observer (section `twist`) on the poses of a camera
            or motion capture; `wheels` = wheel odometry (section `odometry`) on WHEEL_DISTANCE.
        pose_message: the message with poses; `auto` = the first one received.
        pose_component_id: the component of the vehicle that sends them; 0 = the first received.
        odometry_rate_hz: ODOMETRY; 0 = off.
    """

    estimator: Annotated[str, OneOf(("none", "twist", "wheels"))] = "none"
    pose_message: Annotated[str, OneOf(POSE_MESSAGE_CHOICES)] = "auto"
    pose_component_id: Annotated[int, Within(0, 255)] = 0
    odometry_rate_hz: RateHz = 20.0

    @property
    def wheel_distance_rate_hz(self) -> float:
        """Requested rate of WHEEL_DISTANCE: dead reckoning also needs it without ODOMETRY."""
        return max(MIN_WHEEL_RATE_HZ, self.odometry_rate_hz)


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """All of the service's settings, one field per section of the configuration file."""

    autopilot: AutopilotSettings = field(default_factory=AutopilotSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    north: NorthSettings = field(default_factory=NorthSettings)
    aiding: AidingSettings = field(default_factory=AidingSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    twist: TwistObserverSettings = field(default_factory=TwistObserverSettings)
    odometry: OdometrySettings = field(default_factory=OdometrySettings)
