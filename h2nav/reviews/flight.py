"""One flight with everything for its review: recording, service output, findings."""

from typing import NamedTuple

from h2nav.integrity.findings import Finding
from h2nav.recordings.context import Array, Context, Span


class Estimates(NamedTuple):
    """Our attitude over the flight, on the clock of `Context`; NaN where unknown.

    Attributes:
        t_s: (N,) arrival of their samples.
        q_nb: (N, 4) body to NED.
        bias_b: (N, 3) of the gyro, rad/s.
        sigma_tilt_rad: (N,) predicted deviation of the vertical.
        sigma_heading_rad: (N,) of the heading.
    """

    t_s: Array
    q_nb: Array
    bias_b: Array
    sigma_tilt_rad: Array
    sigma_heading_rad: Array


class Ratios(NamedTuple):
    """Test ratios of the lane that was sent, once a second; a test fails above 1.

    Attributes:
        t_s: (N,).
        names: of the columns, as in `h2nav.integrity.ratios.InnovationRatios`.
        values: (N, k) NaN without a test.
    """

    t_s: Array
    names: tuple[str, ...]
    values: Array


class EarthFields(NamedTuple):
    """The earth's field at the vehicle by the World Magnetic Model.

    Attributes:
        t_s: (N,) time of each evaluation, valid until the next one.
        norm_ut: (N,) strength.
        dip_rad: (N,) inclination, positive down.
        declination_rad: (N,) positive east.
    """

    t_s: Array
    norm_ut: Array
    dip_rad: Array
    declination_rad: Array


class Flight(NamedTuple):
    """The input of the analysis and of the page.

    Attributes:
        name: for titles and file names: the recording's name without folder and suffix.
        file: the recording's name with its suffix.
        kind: ``tlog``, ``bytes``, ``mcap``, ``dataflash`` or ``ulog``.
        autopilot: bound autopilot, for people; empty without one.
        context: of the recording.
        estimates: ours, causal; None if the recording does not suffice.
        smoothed: ours from past and future; None without.
        why_no_estimate: the reason in words; empty if there is one.
        imu_message: the message or log with the samples that were sent.
        ratios: of the tests in flight.
        earth: the field model.
        states: the service's states, in order; the name is ``state`` or ``state: reason``.
        lanes: the IMU that was sent, in order.
        notices: of the service: seconds, name of the severity, text.
        findings: of the checks in flight.
        rejected: reason of rejection -> count.
        held: aids of our attitude: spans of each name, in order.
    """

    name: str
    file: str
    kind: str
    autopilot: str
    context: Context
    estimates: Estimates | None
    smoothed: Estimates | None
    why_no_estimate: str
    imu_message: str
    ratios: Ratios
    earth: EarthFields
    states: tuple[Span, ...]
    lanes: tuple[Span, ...]
    notices: tuple[tuple[float, str, str], ...]
    findings: tuple[Finding, ...]
    rejected: dict[str, int]
    held: tuple[Span, ...] = ()
