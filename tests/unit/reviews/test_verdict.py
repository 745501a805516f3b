"""The sentences of the verdict, for findings and endings that are given."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import imu_track, receiver_track
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Context, Motors, Said, Series, Span
from h2nav.reviews.estimators import RELEASED
from h2nav.reviews.evidence import Ending
from h2nav.reviews.impacts import Impact
from h2nav.reviews.subjects import control, impacts
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND
from h2nav.reviews.verdict import first_sentence, verdict

DEG = np.pi / 180.0
END_S, AT_S = 100.0, 60.0
T_S = np.arange(0.0, END_S, 0.1)
LOOKED = (impacts.SUBJECT.name, "battery")
COMPARED = (*LOOKED, control.SUBJECT.name)
DEMAND = Series(T_S, np.zeros((len(T_S), 3)))
IMU, COMPASS, GPS = (Sensor(kind) for kind in (SensorKind.IMU, SensorKind.COMPASS, SensorKind.GPS))
VEHICLE = Sensor(SensorKind.VEHICLE)


def finding(kind, sensor, from_s=30.0, text="", cause=None, severity=Severity.WARNING, size=1.0):
    id_ = f"{getattr(kind, 'value', kind)}.{from_s:.0f}"
    return Finding(kind, sensor, severity, from_s, from_s + 5.0, size, "", text, "", id_,
                   cause=cause)  # fmt: skip


CRASH = finding(Kind.CRASH, VEHICLE, AT_S)
LOST = finding(Kind.LOSS_OF_CONTROL, VEHICLE, 58.0, "roll +90 deg where +5 deg was demanded")
OF_FIELD = finding(Kind.COMPASS_FIELD, COMPASS)
OF_GPS = finding(Kind.GPS_VELOCITY, GPS, 31.0)
OF_AUTOPILOT = finding(Kind.AUTOPILOT_HEADING, Sensor(SensorKind.AUTOPILOT), 32.0)
BATTERY = finding(Kind.BATTERY, Sensor(SensorKind.BATTERY), 33.0, "the battery was low (9.2 V)")
SATURATED = finding(Kind.MOTOR_SATURATED, Sensor(SensorKind.MOTOR, 2), 34.0, "motor 2 at its limit")
OF_RADIO = finding(
    Kind.SAID_FAILSAFE, Sensor(SensorKind.AUTOPILOT), text="the autopilot said: radio failsafe"
)
PAUSED = finding(Kind.IMU_GAPS, IMU, 35.0, "gaps of the IMU")


def said(*found, speed_m_s=np.nan, tilt_deg=0.0, own=(), looked=LOOKED, blind=(), aloft=False,
         moving=False, **context):  # fmt: skip
    """The verdict's text."""
    blows = [Impact(one.from_s, one.to_s, 9.0, 1.0, tilt_deg * DEG, 0.0, 0.0, True, speed_m_s)
             for one in found if one.kind is Kind.CRASH]  # fmt: skip
    analysis = SimpleNamespace(
        blind=blind, looked_at=looked, ending=Ending(aloft, moving), impacts=blows
    )
    context = Context(**{"duration_s": END_S, "armed": (Span(1.0, 90.0, ""),), **context})
    links = SimpleNamespace(findings=tuple(found), own=frozenset(own))
    return verdict(SimpleNamespace(context=context), analysis, links).text


