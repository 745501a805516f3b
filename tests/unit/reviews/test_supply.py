"""When a battery was low, its sensor wrong, a barometer at fault: tables of just enough."""

import numpy as np
import pytest

from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Battery, Context, ReportedFault, Said, Series, Span
from h2nav.reviews.supply import detect_barometer, detect_battery

T_S = np.arange(0.0, 100.0, 0.5)
ARMED = (Span(20.0, 80.0, ""),)
UNKNOWN = np.full(len(T_S), np.nan)
LIMIT = {"BATT_LOW_VOLT": 10.5}  # of three cells


def pack(volts):
    return (Battery(0, T_S, np.broadcast_to(volts, T_S.shape).astype(float), UNKNOWN, UNKNOWN),)


def battery(volts=None, said=(), faults=(), throttle=None, **parameters):
    """The finding; None without one."""
    context = Context(
        armed=ARMED,
        batteries=() if volts is None else pack(volts),
        said=said,
        faults=faults,
        parameters=parameters,
        throttle=None if throttle is None else Series(T_S, throttle),
    )
    found = detect_battery(context)
    assert len(found) <= 1
    return found[0] if found else None


def says(text, t_s=50.0):
    return (Said(t_s, Severity.WARNING, text),)


def dip(length_s, volts, usual=11.5):
    return np.where((T_S >= 40.0) & (T_S - length_s <= 40.0), volts, usual)


@pytest.mark.parametrize(
    ("length_s", "volts", "limit", "is_told"),
    [
        (10.0, 10.4, LIMIT, True),
        (9.5, 10.4, LIMIT, False),
        (30.0, 10.5, LIMIT, False),
        (30.0, 10.4, {"FS_BATT_VOLTAGE": 10.5}, True),
        (30.0, 10.4, {"BATT_LOW_VOLT": 0.0, "FS_BATT_VOLTAGE": 10.5}, True),
        (30.0, 10.4, {"BATT_LOW_VOLT": 1.0}, False),  # a limit that is none
        (30.0, 10.4, {}, False),
        (30.0, 0.9, LIMIT, False),  # not measured
        (30.0, np.nan, LIMIT, False),
    ],
)
def test_a_voltage_below_the_limit_for_ten_seconds(length_s, volts, limit, is_told):
    found = battery(dip(length_s, volts), **limit)
    assert (found is not None) == is_told
    if found:
        assert (found.kind, found.sensor) == (Kind.BATTERY, Sensor(SensorKind.BATTERY))
        assert found.severity is Severity.WARNING
        assert (found.from_s, found.to_s) == (40.0, 40.0 + length_s)
        assert found.text == "the battery was low (10.4 V)"
        assert found.size == pytest.approx(10.4)
        (name,) = [name for name, volts in limit.items() if volts]
        assert (
            found.evidence == f"below {name} (10.5 V) for {length_s:.0f} s; lowest voltage 10.4 V"
        )


@pytest.mark.parametrize(("gap_s", "is_told"), [(4.0, True), (6.0, False)])
def test_between_two_flights_nothing_is_known_of_the_battery(gap_s, is_told):
    t_s = np.where(T_S > 44.0, T_S + gap_s, T_S)
    rows = Battery(0, t_s, dip(9.0, 10.4), 0.0 * t_s, 0.0 * t_s)
    armed = (Span(15.0, 44.0, ""), Span(44.0 + gap_s, 90.0, ""))
    assert (
        bool(detect_battery(Context(batteries=(rows,), armed=armed, parameters=LIMIT))) == is_told
    )


def test_the_longest_of_several_times_is_told():
    volts = np.minimum(dip(12.0, 10.0), np.where((T_S >= 60.0) & (T_S <= 75.0), 10.2, 11.5))
    found = battery(volts, **LIMIT)
    assert (found.from_s, found.to_s) == (60.0, 75.0)


