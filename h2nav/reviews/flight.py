"""One flight with everything for its review: recording, service output, findings."""

from typing import NamedTuple

from h2nav.airframes.features import FlightRow
from h2nav.integrity.findings import Finding
from h2nav.recordings.context import Array, Context, Span


class Estimates(NamedTuple):
    """Our attitude over the flight, on the clock of `Context`; NaN where unknown."""

    t_s: Array  # (N,) arrival of their samples
    q_nb: Array  # (N, 4) body to NED
    bias_b: Array  # (N, 3) of the gyro, rad/s
    sigma_tilt_rad: Array  # (N,) predicted deviation of the vertical
    sigma_heading_rad: Array  # (N,) of the heading


class Ratios(NamedTuple):
    """Test ratios of the lane that was sent, once a second; a test fails above 1."""

    t_s: Array  # (N,)
    names: tuple[str, ...]  # of the columns, as in `h2nav.integrity.ratios.InnovationRatios`
    values: Array  # (N, k) NaN without a test


class EarthFields(NamedTuple):
    """The earth's field at the vehicle by the World Magnetic Model."""

    t_s: Array  # (N,) time of each evaluation, valid until the next one
    norm_ut: Array  # (N,) strength
    dip_rad: Array  # (N,) inclination, positive down
    declination_rad: Array  # (N,) positive east


class Flight(NamedTuple):
    """The input of the analysis and of the page."""

    name: str  # for titles and file names: the recording's name without folder and suffix
    file: str  # the recording's name with its suffix
    kind: str  # ``tlog``, ``bytes``, ``mcap``, ``dataflash`` or ``ulog``
    autopilot: str  # bound autopilot, for people; empty without one
    context: Context  # of the recording
    estimates: Estimates | None  # ours, causal; None if the recording does not suffice
    smoothed: Estimates | None  # ours from past and future; None without
    why_no_estimate: str  # the reason in words; empty if there is one
    imu_message: str  # the message or log with the samples that were sent
    ratios: Ratios  # of the tests in flight
    earth: EarthFields  # the field model
    # the service's states, in order; the name is ``state`` or ``state: reason``
    states: tuple[Span, ...]
    lanes: tuple[Span, ...]  # the IMU that was sent, in order
    # of the service: seconds, name of the severity, text
    notices: tuple[tuple[float, str, str], ...]
    findings: tuple[Finding, ...]  # of the checks in flight
    rejected: dict[str, int]  # reason of rejection -> count
    held: tuple[Span, ...] = ()  # aids of our attitude: spans of each name, in order
    earlier: tuple[FlightRow, ...] = ()  # what is remembered of earlier flights, of any airframe