# --- no crash -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("found", "how", "text"),
    [
        ((), {}, f"Nothing was found wrong. Looked at: {LOOKED[0]}, battery."),
        ((), {"looked": ()}, "Nothing was found wrong in what could be looked at."),
        ((), {"blind": (("receiver", "not recorded"), ("battery", "too short"))},
         f"Nothing was found wrong in what could be looked at. Looked at: {LOOKED[0]}, battery. "
         "Not looked at: receiver (not recorded), battery (too short)."),
        # each reason once
        ((), {"blind": (("motors", "never armed"), ("GPS", "no receiver"), ("texts", "never armed"),
                        ("battery", "never armed"))},
         f"Nothing was found wrong in what could be looked at. Looked at: {LOOKED[0]}, battery. "
         "Not looked at: motors, texts and battery (never armed), GPS (no receiver)."),
        ((OF_FIELD,), {}, "No crash. The compass was disturbed."),
        ((OF_FIELD,), {"looked": ("battery",)}, "The compass was disturbed."),
        ((OF_FIELD,), {"own": ("compass_field.30",), "looked": ("battery",)},
         "Nothing was found wrong. Looked at: battery."),
        ((OF_FIELD, OF_GPS), {}, "No crash. The compass was disturbed and the GPS velocity was "
         "wrong."),
        ((OF_FIELD, OF_GPS, OF_AUTOPILOT, BATTERY), {},
         "No crash. The compass was disturbed, the GPS velocity was wrong and the autopilot's "
         "heading was wrong, and 1 more."),
        # notices, consequences, and what is of the recording beside worse
        ((OF_FIELD._replace(severity=Severity.NOTICE),), {"looked": ("battery",)},
         "Nothing was found wrong. Looked at: battery."),
        ((OF_FIELD, OF_GPS._replace(cause="compass_field.30")), {},
         "No crash. The compass was disturbed."),
        ((OF_FIELD, PAUSED), {}, "No crash. The compass was disturbed."),
        # of one kind the first only, and of motors each
        ((OF_FIELD, OF_FIELD._replace(from_s=40.0, sensor=Sensor(SensorKind.COMPASS, 2))), {},
         "No crash. The compass was disturbed."),
        ((finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 1), 20.0, "motor 1 was weak"),
          finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 2), 21.0, "motor 2 was weak")), {},
         "Motor 1 was weak and motor 2 was weak."),
        # what a battery led to
        ((BATTERY, SATURATED._replace(cause="battery.33")), {},
         "No crash. The battery was low (9.2 V), then thrust was lacking."),
        ((BATTERY, SATURATED._replace(cause="other")), {},
         "No crash. The battery was low (9.2 V)."),
        # once, also where they met their limit before or after that
        ((BATTERY, SATURATED._replace(cause="battery.33"), SATURATED._replace(from_s=60.0)), {},
         "No crash. The battery was low (9.2 V), then thrust was lacking."),
        ((SATURATED._replace(from_s=20.0), BATTERY, SATURATED._replace(cause="battery.33")), {},
         "No crash. Motor 2 at its limit and the battery was low (9.2 V)."),
    ],
)  # fmt: skip
def test_a_flight_without_a_crash(found, how, text):
    assert said(*found, **how) == text


def test_only_what_is_of_the_recording_is_told_too():
    assert said(PAUSED).startswith("No crash. ")
    assert not said(PAUSED).startswith("Nothing")


@pytest.mark.parametrize(
    ("note", "count", "share"),
    [
        ("rows of IMU far from the times around them", 1000, "50%"),
        ("rows of IMU2 far from the times around them", 112, "10%"),
        ("rows of IMU far from the times around them", 110, None),
        ("rows of sensor_combined far from the times around them", 3000, "75%"),
        ("rows of PARM far from the times around them", 3000, None),
        ("dropouts of the autopilot's logger", 3000, None),
    ],
)
def test_what_was_not_read_may_hold_a_crash(note, count, share):
    lost = f" Not looked at: {share} of the IMU's rows (their times do not fit)."
    known = {"notes": {note: count}, "imus": (imu_track(T_S),)}
    text = "The compass was disturbed."
    assert said(OF_FIELD, **known) == (text + lost if share else f"No crash. {text}")
    assert (" in what could be looked at. " in said(**known)) == (share is not None)


CHECK = finding(Kind.AUTOPILOT_CRASH_CHECK, Sensor(SensorKind.AUTOPILOT))
SAID_CRASH = (Said(30.0, Severity.CRITICAL, "Crash: Disarming"),)


def test_a_false_crash_check_is_said_to_be_false():
    assert said(CHECK) == "No crash: the autopilot's crash check was false."
    assert said(CHECK, OF_FIELD) == (
        "No crash: the autopilot's crash check was false. The compass was disturbed."
    )
    # against the autopilot's word nothing is said
    assert said(OF_FIELD, said=SAID_CRASH) == "The compass was disturbed."


@pytest.mark.parametrize(
    ("receivers", "armed", "is_told"),
    [((False,), True, True), ((False, True), True, False), ((), True, False),
     ((False,), False, False)],
)  # fmt: skip
def test_receivers_that_never_had_a_fix(receivers, armed, is_told):
    gps = tuple(receiver_track(T_S[:5], 0.0, has_fix) for has_fix in receivers)
    armed = (Span(1.0, 90.0, ""),) if armed else ()
    text = said(OF_FIELD, gps=gps, armed=armed)
    assert text.endswith(" The GPS never had a fix.") == is_told


