"""Log records of the service: flat scalars with units in their names."""

import math
from typing import Any, NamedTuple

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.integrity.findings import Finding, Phase
from h2nav.maths import quaternion


class ImuRecord(NamedTuple):
    """One inertial sample as the filter used it, body frame (forward, right, down).

    Attributes:
        t_us: autopilot time of the sample.
        gyro_x_rad_s: angular rate, bias included.
        acc_x_m_s2: specific force; -9.8 on z at rest and level.
        mag_x_ut: magnetic field; empty if the sample has none.
        clipped: a sensor was at the end of its range.
    """

    t_us: int
    gyro_x_rad_s: float
    gyro_y_rad_s: float
    gyro_z_rad_s: float
    acc_x_m_s2: float
    acc_y_m_s2: float
    acc_z_m_s2: float
    mag_x_ut: float | None
    mag_y_ut: float | None
    mag_z_ut: float | None
    clipped: bool


def imu_record(sample: ImuSample) -> ImuRecord:
    """Flattens a sample."""
    mag_x, mag_y, mag_z = sample.m_b_ut or (None, None, None)
    return ImuRecord(sample.t_us, *sample.w_b, *sample.f_b, mag_x, mag_y, mag_z, sample.clipped)


class EstimateRecord(NamedTuple):
    """One attitude estimate; body to NED, true north once the declination is known.

    Attributes:
        t_us: autopilot time of its sample.
        q_w: attitude quaternion, Hamilton, scalar first.
        roll_deg: Euler angles of the z-y-x sequence.
        rate_x_rad_s: angular rate corrected for bias, body frame.
        bias_x_rad_s: gyro bias, body frame.
        innovation_n_rad: rotation between estimate and measurements, NED.
        sigma_tilt_deg: predicted one-sigma tilt error.
        trust: bits of h2nav.attitude.samples.Trust.
        late_ms: lateness beyond the usual on its link, when it was made; the one field that a
            replay does not reproduce.
        sigma_heading_deg: predicted one-sigma heading error; empty if unknown.
    """

    t_us: int
    q_w: float
    q_x: float
    q_y: float
    q_z: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float
    bias_x_rad_s: float
    bias_y_rad_s: float
    bias_z_rad_s: float
    innovation_n_rad: float
    innovation_e_rad: float
    innovation_d_rad: float
    sigma_tilt_deg: float
    trust: int
    late_ms: float = 0.0
    sigma_heading_deg: float = math.nan


def estimate_record(estimate: AttitudeEstimate, late_ns: int = 0) -> EstimateRecord:
    """Flattens an estimate and adds its Euler angles for plots."""
    roll, pitch, yaw = quaternion.to_euler(estimate.q_nb)
    return EstimateRecord(
        estimate.t_us,
        *estimate.q_nb,
        math.degrees(roll),
        math.degrees(pitch),
        math.degrees(yaw),
        *estimate.w_b,
        *estimate.bias_b,
        *estimate.innovation_n,
        math.degrees(estimate.sigma_tilt_rad),
        int(estimate.trust),
        late_ns * 1e-6,
        math.degrees(estimate.sigma_heading_rad),
    )


class ComparisonRecord(NamedTuple):
    """The autopilot's attitude against ours, at the same time.

    Attributes:
        t_us: autopilot time of both.
        source: autopilot (ATTITUDE) or AHRS2.
        tilt_deg: angle between the verticals.
        heading_deg: the autopilot's heading minus ours.
        sigma_tilt_deg: deviation of the difference, both attitudes' together.
        sigma_heading_deg: the same; empty where our heading has no reference.
        tilt_verdict: the tilt that the GPS velocity supports: h2nav, autopilot or undecided.
        heading_verdict: likewise the heading.
    """

    t_us: int
    source: str
    tilt_deg: float
    heading_deg: float
    sigma_tilt_deg: float
    sigma_heading_deg: float
    tilt_verdict: str
    heading_verdict: str


