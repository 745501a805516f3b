"""Sums over the flights of airframes and of components."""

import math

from h2nav.airframes.features import FlightRow
from h2nav.airframes.odometer import ComponentChange, odometers


def flight(day, airframe="uid:1", flown_s=600.0, hard=0):
    return FlightRow("", airframe, day * 86_400.0, {}, flown_s, 1000.0, 1, hard)


def test_sums_per_airframe_and_component():
    rows = [flight(1), flight(2, hard=1), flight(3), flight(2, "uid:2"), flight(4, flown_s=0.0)]
    changes = [ComponentChange("uid:1", "motor 2", day * 86_400.0) for day in (1, 2)]
    first, motor, other = odometers(rows, changes)
    assert (first.airframe, first.component, first.flights) == ("uid:1", "", 3)
    assert (first.flown_s, first.distance_m, first.landings, first.hard_landings) == (
        1800.0, 3000.0, 3, 1,
    )  # fmt: skip
    assert (motor.component, motor.flights, motor.hard_landings) == ("motor 2", 2, 1)
    assert motor.since_unix_s == 2 * 86_400.0
    assert (other.airframe, other.flights) == ("uid:2", 1)


def test_what_is_unknown_is_not_counted():
    assert not odometers([flight(1, airframe="")], [])
    undated = flight(math.nan)
    whole, motor = odometers([undated], [ComponentChange("uid:1", "motor 1", 0.0)])
    assert whole.flights == 1
    assert math.isnan(whole.since_unix_s)
    assert motor.flights == 0


def test_a_component_may_be_noted_before_the_first_flight():
    whole, motor = odometers([], [ComponentChange("uid:9", "battery A", 5.0)])
    assert (whole.flights, motor.flights, motor.since_unix_s) == (0, 0, 5.0)
