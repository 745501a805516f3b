"""A drawn flight as messages: what a companion computer would receive of it, and its truth."""

import heapq
import math
from collections.abc import Iterable, Iterator
from itertools import repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import EarthField
from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.motion import DrawnMotion, attitude_rows
from h2nav.evaluation.campaign.receiver import DrawnFixes, fixes_of
from h2nav.evaluation.campaign.sensors import DrawnReadings, acts, readings_of
from h2nav.maths.rows import Array, product
from h2nav.maths.units import DEG, EARTH_RADIUS_M, HOUR_S
from h2nav.sim.faults import Fault
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.imu import ImuReading
from h2nav.wire.position import GpsFix, NoFix, Place
from h2nav.wire.readers import Envelope, Message
from h2nav.wire.vehicle import Heartbeat, LandedState, SystemTime

Event = tuple[Envelope, Message]
Times = NDArray[np.int64]

SENDER = (1, 1)
# The autopilot has run for a while, and the companion's clock is another one.
BOOT_US, HOST_NS = 30_000_000, 1_000_000_000_000
UNIX_S = 1_795_000_000.0
# Of the Alps, and south of the equator of Australia: the South Atlantic has half the usual field.
NORTHERN_DEG, SOUTHERN_DEG, ALTITUDE_M = 8.5, 147.0, 450.0
BLOCK = 2048
ATTITUDES_HZ = 5.0
LINK_STREAM = 4  # of a seed's random numbers
# The autopilot's own estimate: errors in roll, pitch and heading that wander.
OWN_ERROR_DEG, OWN_ERROR_S = (0.3, 0.3, 1.0), 60.0
CENTI = 0.01
MAV_TYPES = {
    "copter": mavlink.MAV_TYPE_QUADROTOR,
    "plane": mavlink.MAV_TYPE_FIXED_WING,
    "rover": mavlink.MAV_TYPE_GROUND_ROVER,
}
INTEGER_IDS = (
    mavlink.MAVLINK_MSG_ID_RAW_IMU,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3,
)


class DrawnFlight(NamedTuple):
    """Everything that is known of a flight."""

    draw: Draw
    field: EarthField  # at its place
    motion: DrawnMotion
    imus: tuple[DrawnReadings, ...]
    fixes: DrawnFixes


def simulated(draw: Draw, field: EarthField) -> DrawnFlight:
    """Simulates a draw.

    Args:
        field: of the earth at its latitude; see `place_of`.
    """
    motion = DrawnMotion(draw)
    imus = tuple(readings_of(draw, motion, field, number) for number in range(draw.imu.count))
    return DrawnFlight(draw, field, motion, imus, fixes_of(draw, motion))


def place_of(draw: Draw) -> Place:
    """Where a flight starts."""
    latitude_deg = draw.flight.latitude_deg
    longitude_deg = NORTHERN_DEG if latitude_deg >= 0.0 else SOUTHERN_DEG
    return Place(latitude_deg, longitude_deg, ALTITUDE_M)


def events(flight: DrawnFlight) -> Iterator[Event]:
    """Yields what arrives, in the order of arrival; the link delays and loses."""
    link = _Link(flight.draw)
    streams = [
        _vehicle(flight, link),
        _fixes(flight, link),
        _attitudes(flight, link),
        *(_imu(flight, number, link) for number in range(len(flight.imus))),
    ]
    return heapq.merge(*streams, key=lambda event: event[0].t_ns)


def link_gaps_s(draw: Draw) -> list[tuple[float, float]]:
    """(from, to) of times in which nothing arrives."""
    return _gaps_s(draw, np.random.default_rng([draw.seed, LINK_STREAM]))


def _gaps_s(draw: Draw, random: np.random.Generator) -> list[tuple[float, float]]:
    count = random.poisson(draw.link.gaps_per_h * draw.length_s / HOUR_S)
    starts = random.uniform(min(draw.flight.rest_s, draw.length_s), draw.length_s, count)
    return [(start, start + draw.link.gap_s) for start in starts.tolist()]


class _Link:
    """Arrival times; what is lost.

    Attributes:
        gaps_s: (from, to) of times in which nothing arrives.
    """

    def __init__(self, draw: Draw) -> None:
        self._own, self._random = draw.link, np.random.default_rng([draw.seed, LINK_STREAM])
        self.gaps_s = _gaps_s(draw, self._random)

    def arrivals(self, t_s: Array) -> tuple[Times, NDArray[np.bool_]]:
        """(N,) arrival of messages sent at (N,) times, ns, and which of them arrive."""
        late_s = 1e-3 * self._random.exponential(self._own.latency_ms or 1e-9, len(t_s))
        t_ns = HOST_NS + np.round(1e9 * (t_s + late_s)).astype(np.int64)
        arrives = self._random.random(len(t_s)) >= self._own.loss_share
        for begin_s, end_s in self.gaps_s:
            arrives &= (t_s < begin_s) | (t_s >= end_s)
        return np.maximum.accumulate(t_ns), arrives


def _sent(link: _Link, t_s: Array, message_id: int, messages: Iterable[Message]) -> Iterator[Event]:
    """Messages with their envelopes."""
    arrived_ns, arrives = link.arrivals(t_s)
    for first in range(0, len(t_s), BLOCK):  # so that lists stay short
        part = slice(first, first + BLOCK)
        sent = zip(arrived_ns[part].tolist(), arrives[part].tolist(), messages, strict=False)
        for t_ns, is_there, message in sent:
            if is_there:
                yield Envelope(t_ns, t_ns, SENDER, message_id), message


