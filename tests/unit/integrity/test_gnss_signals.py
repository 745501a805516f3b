"""Jamming by satellites, noise, gain and narrow lines, against the receiver's own usual ones."""

import math

import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.integrity.gnss import GnssVerdict
from h2nav.integrity.gnss_signals import SignalLevels

SECOND_US = 1_000_000
USUAL = SignalLevels(100.0, 3700.0, 15.0)


class Flight:
    """A receiver of 5 Hz that measures its power once a second."""

    def __init__(self):
        self.verdict = GnssVerdict()
        self.t_us = 0

    def run(self, seconds, satellites, levels=None):
        """The alarms at the end."""
        for i in range(round(5 * seconds)):
            self.t_us += SECOND_US // 5
            self.verdict.count(self.t_us, satellites)
            if levels is not None and i % 5 == 0:
                self.verdict.levels(self.t_us, 0, levels)
        return self.verdict.alarms()


@pytest.mark.parametrize(
    "jammed",
    [
        USUAL._replace(noise=230.0),
        USUAL._replace(gain=1500.0),
        USUAL._replace(line=160.0),
    ],
    ids=("noise", "gain", "line"),
)
def test_more_power_while_satellites_are_lost_is_jamming(jammed):
    flight = Flight()
    assert flight.run(40.0, 14, USUAL) == []
    (alarm,) = flight.run(1.4, 5, jammed)
    assert (alarm.kind, alarm.severity, alarm.is_decided) == (
        Kind.GNSS_JAMMED,
        Severity.WARNING,
        True,
    )
    assert "14 -> 5" in alarm.evidence
    flight.run(5.0, 14, USUAL)
    assert flight.verdict.alarms() == []


def test_more_power_alone_is_said_at_once_and_is_undecided():
    flight = Flight()
    flight.run(40.0, 14, USUAL)
    (alarm,) = flight.run(0.2, 14, USUAL._replace(gain=1500.0))
    assert (alarm.severity, alarm.is_decided) == (Severity.NOTICE, False)


@pytest.mark.parametrize("levels", [None, USUAL], ids=("unmeasured", "usual"))
def test_lost_satellites_alone_are_no_jamming(levels):
    """Antennas that fail, roofs and restarts lose them too."""
    flight = Flight()
    flight.run(40.0, 14, levels)
    assert flight.run(30.0, 0, levels) == []


@pytest.mark.parametrize(
    "unusual",
    [
        SignalLevels(140.0, 3000.0, 80.0),  # as far as sound receivers went
        SignalLevels(100.0 * 2.0, 3700.0 / 2.0, 15.0 + 127.0),  # just below the limits
        SignalLevels(0.0, 0.0, 0.0),
        SignalLevels(math.nan, math.nan, math.nan),
        SignalLevels(math.inf, -5.0, 1e9),
    ],
)
def test_sound_receivers_and_those_that_measure_nothing_are_not_reported(unusual):
    flight = Flight()
    flight.run(40.0, 14, USUAL)
    assert flight.run(10.0, 9, unusual) == []


def test_one_fix_without_satellites_is_a_receiver_that_restarts():
    flight = Flight()
    flight.run(40.0, 11)
    for _ in range(20):
        assert flight.run(0.2, 0) == []
        assert flight.run(2.0, 11) == []


def test_a_receiver_that_begins_with_few_satellites_loses_none():
    flight = Flight()
    assert flight.run(40.0, 5) == []
    assert flight.run(40.0, 0) == []


def test_levels_that_end_say_nothing_any_more():
    flight = Flight()
    flight.run(40.0, 14, USUAL)
    assert flight.run(1.0, 14, USUAL._replace(noise=250.0))
    assert flight.run(15.0, 14) == []
