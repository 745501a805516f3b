"""One flight, reviewed: what was recorded, what our service made of it, what was wrong."""

from typing import NamedTuple

from h2nav.integrity.findings import Finding
from h2nav.recordings.context import Array, Context, Span


class Estimates(NamedTuple):
    """Our attitude over the flight, by the clock of `Context`; NaN where something has no figure.

    Attributes:
        t_s: (N,) when the samples came that they were made from.
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
    """Test ratios of the lane that was sent, once a second; 1 = the test fails.

    Attributes:
        t_s: (N,).
        names: of the columns, as in `h2nav.integrity.ratios.InnovationRatios`.
        values: (N, k) NaN where a test had nothing to test.
    """

    t_s: Array
    names: tuple[str, ...]
    values: Array


class EarthFields(NamedTuple):
    """The earth's field by the World Magnetic Model where the vehicle was.

    Attributes:
        t_s: (N,) when each was looked up; it holds until the next one.
        norm_ut: (N,) strength.
        dip_rad: (N,) inclination, positive down.
        declination_rad: (N,) positive east.
    """

    t_s: Array
    norm_ut: Array
    dip_rad: Array
    declination_rad: Array


class Flight(NamedTuple):
    """Everything that the page shows and the findings of a whole flight look at.

    Attributes:
        name: for titles and file names: the recording's name without folder and ending.
        file: the recording's name with its ending.
        kind: ``tlog``, ``bytes``, ``mcap``, ``dataflash`` or ``ulog``.
        autopilot: what the service was bound to, for people; empty when to nothing.
        context: what was recorded.
        estimates: ours, causal; None where the recording has too little for one.
        smoothed: ours from past and future; None without.
        why_no_estimate: in words; empty where there is one.
        imu_message: the message or log that the sent samples come from.
        ratios: of the tests in flight.
        earth: the field model.
        states: the service's states, in order; the name is ``state`` or ``state: reason``.
        lanes: which IMU was sent, in order.
        notices: what the service said: seconds, severity's word, text.
        findings: of the checks in flight.
        rejected: what was refused: reason -> count.
        held: what held our attitude when: spans of each name, in order.
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
