"""The status of a flight, as somebody who looks on gets it."""

import math

import pytest
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SimulatedFlight

from h2nav.apps.configuration import Configuration
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.preflight import GroundFault, GroundVerdict, Item
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_witness import VelocityVerdict, Verdicts
from h2nav.integrity.witness import AttitudeSource, Comparison
from h2nav.log.schema import record_format
from h2nav.maths import quaternion
from h2nav.service.comparing import LatestReport
from h2nav.service.health import ServiceState, StateVerdict
from h2nav.service.outputs import Assessment
from h2nav.service.records import StatusRecord
from h2nav.service.settings import AutopilotSettings
from h2nav.service.status import status_record

QUIET = Configuration(autopilot=AutopilotSettings(compare_rate_hz=0.0))


def status(flight):
    return flight.pipeline.service.status(flight.t_ns)


def test_before_anything_is_known_it_says_so():
    told = status(SimulatedFlight("rest"))
    assert told.state == "no_autopilot"
    assert told.vehicle == told.autopilot_source == told.alarms == ""
    assert told.age_ms is None
    assert told.autopilot_q_w is None
    assert told.tilt_deg is None
    assert math.isnan(told.velocity_ratio)


@pytest.mark.thorough
def test_both_attitudes_their_difference_and_the_ratios_are_there():
    flight = SimulatedFlight("hover").run(30.0)
    told = status(flight)
    assert told.state == "active"
    assert "ArduPilot" in told.vehicle
    assert 0.0 <= told.age_ms < 100.0
    assert 0.0 <= told.autopilot_age_ms < 1000.0
    assert told.autopilot_source == "autopilot"
    theirs = told.autopilot_q_w, told.autopilot_q_x, told.autopilot_q_y, told.autopilot_q_z
    _, ours = flight.seen.estimates[-1]
    turn = quaternion.multiply(
        theirs, quaternion.conjugate((ours.q_w, ours.q_x, ours.q_y, ours.q_z))
    )
    assert 2.0 * math.acos(min(1.0, abs(turn[0]))) < 10.0 * DEG
    assert told.sigma_tilt_deg > 0.0
    assert abs(told.tilt_deg) < 5.0
    assert told.tilt_verdict in ("h2nav", "autopilot", "undecided")
    assert 0.0 <= told.velocity_ratio < 1.0


def test_an_attitude_that_was_told_long_ago_is_not_told_again():
    flight = SimulatedFlight("rest", configuration=QUIET).run(10.0)
    assert status(flight).autopilot_q_w is None
    flight.inject(mavlink.MAVLink_ahrs2_message(0.1, 0.2, 0.3, 0.0, 0, 0))
    assert status(flight).autopilot_source == "AHRS2"
    flight.inject(mavlink.MAVLink_attitude_message(10_000, 0.1, 0.2, 0.3, 0, 0, 0))
    told = status(flight)
    assert told.autopilot_source == "autopilot"
    assert (told.autopilot_q_w, told.autopilot_q_x) == pytest.approx(
        quaternion.from_euler(0.1, 0.2, 0.3)[:2]
    )
    flight.run(13.0)
    assert status(flight).autopilot_q_w is None


@pytest.mark.thorough
def test_what_is_wrong_is_named():
    flight = SimulatedFlight("hover", faults=("stuck=gyro-x@20",)).run(30.0)
    told = status(flight)
    assert told.state == "degraded"
    found = {finding.text for finding in flight.pipeline.service.findings}
    assert found
    assert {line.removeprefix("IMU 1: ") for line in told.alarms.splitlines()} & found


def test_it_is_a_record_that_viewers_can_have():
    flight = SimulatedFlight("rest").run(5.0)
    form = record_format(StatusRecord)
    assert form.name == "h2nav.StatusRecord"
    assert b'"state":"' in form.encode(status(flight))


def test_what_came_after_the_round_began_has_no_negative_age():
    flight = SimulatedFlight("rest").run(5.0)
    told = flight.pipeline.service.status(0)
    assert told.age_ms == 0.0


def test_each_part_of_a_moment_has_its_place():
    reported = LatestReport(9_000_000, AttitudeSource.AHRS2, (0.1, 0.2, 0.3, 0.4))
    difference = Comparison(
        5, AttitudeSource.AUTOPILOT, 0.1, -0.2, 0.3, 0.4,
        Verdicts(VelocityVerdict.H2NAV, VelocityVerdict.AUTOPILOT),
    )  # fmt: skip
    alarms = tuple(
        Alarm(Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, n), Severity.ERROR, 1.0, "s", "frozen", "")
        for n in (1, 2)
    )
    ground = GroundVerdict((GroundFault(Item.GYRO, "IMU 1", 4.0, "deg/s", 2.0),) * 2)
    ratios = InnovationRatios(velocity_1s=0.1, velocity_10s=0.2, force_10s=0.3)
    record = status_record(
        10_500_000,
        StateVerdict(ServiceState.DEGRADED, "cause", "why"),
        "ArduPilot quadrotor 1/1",
        10_000_000,
        reported,
        Assessment(ratios, alarms, difference, ground),
    )
    assert (record.state, record.reason, record.vehicle) == (
        "degraded",
        "why",
        "ArduPilot quadrotor 1/1",
    )
    assert (record.age_ms, record.autopilot_age_ms) == (0.5, 1.5)
    q_nb = record.autopilot_q_w, record.autopilot_q_x, record.autopilot_q_y, record.autopilot_q_z
    assert q_nb == (0.1, 0.2, 0.3, 0.4)
    assert record.autopilot_source == "AHRS2"
    angles = record.tilt_deg, record.heading_deg, record.sigma_tilt_deg, record.sigma_heading_deg
    assert angles == pytest.approx((5.7296, -11.4592, 17.1887, 22.9183), abs=1e-4)
    assert (record.tilt_verdict, record.heading_verdict) == ("h2nav", "autopilot")
    assert (record.velocity_ratio, record.force_ratio) == (0.2, 0.3)
    assert record.alarms == "IMU 1: frozen\nIMU 2: frozen"
    assert record.preflight == "\n".join(["gyro 1 turns 4.0 deg/s at rest"] * 2)
