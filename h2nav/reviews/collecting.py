"""Collects the service's output during a playback for the review."""

from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from h2nav.attitude.batch_driver import Integers
from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.attitude.smoothing import Smoothed
from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.maths.units import DEG
from h2nav.recordings.context import Span
from h2nav.recordings.spans import spans
from h2nav.reviews.certainty import stretches
from h2nav.reviews.flight import EarthFields, Estimates, Ratios
from h2nav.service.records import AidingRecord, HealthRecord, LaneRecord
from h2nav.wire.deframer import Frame
from h2nav.wire.readers import Message

_ROW = 10  # time, attitude 4, bias 3, deviations 2
# Aids of the attitude besides gyro and gravity, which are always used.
HOLDING = {
    "velocity": Trust.VELOCITY_USED,
    "compass": Trust.FIELD_USED,
    "rest": Trust.REST,
}


class EstimateRows:
    """Estimates as rows of plain numbers."""

    def __init__(self) -> None:
        self._rows = array("d")

    def add(self, t_s: float, estimate: AttitudeEstimate) -> None:
        """Stores an estimate of a sample that arrived at this time of the recording."""
        sigmas = (estimate.sigma_tilt_rad, estimate.sigma_heading_rad)
        self._rows.extend((t_s, *estimate.q_nb, *estimate.bias_b, *sigmas))

    def add_all(self, since_start_ns: Integers, found: Smoothed) -> None:
        """Stores attitudes of samples that arrived at these (N,) times of the recording."""
        sigmas = found.sigma_tilt_rad, found.sigma_heading_rad
        rows = np.vstack((since_start_ns * 1e-9, found.q_nb, found.bias_b, *sigmas)).T
        self._rows.frombytes(rows.tobytes())

    def estimates(self) -> Estimates | None:
        """All so far; None without any."""
        if not self._rows:
            return None
        rows = np.array(self._rows).reshape(-1, _ROW)
        return Estimates(rows[:, 0].copy(), rows[:, 1:5], rows[:, 5:8], rows[:, 8], rows[:, 9])


class Collector:
    """Observes a playback; all times are s since its beginning.

    Attributes:
        notices: time, name of the severity, text.
        start_ns: host time of the first arrival.
        end_ns: of the newest arrival.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self) -> None:
        self.notices: list[tuple[float, str, str]] = []
        self.start_ns = self.end_ns = 0
        self._began = False
        self._t_s = array("d")
        self._estimates = EstimateRows()
        self._trust = array("H")
        self._ratios_s = array("d")
        self._ratios: list[InnovationRatios] = []
        self._states: list[tuple[float, str]] = []
        self._lanes: list[tuple[float, int]] = []
        self._fields: list[tuple[float, AidingRecord]] = []

    # --- what the pipeline tells --------------------------------------------------------------

    def arrives(self, t_ns: int) -> None:
        """Sets the host time of an arrival."""
        if not self._began:
            self._began = True
            self.start_ns = t_ns
        self.end_ns = t_ns

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Not called."""

    def message(self, t_ns: int, message: Message) -> None:
        """Ignores events: the context has them."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Stores an estimate."""
        t_s = self._since_start_s(t_ns)
        self._t_s.append(t_s)
        self._trust.append(int(estimate.trust))
        self._estimates.add(t_s, estimate)

    def record(self, t_ns: int, topic: str, record: object) -> None:
        """Stores the records for pictures."""
        t_s = self._since_start_s(t_ns)
        match record:
            case InnovationRatios():
                self._ratios_s.append(t_s)
                self._ratios.append(record)
            case HealthRecord():
                self._states.append((t_s, ": ".join(filter(None, (record.state, record.reason)))))
            case LaneRecord(sent=True):
                self._lanes.append((t_s, record.imu))
            case AidingRecord(kind="field"):
                self._fields.append((t_s, record))

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Stores a notice."""
        self.notices.append((self._since_start_s(t_ns), severity.word, text))

    # --- what is made of it -------------------------------------------------------------------

    @property
    def duration_s(self) -> float:
        """Length of the recording so far."""
        return (self.end_ns - self.start_ns) * 1e-9

    def estimates(self) -> Estimates | None:
        """All so far; None without any."""
        return self._estimates.estimates()

    def ratios(self) -> Ratios:
        """All ratios so far."""
        names = InnovationRatios._fields
        values = np.array(self._ratios, dtype=np.float64).reshape(-1, len(names))
        return Ratios(np.array(self._ratios_s), names, values)

    def earth(self) -> EarthFields:
        """The field model at every place where it was evaluated."""
        rows = [
            (t_s, field.field_norm_ut, field.field_dip_deg, field.declination_deg)
            for t_s, field in self._fields
        ]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 4).T
        return EarthFields(columns[0], columns[1], columns[2] * DEG, columns[3] * DEG)

    def states(self) -> tuple[Span, ...]:
        """The service's states, with their reasons."""
        return _spans(self._states, self.duration_s)

    def held(self) -> tuple[Span, ...]:
        """The aids of the attitude over time."""
        t_s, trust = np.array(self._t_s), np.array(self._trust)
        return tuple(
            span
            for name, flag in HOLDING.items()
            for span in stretches(t_s[trust & int(flag) > 0], name)
        )

    def lanes(self) -> tuple[Span, ...]:
        """The IMU that was sent; empty if there was only one."""
        names = [(t_s, Sensor(SensorKind.IMU, imu).name) for t_s, imu in self._lanes]
        return _spans(names, self.duration_s)

    def sent_s(self) -> dict[int, float]:
        """How long each IMU was sent, by its number from 1; empty if there was only one."""
        ends = [*(t_s for t_s, _ in self._lanes[1:]), self.duration_s]
        found: dict[int, float] = {}
        for (from_s, imu), to_s in zip(self._lanes, ends, strict=False):
            found[imu] = found.get(imu, 0.0) + to_s - from_s
        return found

    def _since_start_s(self, t_ns: int) -> float:
        return (t_ns - self.start_ns) * 1e-9 if self._began else 0.0


def _spans(found: list[tuple[float, str]], end_s: float) -> tuple[Span, ...]:
    return spans([t_s for t_s, _ in found], [name for _, name in found], end_s)


def most_trusted(findings: Sequence[Finding], sent_s: Mapping[int, float]) -> int:
    """Number of the IMU, from 0 in the order of the lanes, with the fewest faults.

    Args:
        sent_s: how long each IMU was sent, by its number from 1; among equals, the one sent longest
            wins.
    """
    if not sent_s:
        return 0
    wrong_s = dict.fromkeys(sent_s, 0.0)
    for each in findings:
        kind, number, _ = each.sensor
        is_serious = kind is SensorKind.IMU and each.severity <= Severity.WARNING
        if is_serious and number is not None and number in wrong_s:
            wrong_s[number] += each.to_s - each.from_s
    return min(sent_s, key=lambda imu: (wrong_s[imu], -sent_s[imu])) - 1