ENDS_ARMED = {"armed": (Span(1.0, END_S, ""),)}


def height(above_m, sinks_m_s=0.0, count=1000):
    values = np.where(T_S > 5.0, above_m, 0.0) - sinks_m_s * np.maximum(T_S - 95.0, 0.0)
    return Series(T_S[-count:], values[-count:])


@pytest.mark.parametrize(
    ("how", "ending"),
    [
        ({"aloft": True, "moving": True}, "The log ends in flight."),
        ({"moving": True, "armed": (Span(1.0, 98.9, ""),)}, ""),
        ({"moving": True, "armed": (Span(1.0, 99.1, ""),)}, "The log ends in flight."),
        ({"moving": True, "vehicle_type": mavlink.MAV_TYPE_GROUND_ROVER}, ""),
        ({"aloft": True}, ""),
        ({"aloft": True, "baro_height_m": height(2.9)}, ""),
        ({"aloft": True, "baro_height_m": height(3.1)},
         "The log ends in the air, 3 m above where it began."),
        ({"moving": True, "baro_height_m": height(30.0)}, "The log ends in flight."),
        ({"aloft": True, "height_m": height(30.0)},
         "The log ends in the air, 30 m above where it began."),
        ({"aloft": True, "baro_height_m": height(30.0), "height_m": height(50.0)},
         "The log ends in the air, 30 m above where it began."),
        ({"aloft": True, "moving": True, "baro_height_m": height(30.0, count=9)},
         "The log ends in flight."),
        ({"aloft": True, "baro_height_m": height(40.0, 2.2)},
         "The log ends in the air, 30 m above where it began, sinking at 2 m/s."),
        ({"aloft": True, "baro_height_m": height(38.0, 1.8)},
         "The log ends in the air, 30 m above where it began."),
    ],
)  # fmt: skip
def test_a_log_that_ends_in_the_air(how, ending):
    looked = f"Looked at: {', '.join(LOOKED)}."
    begin = (
        f"{ending} Nothing was found wrong until then." if ending else "Nothing was found wrong."
    )
    assert said(**{**ENDS_ARMED, **how}) == f"{begin} {looked}"
    told = said(OF_FIELD, **{**ENDS_ARMED, **how})
    assert told == ("The compass was disturbed. " + ending if ending else
                    "No crash. The compass was disturbed.")  # fmt: skip


# --- a crash --------------------------------------------------------------------------------------

SOUND = "Sensors and estimators were sound until then."


@pytest.mark.parametrize(
    ("how", "first"),
    [
        ({}, "Crashed at 60 s."),
        ({"speed_m_s": 1.9}, "Crashed at 60 s."),
        ({"speed_m_s": 2.1}, "Crashed at 60 s with 2 m/s."),
        ({"speed_m_s": 12.0}, "Crashed at 60 s with 12 m/s."),
        ({"tilt_deg": 29.0}, "Crashed at 60 s."),
        ({"tilt_deg": 31.0}, "Crashed at 60 s and came to lie on its side."),
        ({"tilt_deg": 119.0}, "Crashed at 60 s and came to lie on its side."),
        ({"tilt_deg": 121.0}, "Crashed at 60 s and came to lie on its back."),
        # within four seconds of the ground
        ({"airborne": Series(np.array([0.0, 55.9]), np.array([0.0, 1.0]))}, "Crashed at 60 s."),
        ({"airborne": Series(np.array([0.0, 56.1]), np.array([0.0, 1.0]))},
         "Crashed on take-off at 60 s."),
        ({"airborne": Series(np.array([70.0]), np.array([0.0]))}, "Crashed on take-off at 60 s."),
        ({"airborne": Series(np.zeros(0), np.zeros(0))}, "Crashed at 60 s."),
        ({"demand": DEMAND, "looked": COMPARED},
         "Crashed at 60 s. Until the blow it followed its demand."),
        # nobody compared them, or not then, or they were rates
        ({"demand": DEMAND}, "Crashed at 60 s."),
        ({"demand": Series(T_S[:580], DEMAND.values[:580]), "looked": COMPARED},
         "Crashed at 60 s."),
        ({"demand": Series(T_S[595:], DEMAND.values[595:]), "looked": COMPARED},
         "Crashed at 60 s."),
        ({"demand": DEMAND, "looked": COMPARED, "modes": (Span(50.0, END_S, "Acro"),)},
         "Crashed at 60 s."),
    ],
)  # fmt: skip
def test_how_it_crashed(how, first):
    assert said(CRASH, **how) == f"{first} {SOUND}"


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ((LOST,), "Crashed at 60 s. Control was lost at 58 s: roll +90 deg where +5 deg was "
         f"demanded. {SOUND}"),
        ((finding(MOTORS_STOPPED, VEHICLE, 57.0, "all motors stopped"),),
         "All motors stopped at 57 s, then it crashed at 60 s. Nothing else was found wrong."),
        ((finding(FLOWN_INTO_GROUND, VEHICLE, 57.0),),
         "Flown into the ground by the pilot's demand at 60 s. Nothing else was found wrong."),
        ((BATTERY._replace(id="battery.57", from_s=57.0), LOST._replace(cause="battery.57")),
         "The battery was low (9.2 V) at 57 s, then control was lost, then it crashed at 60 s. "
         "Nothing else was found wrong."),
        ((SATURATED,), "Crashed at 60 s. Nothing else was found wrong."),
        ((finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 1), 50.0, "motor 1 was weak"),
          finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 2), 55.0, "motor 2 was weak"),
          finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 3), 61.0, "motor 3 was weak")),
         "Motor 1 was weak at 50 s, then motor 2 was weak at 55 s, then it crashed at 60 s. "
         "Nothing else was found wrong."),
        ((OF_FIELD,), "The compass was disturbed at 30 s, then it crashed at 60 s. "
         "Nothing else was found wrong."),
    ],
)  # fmt: skip
def test_what_led_to_a_crash(found, text):
    last = next(one for one in reversed(found) if one.from_s < AT_S)
    root = found[0] if found[0].kind is Kind.MOTOR_FAILED else last
    assert said(*found, CRASH._replace(cause=root.id)) == text