class HealthRecord(NamedTuple):
    """The state of the service, written at each change and once a second.

    Attributes:
        state: no_link, no_autopilot, no_imu, aligning, active or degraded.
        reason: why it is not active; empty if active.
        autopilot: system and component id that the service is bound to, such as 1/1.
        imu_message: the message of the samples.
        imu_rate_hz: rate of that message over the last window.
        samples_used: samples that made an estimate, since start.
        samples_rejected: rejected samples, since start.
        estimates_sent: attitude messages sent, since start.
        armed: armed state in the autopilot's heartbeat.
        independent: False if the estimate contains something of the autopilot's own estimator: its
            velocity, or its bias, already removed from the message in use.
        late_ms: lateness of the newest estimate, beyond the usual on this link.
        autopilot_tilt_deg: angle between the autopilot's vertical and ours; empty without a recent
            comparison.
        autopilot_heading_deg: the autopilot's heading minus ours.
        cause: of the reason: the same while the figures in the reason change.
    """

    state: str
    reason: str
    autopilot: str
    imu_message: str
    imu_rate_hz: float
    samples_used: int
    samples_rejected: int
    estimates_sent: int
    armed: bool
    independent: bool
    late_ms: float = 0.0
    autopilot_tilt_deg: float | None = None
    autopilot_heading_deg: float | None = None
    cause: str = ""

    @property
    def summary(self) -> str:
        """Such as ``active, RAW_IMU 100 Hz``."""
        source = f"{self.imu_message} {self.imu_rate_hz:.0f} Hz" if self.imu_message else ""
        return ", ".join(filter(None, (self.state, self.reason, source)))


class StatusRecord(NamedTuple):
    """The status for displays, a few times a second; not in the log.

    Attributes:
        state: see `HealthRecord`.
        reason: why it is not active; empty if active.
        vehicle: bound autopilot, for people; empty before.
        age_ms: since the arrival of the newest sample used; empty before the first.
        autopilot_q_w: the autopilot's own attitude, body to NED, Hamilton, scalar first; empty if
            stale.
        autopilot_source: autopilot (ATTITUDE) or AHRS2; empty likewise.
        autopilot_age_ms: since that attitude arrived.
        tilt_deg: angle between the autopilot's vertical and ours; empty without a recent
            comparison.
        heading_deg: the autopilot's heading minus ours.
        sigma_tilt_deg: deviation of the difference, both attitudes' together.
        sigma_heading_deg: the same; empty where our heading has no reference.
        tilt_verdict: the tilt that the GPS velocity supports: h2nav, autopilot or undecided.
        heading_verdict: likewise the heading.
        velocity_ratio: innovation test ratio, fails above 1; empty without a measurement.
        force_ratio: the same of the force against a velocity that is merely bounded.
        field_ratio: the same of the magnetic field.
        turn_ratio: the same of the gyro against the magnetic field.
        alarms: present alarms, for people, one per line.
        open_findings: ids of the open findings, separated by spaces.
        preflight: faults before arming, for people, one per line; empty while armed.
    """

    state: str
    reason: str
    vehicle: str
    age_ms: float | None
    autopilot_q_w: float | None
    autopilot_q_x: float | None
    autopilot_q_y: float | None
    autopilot_q_z: float | None
    autopilot_source: str
    autopilot_age_ms: float | None
    tilt_deg: float | None
    heading_deg: float | None
    sigma_tilt_deg: float | None
    sigma_heading_deg: float | None
    tilt_verdict: str
    heading_verdict: str
    velocity_ratio: float
    force_ratio: float
    field_ratio: float
    turn_ratio: float
    alarms: str
    open_findings: str = ""
    preflight: str = ""


