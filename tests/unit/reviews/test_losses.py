"""How pilots lose aircraft: each loss is told by more than one kind of evidence, cause first."""

import numpy as np
import pytest
from reviewed_flights import DURATION_S, flight, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Battery, Motors, Said, Series, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.chain import chain
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.impacts import Bins, Impact, with_contacts
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND
from h2nav.reviews.verdict import verdict
from h2nav.reviews.vertical import climbs, contacts

T_S = np.arange(0.0, DURATION_S, 0.1)
AT_S = 60.0
NO_BINS = Bins(np.zeros(0), *(np.zeros((0, 3)),) * 2, *(np.zeros(0),) * 3)


def fallen(speed_m_s, stop_s=0.1, since_s=AT_S):
    """Climb rate and height of a fall that ends at once, or within a time."""
    climb = np.zeros(len(T_S))
    falls = (since_s - 4.0 < T_S) & (since_s >= T_S)
    climb[falls] = -speed_m_s * np.minimum((T_S[falls] - since_s + 4.0) / 3.5, 1.0)
    stops = (since_s < T_S) & (since_s + stop_s >= T_S)
    climb[stops] = -speed_m_s * (1.0 - (T_S[stops] - since_s) / stop_s)
    return Series(T_S, climb), Series(T_S, 40.0 + np.cumsum(climb) * 0.1)


def outputs(shares):
    """Motors at shares of their range, from a time on, at 50 % before; stopped in the end."""
    pwm_us = np.full((len(T_S), 4), 1500.0)
    for since_s, row in (*shares, (DURATION_S - 2.0, (0.0,) * 4)):
        pwm_us[since_s <= T_S] = 1000.0 + 1000.0 * np.array(row)
    return Motors((1, 2, 3, 4), T_S, pwm_us, 1000.0, 2000.0)


def flown(climb, height, **changes):
    found = {"climb_m_s": climb, "baro_height_m": height, "height_m": height, **changes}
    return flight(vehicle_type=2, **{"motors": outputs([]), **found})


def told(flown):
    analysis = analyse(flown)
    links = chain(flown, analysis)
    return {one.kind: one for one in links.findings}, verdict(flown, analysis, links).text


def test_a_descent_that_ends_at_once_is_a_crash_although_no_blow_was_logged():
    found, text = told(flown(*fallen(12.0)))
    assert found[Kind.CRASH].from_s == pytest.approx(AT_S, abs=0.5)
    assert "at 12.0 m/s" in found[Kind.CRASH].text
    assert "Crashed at 60 s with 12 m/s." in text


def test_heights_are_later_than_the_blow_that_ended_a_descent():
    """What the vehicle did in between was done to it: no loss of control that led there."""
    late = flown(*fallen(12.0))
    first = late.context.imus[0]
    struck = (first.t_s > AT_S - 0.4) & (first.t_s < AT_S - 0.3)
    found, _ = told(with_imu(late, f_b=first.f_b * np.where(struck, 8.0, 1.0)[:, None]))
    assert "at 12.0 m/s" in found[Kind.CRASH].text
    assert found[Kind.CRASH].from_s == pytest.approx(AT_S - 0.4, abs=0.11)


@pytest.mark.parametrize(("speed_m_s", "stop_s"), [(3.0, 0.1), (12.0, 2.0)])
def test_a_landing_and_a_descent_that_thrust_ends_are_none(speed_m_s, stop_s):
    assert Kind.CRASH not in told(flown(*fallen(speed_m_s, stop_s)))[0]


def test_a_single_source_does_not_end_a_flight():
    climb, height = fallen(12.0)
    level = height._replace(values=0.0 * height.values)
    assert Kind.CRASH not in told(flown(climb, level))[0]


def test_a_blow_has_the_speed_that_no_source_denies():
    climb, height = fallen(12.0)
    tumbles = np.where((T_S > AT_S - 0.5) & (T_S <= AT_S), 12.0 * (T_S - AT_S + 0.5), 0.0)
    blown = height._replace(values=height.values - np.maximum.accumulate(tumbles) * 3.0)
    for baro, speeds in ((height, (12.0,)), (blown, ())):
        met = contacts(climbs(flown(climb, baro).context), flown(climb, baro).context)
        blow = Impact(AT_S, AT_S + 1.0, 16.0, 40.0, np.nan, 0.0, AT_S, is_crash=True)
        (found,) = with_contacts([blow], met, NO_BINS, flown(climb, baro).context)
        known = [found.speed_m_s] if np.isfinite(found.speed_m_s) else []
        assert known == pytest.approx(speeds, abs=0.5)


