"""The verdict on satellite navigation: jammed, spoofed, or undecided.

What a receiver says of its signals counts at once. A false velocity, found by the force
(`h2nav.integrity.monitor`), is a receiver's error while the position does not follow it; where both
move alike and the receiver claims to be accurate, its signals are false. So they may be where
the receiver's time jumps. Two receivers that differ accuse nobody by themselves.
"""

import math
from itertools import pairwise
from typing import NamedTuple

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.gnss_clock import ClockWatch
from h2nav.integrity.gnss_signals import SignalLevels, SignalWatch
from h2nav.maths.units import EARTH_RADIUS_M

# States of MAVLink's GPS_JAMMING_STATE and GPS_SPOOFING_STATE, and of PX4's sensor_gps.
MITIGATED, DETECTED = 2, 3
# A state, a fix, a judgement of the velocity that is not repeated counts for this long.
STALE_US = 10_000_000
FRESH_US = 1_000_000
# The position is compared with the velocity over this.
LENGTH_US = 5_000_000
MIN_COMPARED_US = 2_500_000
# They agree within this, and within a share of the way: velocities of 1 Hz miss corners.
FOLLOWS_M = 3.0
FOLLOWS_SHARE = 0.2
# A receiver that states worse does not claim to be right.
CLAIMED_M_S = 1.5
# Two receivers differ beyond this for this long; places of their antennas and rates included.
APART_M = 30.0
APART_M_S = 3.0
APART_S = 5.0
GPS = Sensor(SensorKind.GPS)


class SignalState(NamedTuple):
    """What a receiver says of its signals; unknown numbers stay numbers."""

    receiver: int  # its number, from 0
    jamming: int  # GPS_JAMMING_STATE
    spoofing: int  # GPS_SPOOFING_STATE


class _Fix(NamedTuple):
    t_us: int
    latitude_deg: float
    longitude_deg: float
    v_n: tuple[float, float]
    sigma_m_s: float