@pytest.mark.parametrize(
    ("t_s", "is_told"), [(14.9, False), (15.1, True), (80.9, True), (81.1, False)]
)
def test_reports_count_while_it_is_armed_and_just_before(t_s, is_told):
    assert (battery(said=says("Low Battery", t_s)) is not None) == is_told
    fault = ReportedFault(t_s, "battery", 1, "low")
    assert (battery(faults=(fault,)) is not None) == is_told
    assert battery(faults=(fault._replace(code=0),)) is None  # it has ended
    assert battery(faults=(fault._replace(subsystem="barometer"),)) is None


@pytest.mark.parametrize(
    ("text", "is_told"),
    [
        ("Battery 1 is low 10.20V used 100 mAh", True),
        ("Battery failsafe", True),
        ("CRITICAL BATTERY, LANDING", True),
        ("Low Battery level", True),
        ("Battery 1 is full", False),
        ("EKF low", False),
    ],
)
def test_words_of_a_battery(text, is_told):
    found = battery(said=says(text))
    assert (found is not None) == is_told
    if found:
        assert found.severity is Severity.ERROR
        assert found.text == "the battery was low"
        assert found.evidence == f"50 s: {text!r}"
    made = says(text)[0]._replace(is_made=True)
    assert battery(said=(made,)) is None


def test_three_reports_are_quoted_and_all_are_timed():
    said = tuple(says(f"Low Battery {number}", 30.0 + number)[0] for number in (4, 3, 2, 1))
    found = battery(said=said)
    assert found.evidence.count("Low Battery") == 3
    assert found.evidence.startswith("31 s: 'Low Battery 1'; 32 s")
    assert (found.from_s, found.to_s) == (31.0, 34.0)


@pytest.mark.parametrize(
    ("volts", "limit", "why"),
    [
        (4.9, {}, "4.9 V is no battery"),
        (5.1, {}, None),
        (7.4, LIMIT, "7.4 V for 3 cells, by the limit that was set"),
        (7.6, LIMIT, None),
        (7.4, {"BATT_LOW_VOLT": 5.0}, None),  # of no pack
    ],
)
def test_a_voltage_that_is_no_battery_of_these_cells(volts, limit, why):
    found = battery(volts, says("Low Battery"), **limit)
    assert found.text.startswith("the battery's sensor is wrong" if why else "the battery was low")
    assert (found.severity is Severity.WARNING) == (why is not None)
    assert found.evidence.split("; ")[0] == (why or "50 s: 'Low Battery'")


@pytest.mark.parametrize(("said_v", "is_wrong"), [("4.90V", True), ("5.10V", False), ("", False)])
def test_without_rows_the_voltage_that_is_said(said_v, is_wrong):
    found = battery(said=says(f"Battery 1 low {said_v}"))
    assert found.text.startswith("the battery's sensor is wrong") == is_wrong
    assert ("4.9 V is no battery" in found.evidence) == is_wrong


@pytest.mark.parametrize(
    ("loaded_v", "idle_v", "carried", "rested", "is_wrong"),
    [
        (12.3, 12.0, 0.5, 0.05, True),
        (12.2, 12.0, 0.5, 0.05, False),
        (12.3, 12.0, 0.34, 0.05, False),
        (12.3, 12.0, 0.36, 0.05, True),
        (12.3, 12.0, 0.5, 0.13, False),
        (12.3, 12.0, 0.5, 0.11, True),
    ],
)
def test_a_voltage_that_rises_under_load(loaded_v, idle_v, carried, rested, is_wrong):
    flies = T_S >= 40.0
    found = battery(
        np.where(flies, loaded_v, idle_v),
        says("Low Battery"),
        throttle=np.where(flies, carried, rested),
    )
    told = f"{loaded_v:.1f} V while the motors carried it, {idle_v:.1f} V without load"
    assert (told in found.evidence) == is_wrong


def test_what_a_flight_left_of_it_is_not_what_it_was_before():
    flies = (T_S >= 22.0) & (T_S < 60.0)
    found = battery(
        np.where(flies, 12.3, 11.0), says("Low Battery"), throttle=np.where(flies, 0.5, 0.05)
    )
    assert "without load" not in found.evidence