@pytest.mark.parametrize(
    ("found", "until"),
    [
        ((OF_FIELD,), "Before that, the compass was disturbed."),
        ((OF_FIELD._replace(from_s=58.4),), "Before that, the compass was disturbed."),
        ((OF_FIELD._replace(from_s=58.6),), SOUND),
        ((OF_FIELD._replace(severity=Severity.NOTICE),), SOUND),
        ((OF_FIELD._replace(cause="other"),), SOUND),
        ((PAUSED,), SOUND),
        ((OF_AUTOPILOT,), "Before that, the autopilot's heading was wrong."),
        ((OF_FIELD, OF_AUTOPILOT), "Before that, the compass was disturbed."),
        ((OF_RADIO,), "Before that, the autopilot said: radio failsafe."),
        ((OF_RADIO._replace(cause="other"),), SOUND),
        ((OF_FIELD, OF_GPS, BATTERY, finding(Kind.BARO, Sensor(SensorKind.BAROMETER), size=0.0)),
         "Before that, the compass was disturbed, the GPS velocity was wrong and the battery was "
         "low (9.2 V)."),
        ((finding(Kind.MOTOR_IMBALANCE, Sensor(SensorKind.MOTOR, 1), text="motor 1 was uneven"),
          OF_FIELD), "Before that, motor 1 was uneven and the compass was disturbed."),
    ],
)  # fmt: skip
def test_what_was_wrong_before_a_crash(found, until):
    assert said(*found, CRASH) == f"Crashed at 60 s. {until}"


def test_crashes_that_follow_a_first_one():
    again = finding(Kind.CRASH, VEHICLE, 70.0, cause=CRASH.id)
    assert said(CRASH, again) == f"Crashed at 60 s. It met the ground again at 70 s. {SOUND}"
    other = again._replace(cause=None)
    assert said(other, CRASH) == f"Crashed at 60 s. Crashed at 70 s. {SOUND}"


FALLS = finding(RELEASED, Sensor(SensorKind.AUTOPILOT), 51.0,
                "the autopilot said: parachute released", "motor_failed.50")  # fmt: skip
WEAK = finding(Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 1), 50.0, "motor 1 was weak")
LANDED = finding(Kind.HARD_LANDING, VEHICLE, 55.0, "landed hard: 9 g")