class LaneRecord(NamedTuple):
    """One IMU and its filter, written once a second where there are several.

    Attributes:
        imu: number of the IMU, from 1.
        message: of its samples.
        rate_hz: of its samples.
        ratio: of the tests of its gyro and accelerometer; fails above 1, empty = known faulty.
        field_ratio: the same of its compass.
        tilt_apart_deg: between the verticals of its attitude and of the one that is sent.
        heading_apart_deg: its heading minus the one that is sent.
        sent: this attitude is sent.
    """

    imu: int
    message: str
    rate_hz: float
    ratio: float
    field_ratio: float
    tilt_apart_deg: float
    heading_apart_deg: float
    sent: bool


class RejectionRecord(NamedTuple):
    """Number of samples or messages rejected so far, for one reason.

    Attributes:
        reason: such as duplicate, late, non_finite, zero_force, other_sender.
        total: since start.
    """

    reason: str
    total: int


class TimeSyncRecord(NamedTuple):
    """The relation of the autopilot's clock to the host's monotonic clock.

    Attributes:
        offset_us: autopilot time minus host time at `host_us`.
        skew_ppm: how much faster the autopilot's clock runs.
        round_trip_us: of the exchange behind this record.
        host_us: host monotonic time.
    """

    offset_us: float
    skew_ppm: float
    round_trip_us: float
    host_us: int


class AidingRecord(NamedTuple):
    """Changed inputs of the filter besides the samples.

    Attributes:
        kind: velocity, field, vehicle, delays.
        north_m_s: velocity over ground (kind velocity).
        field_norm_ut: expected earth field (kind field).
        on_ground: disarmed or landed (kind vehicle).
        gyro_delay_s: age of rates and forces at the time stamp of their message (kind delays);
            empty if unknown.
        field_delay_s: likewise of the field.
    """

    kind: str
    north_m_s: float | None = None
    east_m_s: float | None = None
    down_m_s: float | None = None
    sigma_m_s: float | None = None
    independent: bool | None = None
    field_norm_ut: float | None = None
    field_dip_deg: float | None = None
    declination_deg: float | None = None
    on_ground: bool | None = None
    airspeed_m_s: float | None = None
    gyro_delay_s: float | None = None
    field_delay_s: float | None = None


FINDING_TOPIC = "/finding"


class FindingRecord(NamedTuple):
    """A finding, written when it begins, changes, is repeated, and ends.

    Attributes:
        id: stable within a run, such as gyro_frozen.imu1.1.
        phase: begin, update or end.
        is_open: it has not ended.
        kind: of the finding; docs/review-findings.md lists them.
        source: of the fault, for people.
        sensor: of the fault: imu, gyro, compass, gps, autopilot, ahrs2 and others.
        sensor_number: from 1; empty if there is only one.
        severity: the worst so far: critical, error, warning, notice or info.
        from_s: its beginning, since the first message of the run.
        to_s: when it last held.
        size: the largest, in the unit of the next field.
        unit: of the size.
        text: for people.
        evidence: the figures that show it.
        cause: id of the finding that it follows from; empty if none.
    """

    id: str
    phase: str
    is_open: bool
    kind: str
    source: str
    sensor: str
    sensor_number: int | None
    severity: str
    from_s: float
    to_s: float
    size: float
    unit: str
    text: str
    evidence: str
    cause: str | None


def finding_record(phase: Phase, finding: Finding) -> FindingRecord:
    """Flattens a finding of the checks in flight."""
    return FindingRecord(
        finding.id,
        phase.value,
        finding.is_open,
        finding.kind.value,
        finding.sensor.name,
        finding.sensor.kind.value,
        finding.sensor.number,
        finding.severity.word,
        finding.from_s,
        finding.to_s,
        finding.size,
        finding.unit,
        finding.text,
        finding.evidence,
        finding.cause,
    )


def finding_mapping(record: FindingRecord) -> dict[str, Any]:
    """The mapping of `findings.as_mapping`, with its phase."""
    values = record._asdict()
    number = values.pop("sensor_number")
    return {**values, "sensor": {"kind": record.sensor, "number": number, "others": []}}