def _vehicle(flight: DrawnFlight, link: _Link) -> Iterator[Event]:
    """Once a second: heartbeat, landed state, date."""
    t_s = np.arange(0.0, flight.draw.length_s, 1.0)
    kind = MAV_TYPES[flight.draw.flight.vehicle]
    moves = flight.motion.moves(t_s).tolist()
    make = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    yield from heapq.merge(
        _sent(
            link,
            t_s,
            mavlink.MAVLINK_MSG_ID_HEARTBEAT,
            (Heartbeat(make, kind, is_armed) for is_armed in moves),
        ),
        _sent(
            link,
            t_s,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            (LandedState(None if kind == MAV_TYPES["rover"] else not up) for up in moves),
        ),
        _sent(
            link,
            t_s,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
            (SystemTime(UNIX_S + t) for t in t_s.tolist()),
        ),
        key=lambda event: event[0].t_ns,
    )


def _fixes(flight: DrawnFlight, link: _Link) -> Iterator[Event]:
    """GPS_RAW_INT: centimetres a second, no vertical velocity."""
    fixes, start = flight.fixes, place_of(flight.draw)
    parallel_m = EARTH_RADIUS_M * math.cos(start.latitude_deg * DEG)
    stamps_us = BOOT_US + np.round(1e6 * fixes.t_s).astype(np.int64)
    rows = zip(
        fixes.has_fix.tolist(),
        stamps_us.tolist(),
        fixes.p_n.tolist(),
        fixes.v_n.tolist(),
        strict=True,
    )

    def made() -> Iterator[Message]:
        for has_fix, stamp_us, (north, east, down), (v_north, v_east, _) in rows:
            if not has_fix:
                yield NoFix()
                continue
            place = Place(
                start.latitude_deg + north / EARTH_RADIUS_M / DEG,
                start.longitude_deg + east / parallel_m / DEG,
                start.altitude_m - down,
            )
            v_n = (round(v_north / CENTI) * CENTI, round(v_east / CENTI) * CENTI, math.nan)
            yield GpsFix(stamp_us, place, v_n, fixes.sigma_m_s)

    return _sent(link, fixes.t_s, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, made())


def _attitudes(flight: DrawnFlight, link: _Link) -> Iterator[Event]:
    """ATTITUDE: the truth with a wandering error, and the autopilot's faults."""
    t_s = np.arange(0.5, flight.draw.length_s, 1.0 / ATTITUDES_HZ)
    q_nb = reported_attitudes(flight, t_s)
    stamps_ms = (BOOT_US // 1000 + np.round(1e3 * t_s).astype(np.int64)).tolist()
    made = (
        ReportedAttitude(False, stamp_ms, (w, x, y, z))
        for stamp_ms, (w, x, y, z) in zip(stamps_ms, q_nb.tolist(), strict=True)
    )
    return _sent(link, t_s, mavlink.MAVLINK_MSG_ID_ATTITUDE, made)


def reported_attitudes(flight: DrawnFlight, t_s: Array) -> Array:
    """(N, 4) the autopilot's own attitude."""
    random = np.random.default_rng([flight.draw.seed, 5])
    phases = random.uniform(0.0, 2.0 * np.pi, 3) + np.outer(
        t_s, 1.0 / OWN_ERROR_S * (1 + random.random(3))
    )
    roll, pitch, heading = (np.sqrt(2.0) * DEG * np.array(OWN_ERROR_DEG) * np.sin(phases)).T
    for fault in flight.draw.scheduled:
        size = np.where(acts(fault, t_s), _number(fault) * DEG, 0.0)
        roll = roll + (size if fault.name == "autopilot-tilt" else 0.0)
        heading = heading + (size if fault.name == "autopilot-heading" else 0.0)
    zero = np.zeros_like(roll)
    tilted = product(flight.motion.at(t_s).q_nb, attitude_rows(roll, pitch, zero))
    return product(attitude_rows(zero, zero, heading), tilted)


def _number(fault: Fault) -> float:
    return fault.argument if isinstance(fault.argument, float) else 0.0


def _imu(flight: DrawnFlight, number: int, link: _Link) -> Iterator[Event]:
    """The messages of an IMU."""
    found, is_counted = flight.imus[number], flight.draw.imu.form == "integers"
    stamps = BOOT_US + found.stamp_us
    message_id, imu = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, None if is_counted else number
    if is_counted:
        message_id = INTEGER_IDS[number]
        stamps = stamps if number == 0 else stamps // 1000
    return _sent(link, found.t_s, message_id, _readings(found, stamps, imu))


def _readings(found: DrawnReadings, stamps: Times, imu: int | None) -> Iterator[Message]:
    has_field = ~np.isnan(found.m_b_ut[:, 0])
    for first in range(0, len(stamps), BLOCK):
        part = slice(first, first + BLOCK)
        rates, forces, fields = (
            map(tuple, values[part].tolist()) for values in (found.w_b, found.f_b, found.m_b_ut)
        )
        rows = zip(
            stamps[part].tolist(),
            rates,
            forces,
            (field if has else None for has, field in zip(has_field[part], fields, strict=True)),
            found.clipped[part].tolist(),
            repeat(imu),
            repeat(None),
            strict=False,
        )
        yield from map(ImuReading._make, rows)