@pytest.mark.parametrize(
    ("found", "first"),
    [
        ((CRASH._replace(cause=WEAK.id),), " at 50 s, then the parachute was released, then it "
         "crashed at 60 s."),
        ((LOST._replace(cause=WEAK.id, from_s=51.0),), " at 50 s, then control was lost at 51 s: "
         "roll +90 deg where +5 deg was demanded, then the parachute was released."),
        ((LANDED,), ", then the parachute was released and it landed hard: 9 g at 55 s."),
    ],
)  # fmt: skip
def test_a_parachute_is_told_after_what_released_it(found, first):
    assert first_sentence(said(WEAK, FALLS, *found))[0] == f"Motor 1 was weak{first}"
    assert "parachute" not in said(WEAK, FALLS._replace(cause="other"), *found)


def test_a_loss_of_control_without_a_crash():
    assert said(LOST, OF_FIELD) == (
        "Control was lost at 58 s: roll +90 deg where +5 deg was demanded. "
        "Before that, the compass was disturbed."
    )
    assert said(LOST._replace(cause="x"), OF_FIELD) == "No crash. The compass was disturbed."


def test_a_loss_of_control_with_its_cause_without_a_crash():
    lost = LOST._replace(cause="compass_field.30")
    assert said(lost, OF_FIELD, BATTERY) == (
        "The compass was disturbed at 30 s, then control was lost at 58 s: roll +90 deg where +5 "
        "deg was demanded. Before that, the battery was low (9.2 V)."
    )
    assert said(lost, OF_FIELD) == (
        "The compass was disturbed at 30 s, then control was lost at 58 s: roll +90 deg where +5 "
        "deg was demanded."
    )
    # a note of it is none
    note = lost._replace(severity=Severity.NOTICE)
    assert said(note, OF_FIELD) == "No crash. The compass was disturbed."


@pytest.mark.parametrize(
    ("throttle", "span_s", "told"),
    [
        (0.98, (56.0, 56.6), ", throttle at 100 %"),
        (0.96, (56.0, 56.6), ""),
        (0.98, (56.0, 56.4), ""),
        (0.98, (59.4, 61.0), ", throttle at 100 %"),
        (0.98, (59.6, 61.0), ""),
        (0.01, (57.0, 59.0), ", throttle at 0 %"),
        (0.03, (57.0, 59.0), ""),
        (0.01, (57.0, 57.8), ""),
    ],
)
def test_the_throttle_as_control_was_lost(throttle, span_s, told):
    from_s, to_s = span_s
    inside = (from_s - 0.01 < T_S) & (to_s + 0.01 > T_S)
    text = said(LOST, throttle=Series(T_S, np.where(inside, throttle, 0.5)))
    assert text == f"Control was lost at 58 s: {LOST.text}{told}. {SOUND}"


@pytest.mark.parametrize(
    ("shares", "at_s", "told"),
    [
        ((1.0, 0.5, 0.5), 57.0, ", motor 1 at its limit"),
        ((1.0, 0.5, 1.0), 57.0, ", motors 1 and 4 at their limit"),
        ((1.0, 1.0, 1.0), 57.0, ", motors 1, 3 and 4 at their limit"),
        ((1.0, 0.5, 0.5), 56.6, ", motor 1 at its limit"),
        ((1.0, 0.5, 0.5), 56.4, ""),
        ((1.0, 0.5, 0.5), 58.4, ", motor 1 at its limit"),
        ((1.0, 0.5, 0.5), 58.6, ""),
        ((0.9, 0.5, 0.5), 57.0, ""),
    ],
)
def test_motors_at_their_limit_as_control_was_lost(shares, at_s, told):
    outputs = np.full((len(T_S), 3), 1500.0)
    outputs[round(10 * at_s)] = 1000.0 + 1000.0 * np.array(shares)
    text = said(LOST, motors=Motors((1, 3, 4), T_S, outputs, 1000.0, 2000.0))
    assert text == f"Control was lost at 58 s: {LOST.text}{told}. {SOUND}"


def test_motors_that_are_one_finding_are_named_together():
    sensor = Sensor(SensorKind.MOTOR, 1, (3, 4))
    for one, several in (
        ("motor 1 at its limit", "Motors 1, 3 and 4 at their limit"),
        ("motor 1 was uneven", "Motors 1, 3 and 4 were uneven"),
    ):
        assert said(finding(Kind.MOTOR_IMBALANCE, sensor, text=one)) == f"No crash. {several}."


def test_the_first_sentence():
    assert first_sentence("One. Two. Three.") == ("One.", "Two. Three.")
    assert first_sentence("One.") == ("One.", "")