class GnssVerdict:
    """Takes fixes and states of the receivers of one autopilot; times on its clock."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forgets what is known, for another autopilot or another clock."""
        self._states: dict[int, tuple[int, SignalState]] = {}
        self._fixes: list[_Fix] = []
        self._other: _Fix | None = None
        self._false_us: int | None = None  # since when the velocity is false
        self._spoofed: tuple[int, float, float] | None = None  # since, way and difference, m
        self._apart_us: int | None = None
        self._apart = (0.0, 0.0)  # m, m/s
        self._signals: dict[int, SignalWatch] = {}  # of the receivers that measure power
        self._used = SignalWatch()  # counts the satellites of the receiver in use
        self._clocks: dict[int, ClockWatch] = {}  # of the receivers that tell their time
        self._now_us = 0

    def state(self, t_us: int, state: SignalState) -> None:
        """Takes what a receiver says of its signals."""
        self._now_us = max(self._now_us, t_us)
        self._states[state.receiver] = t_us, state

    def levels(self, t_us: int, receiver: int, measured: SignalLevels) -> None:
        """Takes what a receiver measures of the power at its antenna."""
        self._now_us = max(self._now_us, t_us)
        self._signals.setdefault(receiver, SignalWatch()).levels(t_us, measured)

    def time(self, t_us: int, receiver: int, unix_s: float) -> None:
        """Takes the time that a receiver tells at a fix."""
        self._now_us = max(self._now_us, t_us)
        self._clocks.setdefault(receiver, ClockWatch()).take(t_us, unix_s)

    def count(self, t_us: int, satellites: int) -> None:
        """Takes the number of satellites that an armed vehicle uses; 0 without a fix."""
        self._now_us = max(self._now_us, t_us)
        self._used.count(t_us, satellites)

    def fix(
        self, velocity: VelocityFix, latitude_deg: float, longitude_deg: float, *, is_false: bool
    ) -> None:
        """Takes a fix of the receiver in use.

        Args:
            is_false: the force has shown that its velocity is false.
        """
        t_us = velocity.t_us
        fixes = self._fixes
        if fixes and not 0 < t_us - fixes[-1].t_us < MIN_COMPARED_US:
            fixes.clear()
        v_n = (velocity.v_n[0], velocity.v_n[1])
        fixes.append(_Fix(t_us, latitude_deg, longitude_deg, v_n, velocity.sigma_m_s))
        while fixes[0].t_us < t_us - LENGTH_US:
            del fixes[0]
        self._now_us = t_us
        self._compare_receivers()
        if not is_false:
            self._false_us = self._spoofed = None
            return
        if self._false_us is None:
            self._false_us = t_us
        followed = self._followed()
        if followed is not None and self._spoofed is None:
            self._spoofed = self._false_us, *followed

    def other_fix(self, velocity: VelocityFix, latitude_deg: float, longitude_deg: float) -> None:
        """Takes a fix of a receiver that is not in use."""
        v_n = (velocity.v_n[0], velocity.v_n[1])
        self._other = _Fix(velocity.t_us, latitude_deg, longitude_deg, v_n, velocity.sigma_m_s)

    def _followed(self) -> tuple[float, float] | None:
        """The way by the velocity and what the position differs by, m; None if it does not follow.

        A velocity that hardly moves the vehicle shows nothing.
        """
        fixes = self._fixes
        first, last = fixes[0], fixes[-1]
        if last.t_us - first.t_us < MIN_COMPARED_US or last.sigma_m_s > CLAIMED_M_S:
            return None
        north = east = 0.0
        for a, b in pairwise(fixes):
            half_s = 0.5e-6 * (b.t_us - a.t_us)
            north += half_s * (a.v_n[0] + b.v_n[0])
            east += half_s * (a.v_n[1] + b.v_n[1])
        way = math.hypot(north, east)
        moved_north, moved_east = _from(first, last)
        differs = math.hypot(moved_north - north, moved_east - east)
        if way < FOLLOWS_M or differs > FOLLOWS_M + FOLLOWS_SHARE * way:
            return None
        return way, differs

    def _compare_receivers(self) -> None:
        """Tracks how long two receivers have differed."""
        mine, other = self._fixes[-1], self._other
        if other is None or abs(mine.t_us - other.t_us) > FRESH_US:
            self._apart_us = None
            return
        apart = math.hypot(*_from(other, mine)), math.dist(mine.v_n, other.v_n)
        scatter = 3.0 * math.hypot(mine.sigma_m_s, other.sigma_m_s)
        if apart[0] < APART_M and apart[1] < APART_M_S + scatter:
            self._apart_us = None
            return
        if self._apart_us is None:
            self._apart_us = mine.t_us
        self._apart = apart

    def forget_old(self, t_us: int) -> None:
        """Forgets what was held against receivers that are heard no more."""
        stale_us = t_us - STALE_US
        self._states = {n: said for n, said in self._states.items() if said[0] > stale_us}
        if self._fixes and self._fixes[-1].t_us <= stale_us:
            self._false_us = self._spoofed = self._apart_us = None
        for clock in self._clocks.values():
            clock.forget_old(stale_us)
        for watch in self._signals.values():
            watch.forget_old(t_us)

    def alarms(self) -> list[Alarm]:
        """The present verdict."""
        found = [alarm for alarm in (self._jammed(), self._spoofed_signals()) if alarm is not None]
        if not found and self._apart_us is not None and self._since_s(self._apart_us) >= APART_S:
            found.append(self._receivers_differ(self._apart_us))
        return found

    def _since_s(self, t_us: int) -> float:
        return 1e-6 * (self._now_us - t_us)

    def _said(self, name: str) -> tuple[int, int] | None:
        """Number of the receiver that says the most of jamming or spoofing, and what it says."""
        said = [
            (state.receiver, getattr(state, name))
            for t_us, state in self._states.values()
            if self._now_us - t_us < STALE_US and getattr(state, name) >= MITIGATED
        ]
        return max(said, key=lambda one: one[1] == DETECTED, default=None)

    def _jammed(self) -> Alarm | None:
        said = self._said("jamming")
        if said is not None:
            return _by_receiver(Kind.GNSS_JAMMED, "jammed", *said)
        for watch in self._signals.values():
            watch.forget_old(self._now_us)
        raised = next((each for each in self._signals.values() if each.raised), None)
        if raised is None:
            return None  # satellites are lost by antennas, roofs and restarts as well
        lost, since_us = self._used.lost, raised.since_us
        evidence = f"the receiver measures {raised.raised}"
        if lost is not None:
            evidence += f"; satellites {lost[0]} -> {lost[1]}"
            since_us = min(since_us, self._used.since_us)
        is_decided = lost is not None
        return Alarm(
            Kind.GNSS_JAMMED,
            GPS,
            Severity.WARNING if is_decided else Severity.NOTICE,
            float(DETECTED if is_decided else MITIGATED),
            "",
            f"GNSS {'is' if is_decided else 'may be'} jammed",
            evidence,
            since_s=self._since_s(since_us),
            is_decided=is_decided,
        )

    def _spoofed_signals(self) -> Alarm | None:
        said = self._said("spoofing")
        if said is not None and said[1] == DETECTED:
            return _by_receiver(Kind.GNSS_SPOOFED, "spoofed", *said)
        if self._spoofed is not None:
            since_us, way, differs = self._spoofed
            return Alarm(
                Kind.GNSS_SPOOFED,
                GPS,
                Severity.NOTICE,
                way,
                "m",
                "GNSS may be spoofed",
                f"the velocity contradicts the force, and the position follows it: {way:.0f} m "
                f"within {differs:.1f} m, at a stated accuracy of "
                f"{self._fixes[-1].sigma_m_s:.1f} m/s",
                since_s=self._since_s(since_us),
            )
        if said is not None:
            return _by_receiver(Kind.GNSS_SPOOFED, "spoofed", *said)
        return self._false_time()

    def _false_time(self) -> Alarm | None:
        jumped = [(number, one) for number, one in self._clocks.items() if one.jump_s != 0.0]
        if not jumped:
            return None
        number, clock = jumped[0]
        return Alarm(
            Kind.GNSS_SPOOFED,
            GPS,
            Severity.NOTICE,
            abs(clock.jump_s),
            "s",
            "GNSS may be spoofed",
            f"the time of receiver {number + 1} jumped by {clock.jump_s:+.0f} s against the "
            "autopilot's clock",
            since_s=self._since_s(clock.since_us),
        )

    def _receivers_differ(self, since_us: int) -> Alarm:
        distance_m, speed_m_s = self._apart
        return Alarm(
            Kind.GNSS_SPOOFED,
            GPS,
            Severity.NOTICE,
            distance_m,
            "m",
            "GPS receivers differ, undecided",
            f"their positions differ by {distance_m:.0f} m and their velocities by "
            f"{speed_m_s:.1f} m/s; nothing shows which one is wrong",
            since_s=self._since_s(since_us),
        )


def _by_receiver(kind: Kind, what: str, receiver: int, state: int) -> Alarm:
    """What a receiver says of its own signals."""
    severity, text, said = Severity.WARNING, f"GNSS is {what}", "detected"
    if state != DETECTED:
        severity, text = Severity.NOTICE, f"GNSS may be {what}"
        said = "mitigated" if state == MITIGATED else f"state {state}"
    evidence = f"receiver {receiver + 1} says so itself: {said}"
    return Alarm(
        kind, GPS, severity, float(state), "", text, evidence, is_decided=state == DETECTED
    )


def _from(first: _Fix, last: _Fix) -> tuple[float, float]:
    """North and east from one fix to another, m."""
    per_deg = math.radians(EARTH_RADIUS_M)
    turns = (last.longitude_deg - first.longitude_deg + 180.0) % 360.0 - 180.0
    return (
        per_deg * (last.latitude_deg - first.latitude_deg),
        per_deg * math.cos(math.radians(first.latitude_deg)) * turns,
    )
