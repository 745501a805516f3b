"""Passes the autopilot's attitude to the witness, and its comparisons to log and outputs."""

import math
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.integrity.witness import AttitudeSource, Comparison, Witness
from h2nav.maths.quaternion import Quat
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Effect, Record
from h2nav.service.limits import RateLimit
from h2nav.service.records import ComparisonRecord
from h2nav.service.requested_stream import WantedStream
from h2nav.wire.attitude import ReportedAttitude

# The largest rate of comparison; faster streams in recordings are thinned.
MAX_PER_S = 10.0
AT_ONCE = 2
MESSAGES = frozenset({mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_AHRS2})
# AHRS2 comes at half the rate of ATTITUDE.
AHRS2_SHARE = 0.5
# An older attitude is stale.
STALE_NS = 2 * SECOND_NS


class LatestReport(NamedTuple):
    """An attitude of the autopilot."""

    t_ns: int  # host time of its arrival
    source: AttitudeSource  # of the attitude
    q_nb: Quat  # body to NED


def wanted_streams(autopilot: int, rate_hz: float) -> tuple[WantedStream, ...]:
    """The streams to request from this make of autopilot (MAV_AUTOPILOT); a rate of 0 = none."""
    if rate_hz == 0.0:
        return ()
    attitude = WantedStream(mavlink.MAVLINK_MSG_ID_ATTITUDE, rate_hz, is_optional=True)
    if autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return (attitude,)
    second = WantedStream(mavlink.MAVLINK_MSG_ID_AHRS2, AHRS2_SHARE * rate_hz, is_optional=True)
    return attitude, second


class Comparing:
    """The witness of the bound autopilot.

    Attributes:
        witness: also takes the velocities; has the alarms.
    """

    def __init__(self) -> None:
        self.witness = Witness()
        self._reports: dict[AttitudeSource, LatestReport] = {}
        self._limits = {message_id: RateLimit(MAX_PER_S, AT_ONCE) for message_id in MESSAGES}

    def on_arrival(self, t_ns: int, message_id: int) -> bool:
        """Counts a message of `MESSAGES`; returns whether it is due for comparison."""
        return self._limits[message_id].allows(t_ns)

    def idle_until_ns(self, message_id: int) -> int:
        """The host time before which no message of this id is due."""
        return self._limits[message_id].next_ns

    def on_sample(self, sample: ImuSample, estimate: AttitudeEstimate | None) -> list[Effect]:
        """Takes our newest estimate, None during an alignment."""
        found = self.witness.add(sample, estimate)
        return _records(found) if found else []

    def latest(self, t_ns: int) -> LatestReport | None:
        """The autopilot's newest attitude, preferably of its main estimator; None if stale."""
        for source in (AttitudeSource.AUTOPILOT, AttitudeSource.AHRS2):
            latest = self._reports.get(source)
            if latest is not None and t_ns - latest.t_ns <= STALE_NS:
                return latest
        return None

    def on_report(
        self, t_ns: int, reported: ReportedAttitude, by_compass_rad: float | None = None
    ) -> list[Effect]:
        """Takes an attitude of the autopilot, and how far our heading may be off by our compass."""
        source = AttitudeSource.AHRS2 if reported.is_second else AttitudeSource.AUTOPILOT
        self._reports[source] = LatestReport(t_ns, source, reported.q_nb)
        return _records(
            self.witness.report(source, reported.time_ms, reported.q_nb, by_compass_rad)
        )


def _records(found: list[Comparison]) -> list[Effect]:
    return [Record("/comparison", _record(comparison), comparison.t_us) for comparison in found]


def _record(found: Comparison) -> ComparisonRecord:
    return ComparisonRecord(
        found.t_us,
        found.source.value,
        math.degrees(found.tilt_rad),
        math.degrees(found.heading_rad),
        math.degrees(found.sigma_tilt_rad),
        math.degrees(found.sigma_heading_rad),
        found.verdicts.tilt.value,
        found.verdicts.heading.value,
    )
