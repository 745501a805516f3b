"""VIBRATION: the autopilot's measure, from every sample of its accelerometers.

The IMU messages are filtered, so that a sensor whose samples clip shows only a few m/s^2 in them.
The levels are of one accelerometer, and the message does not name it; each accelerometer has its
own counter of clipped samples.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.sensor_checks import VIBRATION_M_S2, vibration_alarm

# How long a report is valid.
FRESH_NS = 3_000_000_000
# A hard landing clips samples in one or two reports. At the usual 2 Hz:
REPORTS = 10
CLIPPING_REPORTS = 3
HIGH_REPORTS = 2


class _Report(NamedTuple):
    t_ns: int
    level_m_s2: float
    clips: tuple[int, ...]  # new ones, by IMU


class ReportedVibration:
    """Tracks the reports of one autopilot."""

    def __init__(self) -> None:
        self._reports: deque[_Report] = deque(maxlen=REPORTS)
        self._counters: tuple[int, ...] = ()
        self._clips: dict[int, int] = {}  # recent ones, by IMU, while they last
        self._is_high = False

    def take(self, t_ns: int, level_m_s2: float, counters: Sequence[int]) -> None:
        """Takes a report.

        Args:
            level_m_s2: the largest of the levels; 0 if they are not accelerations.
            counters: clipped samples of each accelerometer since boot.
        """
        if self._reports and t_ns - self._reports[-1].t_ns > FRESH_NS:
            self._reports.clear()
            self._counters = ()
        before = self._counters or counters
        # A reboot resets them.
        clips = tuple(max(now - then, 0) for now, then in zip(counters, before, strict=True))
        self._counters = tuple(counters)
        self._reports.append(_Report(t_ns, level_m_s2, clips))
        self._clips = {imu: self._lasting_clips(imu) for imu in range(len(self._counters))}
        latest = [report.level_m_s2 for report in self._reports][-HIGH_REPORTS:]
        self._is_high = len(latest) == HIGH_REPORTS and min(latest) > VIBRATION_M_S2

    def _lasting_clips(self, imu: int) -> int:
        found = [report.clips[imu] for report in self._reports if imu < len(report.clips)]
        return sum(found) if sum(count > 0 for count in found) >= CLIPPING_REPORTS else 0

    def clips(self, imu: int, t_ns: int) -> int:
        """Recently clipped samples of an IMU (from 0); 0 unless it lasts."""
        return self._clips.get(imu, 0) if self._is_fresh(t_ns) else 0

    def is_high(self, t_ns: int) -> bool:
        """Whether the vibration is disturbing."""
        return self._is_high and self._is_fresh(t_ns)

    def alarms(self, t_ns: int) -> list[Alarm]:
        """Alarms of excessive levels."""
        counts = {imu: self.clips(imu, t_ns) for imu in range(len(self._counters))}
        found = [_clipped(imu, count) for imu, count in counts.items() if count]
        if self.is_high(t_ns):
            level_m_s2, imu = self._reports[-1].level_m_s2, Sensor(SensorKind.IMU)
            found.append(vibration_alarm(imu, level_m_s2, "by the autopilot"))
        return found

    def _is_fresh(self, t_ns: int) -> bool:
        return bool(self._reports) and t_ns - self._reports[-1].t_ns <= FRESH_NS


def _clipped(imu: int, count: int) -> Alarm:
    text, evidence = f"{count} clipped samples", "by the autopilot, in the latest reports"
    sensor = Sensor(SensorKind.IMU, imu + 1)
    return Alarm(
        Kind.CLIPPED_SAMPLES, sensor, Severity.WARNING, float(count), "", text, evidence
    )  # fmt: skip
