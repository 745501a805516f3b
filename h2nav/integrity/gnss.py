"""The verdict on satellite navigation: jammed, spoofed, or undecided.

What a receiver says of its signals counts at once. A false velocity, found by the force
(`h2nav.integrity.monitor`), is a receiver's error while the position does not follow it; where both
move alike and the receiver claims to be accurate, its signals are false. So they may be where
the receiver's time jumps. Two receivers that differ accuse nobody by themselves. What a receiver
says against itself is its error (`receiver_track`).
"""

import math
from typing import NamedTuple

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.gnss_clock import ClockWatch
from h2nav.integrity.gnss_signals import SignalLevels, SignalWatch
from h2nav.integrity.receiver_track import ReceiverFix, ReceiverTrack, way_to

# States of MAVLink's GPS_JAMMING_STATE and GPS_SPOOFING_STATE, and of PX4's sensor_gps.
MITIGATED, DETECTED = 2, 3
# A state, a fix, a judgement of the velocity that is not repeated counts for this long.
STALE_US = 10_000_000
FRESH_US = 1_000_000
# The position is compared with the velocity over at least this.
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
# Places that deny a velocity are told after this.
DENIED_S = 2.0
GPS = Sensor(SensorKind.GPS)


class SignalState(NamedTuple):
    """What a receiver says of its signals; unknown numbers stay numbers."""

    receiver: int  # its number, from 0
    jamming: int  # GPS_JAMMING_STATE
    spoofing: int  # GPS_SPOOFING_STATE


class GnssVerdict:
    """Takes fixes and states of the receivers of one autopilot; times on its clock."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forgets what is known, for another autopilot or another clock."""
        self._states: dict[int, tuple[int, SignalState]] = {}
        self._track = ReceiverTrack()  # of the receiver in use
        self._other: ReceiverFix | None = None
        self._denied_us: int | None = None  # since when its places deny its velocity
        self._was_denied = False  # since the velocity is false
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
        self, velocity: VelocityFix, latitude_deg: float, longitude_deg: float
    ) -> VelocityFix | None:
        """Takes a fix of the receiver in use.

        Returns:
            Its velocity with what its place says of it; None if it only repeats the one before.
        """
        track = self._track
        self._now_us = velocity.t_us
        if not track.take(velocity, latitude_deg, longitude_deg):
            return None
        if not track.denied_m:
            self._denied_us = None
            return velocity
        if self._denied_us is None:
            self._denied_us = velocity.t_us
        self._was_denied = True
        return velocity._replace(is_denied=True)

    def judge(self, *, is_false: bool) -> None:
        """Looks at the latest fix.

        Args:
            is_false: the force has shown that its velocity is false.
        """
        if self._other is not None:
            self._compare_receivers(self._other)
        if not is_false:
            self._false_us = self._spoofed = None
            self._was_denied = self._denied_us is not None
            return
        if self._was_denied:
            self._spoofed = None  # the receiver contradicts itself, now or before
            return
        if self._false_us is None:
            self._false_us = self._now_us
        followed = self._followed()
        if followed is not None and self._spoofed is None:
            self._spoofed = self._false_us, *followed

    def other_fix(self, velocity: VelocityFix, latitude_deg: float, longitude_deg: float) -> None:
        """Takes a fix of a receiver that is not in use."""
        v_n = (velocity.v_n[0], velocity.v_n[1])
        self._other = ReceiverFix(
            velocity.t_us, latitude_deg, longitude_deg, v_n, velocity.sigma_m_s
        )

    def _followed(self) -> tuple[float, float] | None:
        """The way by the velocity and what the position differs by, m; None if it does not follow.

        A velocity that hardly moves the vehicle shows nothing.
        """
        first, last = self._track.fixes[0], self._track.fixes[-1]
        if last.t_us - first.t_us < MIN_COMPARED_US or last.sigma_m_s > CLAIMED_M_S:
            return None
        way, differs = self._track.compared()
        if way < FOLLOWS_M or differs > FOLLOWS_M + FOLLOWS_SHARE * way:
            return None
        return way, differs

    def _compare_receivers(self, other: ReceiverFix) -> None:
        """Tracks how long two receivers have differed."""
        mine = self._track.fixes[-1]
        if abs(mine.t_us - other.t_us) > FRESH_US:
            self._apart_us = None
            return
        apart = (
            math.hypot(*way_to(other, mine.latitude_deg, mine.longitude_deg)),
            math.dist(mine.v_n, other.v_n),
        )
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
        if self._track.is_older_than(stale_us):
            self._track = ReceiverTrack()
            self._false_us = self._spoofed = self._apart_us = self._denied_us = None
        for clock in self._clocks.values():
            clock.forget_old(stale_us)
        for watch in self._signals.values():
            watch.forget_old(t_us)

    def alarms(self) -> list[Alarm]:
        """The present verdict."""
        found = [alarm for alarm in (self._jammed(), self._spoofed_signals()) if alarm is not None]
        if self._denied_us is not None or self._track.is_stuck:
            found += self._of_itself()
        if not found and self._apart_us is not None and self._since_s(self._apart_us) >= APART_S:
            found.append(self._receivers_differ(self._apart_us))
        return found

    def _since_s(self, t_us: int) -> float:
        return 1e-6 * (self._now_us - t_us)

    def _said(self, name: str) -> tuple[int, int] | None:
        """Number of the receiver that says the most of jamming or spoofing, and what it says."""
        if not self._states:
            return None
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
                f"{self._track.fixes[-1].sigma_m_s:.1f} m/s",
                since_s=self._since_s(since_us),
            )
        if said is not None:
            return _by_receiver(Kind.GNSS_SPOOFED, "spoofed", *said)
        return self._false_time()

    def _false_time(self) -> Alarm | None:
        for number, clock in self._clocks.items():
            if clock.jump_s != 0.0:
                return self._of_time(number, clock)
        return None

    def _of_time(self, number: int, clock: ClockWatch) -> Alarm:
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

    def _of_itself(self) -> list[Alarm]:
        """Of a velocity that repeats, or that is not the way of the same receiver's places."""
        held, denied_us = self._track.held, self._denied_us
        if held is not None:
            since_us, count = held
            held_s = self._since_s(since_us)
            return [
                Alarm(
                    Kind.GPS_FROZEN,
                    GPS,
                    Severity.WARNING,
                    held_s,
                    "s",
                    "GPS velocity is frozen and not used",
                    f"{count} fixes in a row have exactly the same, which none measures twice",
                    since_s=held_s,
                )
            ]
        if denied_us is None or self._since_s(denied_us) < DENIED_S:
            return []
        return [
            Alarm(
                Kind.GPS_VELOCITY,
                GPS,
                Severity.NOTICE,
                self._track.denied_m,
                "m",
                "GPS velocity and place differ, undecided",
                f"by {self._track.denied_m:.0f} m in 3 s; the velocity is not used",
                since_s=self._since_s(denied_us),
                is_decided=False,
            )
        ]

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