def test_a_low_throttle_by_hand_is_the_cause_of_a_crash_and_the_only_one():
    changes = {
        "motors": outputs([(AT_S - 4.0, (0.15,) * 4)]),
        "modes": (Span(0.0, 55.0, "ALT_HOLD"), Span(55.0, DURATION_S, "STABILIZE")),
    }
    found, text = told(flown(*fallen(12.0), **changes))
    assert found[Kind.CRASH].cause == found[FLOWN_INTO_GROUND].id
    first = "Flown into the ground by the pilot's demand at 60 s with 12 m/s."
    assert text.startswith(f"{first} Nothing else was found wrong in what could be looked at. Not ")
    changes["modes"] = (Span(0.0, DURATION_S, "RTL"),)
    assert FLOWN_INTO_GROUND not in told(flown(*fallen(12.0), **changes))[0]


def test_a_pilot_did_not_ask_for_motors_that_stopped():
    changes = {
        "motors": outputs([(AT_S - 4.0, (0.15,) * 4), (AT_S - 1.5, (0.0,) * 4)]),
        "modes": (Span(0.0, DURATION_S, "STABILIZE"),),
    }
    fell = flown(*fallen(12.0), **changes)
    first = fell.context.imus[0]
    falls = (first.t_s > AT_S - 1.5) & (first.t_s < AT_S)
    found, text = told(with_imu(fell, f_b=first.f_b * np.where(falls, 0.05, 1.0)[:, None]))
    assert found[Kind.CRASH].cause == found[MOTORS_STOPPED].id
    assert FLOWN_INTO_GROUND not in found
    assert text.startswith("All motors stopped in the air (all outputs at their least) at 58 s")


def test_a_motor_alone_at_its_limit_while_it_sinks_is_too_weak():
    sinks = np.where((T_S > 50.0) & (T_S < 60.0), -1.5, 0.0)
    height = Series(T_S, 40.0 + np.cumsum(sinks) * 0.1)
    changes = {
        "motors": outputs([(50.0, (0.6, 0.6, 1.0, 0.6)), (60.0, (0.5,) * 4)]),
        "gps": (),
        "said": (Said(52.0, Severity.CRITICAL, "Potential Thrust Loss (3)"),),
    }
    found, text = told(flown(Series(T_S, sinks), height, **changes))
    assert found[Kind.MOTOR_FAILED].sensor.number == 3
    assert text.startswith("Motor 3 gave too little thrust")
    level = Series(T_S, np.full(len(T_S), 40.0))
    no_descent = told(flown(Series(T_S, sinks), level, **changes | {"said": ()}))[0]
    assert Kind.MOTOR_FAILED not in no_descent
    # With the others near their limit it is thrust that is lacking, whichever meets it first.
    lacking = outputs([(50.0, (0.84, 0.84, 1.0, 0.84)), (60.0, (0.5,) * 4)])
    no_reserve = told(
        flown(Series(T_S, sinks), height, **changes | {"motors": lacking, "said": ()})
    )[0]
    assert Kind.MOTOR_FAILED not in no_reserve
    # What a motor meets now and then is not for lack of its thrust.
    touched = outputs([(50.0, (0.6, 0.6, 1.0, 0.6)), (60.0, (0.5,) * 4)])
    touched.pwm_us[np.arange(len(T_S)) % 4 > 0, 2] = 1800.0
    now_and_then = told(
        flown(Series(T_S, sinks), height, **changes | {"motors": touched, "said": ()})
    )[0]
    assert Kind.MOTOR_FAILED not in now_and_then
    # With more force than its weight it brakes.
    brakes = flown(Series(T_S, sinks), height, **changes | {"said": ()})
    first = brakes.context.imus[0]
    pushed = first.f_b * np.where((first.t_s > 50.0) & (first.t_s < 60.0), 1.2, 1.0)[:, None]
    assert Kind.MOTOR_FAILED not in told(with_imu(brakes, f_b=pushed))[0]
    assert found[Kind.SAID_CRASH].cause == found[Kind.MOTOR_FAILED].id


