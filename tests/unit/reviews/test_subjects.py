"""What the subjects declare is complete, and shown by pictures that exist."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, imu_track, receiver_track
from made_flight import made_analysis, made_flight, page_of
from needs import tool
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from reviewed_flights import flight

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import MEANINGS, FlightKind
from h2nav.recordings.context import (
    Battery,
    Context,
    ReportedFault,
    Said,
    Series,
    Span,
    VibrationTrack,
)
from h2nav.reviews import evidence as parts
from h2nav.reviews.analysis import analyse
from h2nav.reviews.declared import FlightEvidence
from h2nav.reviews.subjects import KINDS, SECTIONS, SUBJECTS, needs


def test_every_kind_is_declared_once():
    declared = [one.kind for subject in SUBJECTS for one in subject.kinds]
    assert len(declared) == len(set(declared))
    assert set(Kind) <= set(declared)
    assert all(KINDS[kind].meaning is meaning for kind, meaning in MEANINGS.items())


def test_what_a_kind_follows_from_is_declared_too():
    for one in KINDS.values():
        assert {*one.follows, *(by for by, _ in one.brought)} <= set(KINDS)


def test_a_kind_says_what_it_means_and_what_to_check():
    silent = [kind for kind, one in KINDS.items() if not one.meaning.means and "said" not in kind]
    assert not silent
    assert all(one.meaning.check for one in KINDS.values())


def test_every_kind_leads_to_pictures_that_are_in_the_page():
    flown = made_flight(60.0, 50.0)
    sections = set(re.findall(r'<section id="(\w+)">', page_of(flown, made_analysis(flown))))
    assert set(SECTIONS.values()) <= sections
    assert SECTIONS["said_crash"] == "timeline"


def test_the_documents_table_is_made_of_the_declarations():
    tables = tool("finding_tables")
    text = tables.PAGE.read_text(encoding="utf-8")
    assert text == tables.page(text), "run python tools/finding_tables.py"


def test_a_kind_of_a_flight_is_known_by_its_name_like_any_other():
    kind = FlightKind("touchdown")
    assert (kind.value, f"{kind}") == ("touchdown", "touchdown")
    assert Kind.CRASH != kind != FlightKind("crash")


@pytest.mark.parametrize(
    ("kind", "numbers", "said"),
    [
        (Kind.GYRO_BIAS, (2,), "gyro 2 turned at 7 deg/s while it stood still"),
        (Kind.GYRO_BIAS, (1, 3), "gyros 1 and 3 turned at 7 deg/s while it stood still"),
        (Kind.GYRO_BIAS, (), "gyro turned at 7 deg/s while it stood still"),
        (Kind.ACCELEROMETER_SCALE, (1,), "accelerometer 1 was off by 1 % at rest"),
        (Kind.ACCELEROMETER_SCALE, (1, 2), "accelerometers 1 and 2 were off by 1 % at rest"),
        (Kind.COMPASS_DEAD, (1, 2, 3), "compasses 1, 2 and 3 measured nothing"),
        (Kind.COMPASS_STEP, (1,), "a magnetic disturbance came or went"),
        (Kind.COMPASS_STEP, (1, 2, 3), "compasses 1, 2 and 3 changed together at 5 s, while the "
         "attitude by gyro and velocity stayed"),
    ],
)  # fmt: skip
def test_one_sensor_or_several_in_a_sentence(kind, numbers, said):
    sensor = Sensor(SensorKind.IMU, next(iter(numbers), None), numbers[1:])
    one = Finding(kind, sensor, Severity.ERROR, 5.0, 9.0, 7.0, "", "", "")
    assert KINDS[kind].phrase(one) == said


def test_evidence_is_worked_out_once():
    asked = []

    def part(evidence):
        asked.append(evidence.flight.name)
        return len(asked)

    evidence = FlightEvidence(flight())
    assert evidence.of(part) == evidence.of(part) == 1


def a_step(imu):
    sensor = Sensor(SensorKind.IMU, imu)
    return Finding(
        Kind.ACCELEROMETER_BIAS_STEP, sensor, Severity.WARNING, 50.0, 60.0, 2.0, "m/s^2", "", ""
    )


@pytest.mark.parametrize("imu", [1, 2])
def test_a_receiver_is_judged_by_force_and_rest_of_the_same_sound_imu(imu):
    """An accelerometer that jumped judges no receiver, nor does its gravity at rest."""
    flown = flight(imus=3)
    evidence = FlightEvidence(flown)
    evidence._known[parts.force_steps] = [a_step(imu)]
    track = evidence.of(parts.witness)
    assert track.imu + 1 != imu
    assert parts.at_rest(evidence, track) is evidence.of(parts.rests)[track.imu]


@pytest.mark.parametrize("kind", [Kind.IMU_FROZEN, Kind.GYRO_FROZEN, Kind.AXIS_STUCK])
def test_what_a_sensor_repeats_while_it_is_frozen_is_no_rest(kind):
    """In a turn: 50 deg/s, and more than gravity."""
    flown = flight(imus=2)
    first, second = flown.context.imus
    froze = (first.t_s > 60.0) & (first.t_s < 80.0)
    first.w_b[froze], first.f_b[froze] = (0.3, 0.2, 0.8), (1.0, 2.0, -12.0)
    imu = Sensor(SensorKind.IMU, 1)
    frozen = Finding(kind, imu, Severity.WARNING, 60.0, 80.0, 1.0, "", "", "")
    flown = flown._replace(context=flown.context._replace(imus=(first, second), gps=()))
    rested = {
        found: FlightEvidence(flown._replace(findings=found)).of(parts.rests)[0].t_s
        for found in ((), (frozen,))
    }
    inside = {found: ((t_s > 57.0) & (t_s < 80.0)).sum() for found, t_s in rested.items()}
    assert inside[()] > 5
    assert inside[(frozen,)] == 0


def test_where_every_accelerometer_jumped_none_judges_the_receiver():
    evidence = FlightEvidence(flight(imus=2))
    evidence._known[parts.force_steps] = [a_step(1), a_step(2)]
    assert evidence.of(parts.witness) is None


def test_a_recording_without_anything_names_what_could_not_be_looked_at():
    empty = flight()
    blind = analyse(empty._replace(context=empty.context._replace(imus=(), motors=None)))
    assert dict(blind.blind)["motors"]
    assert "motors" not in blind.looked_at


@pytest.mark.parametrize(
    ("kind", "why", "looked_at"),
    [("dataflash", "never armed", {"IMUs", "compasses", "GPS"}),
     ("bytes", "no times of arrival", set())],
)  # fmt: skip
def test_what_is_looked_at_while_it_is_armed_alone(kind, why, looked_at):
    made = flight(armed=())
    evidence = FlightEvidence(made._replace(kind=kind))
    told = {subject.name: subject.lacks(evidence) for subject in SUBJECTS if subject.is_told}
    assert {name for name, lacks in told.items() if not lacks} == looked_at
    assert told["vibration"] == told["the autopilot's estimators"] == why


def test_an_autopilot_that_said_nothing_may_not_have_been_heard():
    silent = flight()
    assert "texts of the autopilot" in dict(analyse(silent).blind)
    said = silent._replace(
        context=silent.context._replace(said=(Said(1.0, Severity.INFO, "ready"),))
    )
    assert "texts of the autopilot" in analyse(said).looked_at


@pytest.mark.parametrize(("demand_s", "attitude_s", "why"), [
    (0.2, 0.2, ""),
    (0.25, 0.1, "4.0 a second are too seldom"),
    (0.1, 0.5, "2.0 a second are too seldom"),
    (200.0, 0.1, "0.0 a second are too seldom"),  # one alone
])  # fmt: skip
def test_seldom_attitudes_do_not_show_whether_they_follow_a_demand(demand_s, attitude_s, why):
    made = flight()
    known = made.context.attitudes[0]
    demand_t_s, t_s = np.arange(0.0, 100.0, demand_s), np.arange(0.0, 100.0, attitude_s)
    context = made.context._replace(
        demand=Series(demand_t_s, np.zeros((len(demand_t_s), 3))),
        attitudes=(known._replace(t_s=t_s, q_nb=np.tile(known.q_nb[0], (len(t_s), 1))),),
    )
    assert needs.demand(FlightEvidence(made._replace(context=context))) == why


def test_what_a_compass_lacks_to_be_judged_is_said():
    flown = flight()
    assert needs.compass(FlightEvidence(flown)) == ""
    blind = flown._replace(context=flown.context._replace(imus=()))
    assert needs.compass(FlightEvidence(blind)) == "no compass"
    lost = flown._replace(estimates=None, smoothed=None)
    lost = lost._replace(context=lost.context._replace(attitudes=()))
    assert needs.compass(FlightEvidence(lost)) == "no attitude to judge them by"
    placeless = flown._replace(earth=flown.earth._replace(t_s=flown.earth.t_s[:0]))
    assert needs.compass(FlightEvidence(placeless)).startswith("no place")


T_S = np.arange(3.0)
ARMED = (Span(0.0, 3.0, "armed"),)
UNKNOWN = np.full(3, math.nan)
LOW = "Battery 1 is low"


def recorded(**context):
    return {parts.recorded: Context(**context)}


def battery(voltage_v):
    return recorded(batteries=(Battery(0, T_S, voltage_v, UNKNOWN, UNKNOWN),))


def measured(level):
    return VibrationTrack(0, T_S, np.full((3, 3), level), np.zeros(3))


@pytest.mark.parametrize(
    ("need", "known", "why"),
    [
        (needs.times, {parts.has_times: True}, ""),
        (needs.times, {parts.has_times: False}, "no times of arrival"),
        (needs.imu, {parts.sampled: (imu_track(T_S),)}, ""),
        (needs.imu, {parts.sampled: ()}, "no IMU samples"),
        (needs.armed, recorded(armed=ARMED), ""),
        (needs.armed, recorded(), "never armed"),
        (needs.flight, recorded(), "never armed"),
        (needs.flight, recorded(armed=ARMED) | {parts.flown: True}, ""),
        (needs.flight, recorded(armed=ARMED) | {parts.flown: False, parts.rose: True},
         "it hardly moved in the air"),
        (needs.flight, recorded(armed=ARMED) | {parts.flown: False, parts.rose: False},
         "it did not fly"),
        (needs.hovers, recorded(vehicle_type=mavlink.MAV_TYPE_HEXAROTOR), ""),
        (needs.hovers, recorded(vehicle_type=mavlink.MAV_TYPE_FIXED_WING), "no multirotor"),
        (needs.lands, recorded(vehicle_type=mavlink.MAV_TYPE_FIXED_WING), ""),
        (needs.lands, recorded(vehicle_type=mavlink.MAV_TYPE_SUBMARINE),
         "it neither takes off nor lands"),
        (needs.motors, recorded(motors=SimpleNamespace()), ""),
        (needs.motors, recorded(), "no motor outputs"),
        (needs.demand, recorded(attitudes=(SimpleNamespace(t_s=T_S),)), "no demands"),
        (needs.demand, recorded(demand=Series(T_S, T_S)), "no attitude of the autopilot"),
        (needs.battery, battery(np.array([math.nan, 12.0, math.nan])), ""),
        (needs.battery, battery(UNKNOWN), "no battery"),
        (needs.battery, recorded(said=(Said(1.0, Severity.WARNING, LOW),), armed=ARMED), ""),
        (needs.battery, recorded(said=(Said(1.0, Severity.WARNING, "ready"),), armed=ARMED),
         "no battery"),
        (needs.barometer, recorded(baro_height_m=Series(T_S, T_S)), ""),
        (needs.barometer, recorded(height_m=Series(T_S, T_S)), "no barometer"),
        (needs.texts, recorded(said=(Said(1.0, Severity.INFO, "ready"),)), ""),
        (needs.texts, recorded(faults=(ReportedFault(1.0, "gps", 1, "a fault"),)), ""),
        (needs.texts, recorded(), "none was recorded"),
        (needs.attitudes, recorded(attitudes=(SimpleNamespace(t_s=T_S),)), ""),
        (needs.attitudes, recorded(), "no attitude of the autopilot"),
        (needs.fix, recorded(gps=(receiver_track(T_S[:0], 0.0), receiver_track(T_S, 0.0))), ""),
        (needs.fix, recorded(gps=(receiver_track(T_S[:0], 0.0),)), "no receiver"),
        (needs.impact, {parts.rate_hz: 45.0, parts.vertical: ()}, ""),
        (needs.impact, {parts.rate_hz: 44.4, parts.vertical: ("one", "another")}, ""),
        (needs.impact, {parts.rate_hz: 44.4, parts.vertical: ("one",)},
         "44 samples a second show no blow, and two heights were not logged"),
        (needs.shaking, {parts.rate_hz: 20.0}, ""),
        (needs.shaking, {parts.rate_hz: 19.4}, "19 samples a second show none"),
        (needs.vibration, {parts.vibes: (measured(math.nan), measured(1.0))}, ""),
        (needs.vibration, {parts.vibes: (measured(math.nan),), parts.rate_hz: 4.0},
         "4 samples a second show none"),
        (needs.vibration, {parts.vibes: (), parts.rate_hz: 25.0}, ""),
    ],
)  # fmt: skip
def test_what_a_subject_lacks_is_said_and_nothing_where_it_is_there(need, known, why):
    assert need(KnownEvidence(known)) == why