def barometer(step_m=0.0, gap_s=0.1, at_s=50.0, said=()):
    t_s = np.append(np.arange(0.0, at_s, 0.1), np.arange(at_s - 0.1 + gap_s, 100.0, 0.1))
    heights = np.where(np.arange(len(t_s)) < len(np.arange(0.0, at_s, 0.1)), 10.0, 10.0 - step_m)
    context = Context(armed=ARMED, baro_height_m=Series(t_s, heights), said=said)
    found = detect_barometer(context)
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize(
    ("step_m", "gap_s", "at_s", "is_told"),
    [
        (31.0, 0.1, 50.0, True),
        (-31.0, 0.1, 50.0, True),
        (29.0, 0.1, 50.0, False),
        (31.0, 0.49, 50.0, True),
        (31.0, 0.51, 50.0, False),
        (31.0, 0.1, 10.0, False),
    ],
)
def test_a_jump_of_a_barometer(step_m, gap_s, at_s, is_told):
    found = barometer(step_m, gap_s, at_s)
    assert (found is not None) == is_told
    if found:
        assert (found.kind, found.sensor) == (Kind.BARO, Sensor(SensorKind.BAROMETER))
        assert found.size == pytest.approx(31.0)
        assert found.from_s == found.to_s == pytest.approx(at_s - 0.1 + gap_s)
        assert found.text == "the barometer jumped by 31 m"
        assert found.evidence == f"jump of 31 m at {found.from_s:.1f} s"


@pytest.mark.parametrize(
    ("text", "is_told"),
    [
        ("Baro glitch", True),
        ("PreArm: Baro not healthy", True),
        ("No barometer", True),
        ("Baro ok", False),
    ],
)
def test_words_of_a_barometer(text, is_told):
    found = barometer(said=says(text))
    assert (found is not None) == is_told
    if found:
        assert found.text == f"the autopilot reported: {text}"
        assert (found.size, found.evidence) == (0.0, f"50 s: {text!r}")


def test_of_one_height_nothing_is_told():
    series = Series(T_S[:1], T_S[:1])
    for height in (None, series):
        assert detect_barometer(Context(armed=ARMED, baro_height_m=height)) == []


@pytest.mark.parametrize(
    ("length_s", "volts", "usual", "limit", "cells"),
    [
        (2.0, 8.9, 11.5, {}, 3),
        (1.5, 8.9, 11.5, {}, None),
        (2.0, 9.1, 11.5, {}, None),
        (2.0, 8.9, 11.5, LIMIT, 3),  # the autopilot's own limit takes ten seconds
        (2.0, 8.9, 12.9, {}, 3),
        (2.0, 8.9, 10.6, {}, 3),
        (9.0, 8.9, 10.4, {}, None),  # a sensor that reads too little, or a pack that never was full
        (2.0, 5.9, 8.4, {}, 2),
        (2.0, 5.9, 8.9, {}, None),  # three cells, that never held anything
        (2.0, 17.9, 25.2, {}, 6),
        (2.0, 0.9, 11.5, {}, None),  # not measured
    ],
)
def test_a_battery_below_what_its_cells_may_be_discharged_to(length_s, volts, usual, limit, cells):
    found = battery(dip(length_s, volts, usual), throttle=dip(length_s, 0.7, 0.5), **limit)
    assert (found is not None) == (cells is not None)
    if found:
        assert found.text == f"the battery was low ({volts:.1f} V)"
        assert (found.from_s, found.to_s) == (40.0, 40.0 + length_s)
        assert f"below 3.0 V for each of {cells} cells for {length_s:.0f} s" in found.evidence


@pytest.mark.parametrize(
    ("before", "asked", "is_told"),
    [(0.5, 0.56, True), (0.5, 0.54, False), (0.36, 0.5, True), (0.34, 0.5, False)],
)
def test_a_voltage_that_sinks_while_nothing_more_is_asked_for_is_that_of_a_sensor(
    before, asked, is_told
):
    sinks = dip(5.0, 8.9)
    assert (battery(sinks, throttle=dip(5.0, asked, before)) is not None) == is_told
    assert battery(sinks) is None