def test_a_weak_battery_accuses_no_motor():
    climb = Series(T_S, 0.25 * np.cos(0.125 * T_S))
    height = Series(T_S, 40.0 + 2.0 * np.sin(0.125 * T_S))
    volts = np.where(T_S > 50.0, 9.2, 12.6)
    changes = {
        "batteries": (Battery(0, T_S, volts, 0.0 * volts + 30.0, 0.0 * volts + 0.8),),
        "motors": outputs([(51.0, (0.78, 0.78, 1.0, 1.0)), (54.0, (0.86,) * 4)]),
        "said": (
            Said(52.0, Severity.CRITICAL, "Potential Thrust Loss (3)"),
            Said(60.0, Severity.WARNING, "Battery 1 is low 9.20V used 505 mAh"),
        ),
        "gps": (),
        "parameters": {"BATT_LOW_VOLT": 10.5},
    }
    found, text = told(flown(climb, height, **changes))
    assert Kind.MOTOR_FAILED not in found
    assert found[Kind.MOTOR_SATURATED].cause == found[Kind.BATTERY].id
    assert text.startswith("No crash. The battery was low (9.2 V), then thrust was lacking.")


def test_a_barometer_that_steps_is_told_by_receiver_and_estimator():
    climb, height = Series(T_S, np.zeros(len(T_S))), Series(T_S, np.full(len(T_S), 40.0))
    stepped = height._replace(values=height.values - 25.0 * (T_S > 50.0))
    found, text = told(flown(climb, stepped, height_m=height))
    assert found[Kind.BARO].size == pytest.approx(25.0, abs=3.0)
    assert text.startswith("No crash. The barometer stepped by -25 m at 50 s")
    assert Kind.BARO not in told(flown(climb, height))[0]


def test_a_height_that_runs_away_is_not_the_barometers_and_vibration_is_its_cause():
    """The receiver's altitude agrees with the barometer."""
    plain = flight()
    altitude = plain.context.gps[0].altitude_m
    height = Series(plain.context.gps[0].t_s, altitude - altitude[0])
    runs = np.where((T_S > 50.0) & (T_S < 56.0), 5.0, 0.0)
    own = np.interp(T_S, height.t_s, height.values)
    estimate = Series(T_S, own + np.cumsum(runs) * 0.1)
    climb = Series(T_S, np.gradient(estimate.values, 0.1))
    shaken = Finding(
        Kind.VIBRATION, Sensor(SensorKind.IMU, 1), Severity.WARNING, 48.0, 60.0, 30.0, "m/s2",
        "vibration 30 m/s2", "", "vibration.imu1.1",
    )  # fmt: skip
    of_flight = flown(climb, Series(T_S, own), height_m=estimate)
    found, _ = told(of_flight._replace(findings=(shaken,)))
    assert found[HEIGHT_LOST].size == pytest.approx(30.0, abs=3.0)
    assert found[HEIGHT_LOST].cause == shaken.id
    assert Kind.BARO not in found


def test_what_follows_a_crash_in_the_same_flight_is_its_consequence():
    climb, height = fallen(12.0)
    again, lower = fallen(9.0, since_s=80.0)
    both = climb._replace(values=climb.values + again.values)
    sunk = height._replace(values=height.values + lower.values)
    analysis_of = flown(both, sunk, said=(Said(90.0, Severity.CRITICAL, "EKF failsafe: x"),))
    analysis = analyse(analysis_of)
    links = chain(analysis_of, analysis)
    first, second = sorted(
        (one for one in links.findings if one.kind is Kind.CRASH), key=lambda one: one.from_s
    )
    assert second.cause == first.id
    said = next(one for one in links.findings if one.kind is Kind.SAID_EKF_FAILED)
    assert said.cause == first.id
    assert "It met the ground again at 80 s." in verdict(analysis_of, analysis, links).text


def test_an_estimator_that_was_wrong_before_a_crash_is_said():
    wrong = Finding(
        Kind.AUTOPILOT_HEADING, Sensor(SensorKind.AUTOPILOT), Severity.WARNING,
        20.0, 30.0, 30.0, "deg", "", "",
    )  # fmt: skip
    crashed = flown(*fallen(12.0))
    text = told(crashed._replace(findings=(wrong,)))[1]
    assert "Before that, the autopilot's heading was wrong." in text
    text = told(crashed)[1]
    assert "Sensors and estimators that could be looked at were sound until then. Not " in text
    battery = Battery(1, T_S, *(np.full(len(T_S), one) for one in (12.0, 9.0, 0.8)))
    text = told(crashed._replace(context=crashed.context._replace(batteries=(battery,))))[1]
    assert "Sensors and estimators were sound until then. Not looked at" in text
