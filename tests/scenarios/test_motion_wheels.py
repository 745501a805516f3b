"""Wheel odometry in the whole pipeline: a rover's WHEEL_DISTANCE in, ODOMETRY out."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from lanes import few, few_rows
from motion_flights import altered, is_finite, odometry
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.motion.settings import OdometrySettings
from h2nav.service.settings import MotionSettings
from h2nav.sim.drives import TRACK_M
from h2nav.sim.scenarios import scenario
from h2nav.sim.wheel_streams import SLIP_M_RTM, wheel_stream

# Ellipse that holds 99.73 % of a plane normal distribution, as sigmas.
RADIUS = 3.44
ROVER = dataclasses.replace(
    SIMULATED,
    motion=MotionSettings("wheels"),
    odometry=OdometrySettings(track_m=TRACK_M, slip_wheel_m_rtm=SLIP_M_RTM, slip_side_m_rtm=1e-3),
)
LENGTH_S = {"half-circle": 9.0, "figure-eight": 23.0, "square": 27.0}


def drive(name, change=None, seed=1, faults=()):
    """A drive until the rover stands again; `change` alters its wheel distances."""
    flown, extra = scenario(name), ()
    if change is not None:
        extra = (altered(wheel_stream(flown.wheels_at, seed), change),)
        flown = flown._replace(wheels_at=None)
    flight = SimulatedFlight(
        flown, configuration=ROVER, seed=seed, extra_streams=extra, faults=faults
    )
    return flight.run(LENGTH_S[name])


def offset(flight, message):
    """Distance of an ODOMETRY from the truth in sigmas of its covariance, and in metres."""
    north, east, _ = flight.autopilot.vehicle.scenario.motion(message.time_usec * 1e-6).p_n
    d = np.array([message.x - north, message.y - east])
    c = message.pose_covariance
    P = np.array([[c[0], c[1]], [c[1], c[6]]])
    return math.sqrt(d @ np.linalg.solve(P, d)), math.hypot(*d)


@pytest.mark.parametrize("name", few(1, LENGTH_S))
def test_the_rover_comes_back_within_its_covariance(name):
    """Half circle, figure eight, square: every ODOMETRY inside 3.44 sigma, 20 Hz, no reset.

    The end is off by less than 0.25 m.
    """
    flight = drive(name)
    sent = odometry(flight)
    assert len(sent) == pytest.approx(20.0 * (LENGTH_S[name] - sent[0][0]), abs=3)
    _, last = sent[-1]
    sigmas, metres = offset(flight, last)
    assert sigmas < RADIUS
    assert metres < 0.25
    assert {message.reset_counter for _, message in sent} == {0}
    assert last.frame_id == mavlink.MAV_FRAME_LOCAL_FRD
    assert last.child_frame_id == mavlink.MAV_FRAME_BODY_FRD
    assert abs(last.time_usec * 1e-6 - flight.t_s) < 0.1
    assert flight.rejected == {}


def test_speed_and_turn_are_those_of_the_rover():
    """Halfway round the half circle: velocity ahead and turn rate within 5 %, body FRD."""
    flight = drive("half-circle")
    _, message = min(odometry(flight), key=lambda one: abs(one[0] - 5.0))
    # The message's twist is the mean over 50 ms.
    middle = flight.autopilot.vehicle.scenario.motion(message.time_usec * 1e-6 - 0.025)
    assert message.vx == pytest.approx(math.hypot(*middle.v_n), rel=0.05)
    assert message.yawspeed == pytest.approx(middle.w_b[2], rel=0.05)
    assert message.vy == pytest.approx(0.0, abs=1e-6)


def test_lost_frames_cost_nothing():
    """Half of all frames lost: counters are cumulative, so the end is where it was."""
    flight = drive("half-circle", faults=("drop=0.5@3",))
    sigmas, _ = offset(flight, odometry(flight)[-1][1])
    assert sigmas < RADIUS
    assert odometry(flight)[-1][1].reset_counter == 0


def test_a_counter_that_jumps_moves_nothing():
    """A counter set back to zero at 5 s: reset_counter + 1, no jump of the pose."""

    def change(t_s, message):
        if t_s > 5.0:
            message.distance = [way - 1e3 for way in message.distance]
        return message

    flight = drive("half-circle", change)
    sent = [message for _, message in odometry(flight)]
    assert sent[-1].reset_counter == 1
    assert flight.rejected["wheels_jump"] == 1
    steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(sent)]
    assert max(steps) < 0.3
    _, metres = offset(flight, sent[-1])
    assert metres < 0.5  # one interval of 50 ms is lost


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    few_rows(
        2,
        [
            ("distance", lambda m: [math.nan, *m.distance[1:]], "wheels_not_finite"),
            ("distance", lambda m: [math.inf, *m.distance[1:]], "wheels_not_finite"),
            ("count", lambda _m: 1, "wheels_not_finite"),
            ("time_usec", lambda m: m.time_usec - 500_000, "wheels_not_later"),
            ("time_usec", lambda _m: 1, "wheels_stray_time"),
        ],
    ),
)
def test_bad_readings_between_good_ones_are_counted_and_do_no_harm(field, value, reason):
    """Every third reading is damaged: counted by its reason; the next one spans the interval."""

    def change(t_s, message):
        if t_s > 3.0 and round(t_s * 20.0) % 3 == 0:
            setattr(message, field, value(message))
        return message

    flight = drive("half-circle", change)
    assert flight.rejected[reason] > 20
    assert all(is_finite(message) for _, message in odometry(flight))
    sigmas, _ = offset(flight, odometry(flight)[-1][1])
    assert sigmas < RADIUS
    assert odometry(flight)[-1][1].reset_counter == 0


def test_silent_wheels_are_told_of_and_the_way_is_not_lost():
    """No distances from 4 s to 8 s: a warning, no ODOMETRY, then on with the whole way."""

    def change(t_s, message):
        return None if 4.0 < t_s < 8.0 else message

    flight = drive("half-circle", change)
    assert odometry(flight, 4.1, 8.0) == []
    assert 6.0 < flight.first("no ODOMETRY: no wheel distances") < 7.0
    assert odometry(flight)[-1][1].x == pytest.approx(0.0, abs=3.0)
    assert odometry(flight)[-1][1].reset_counter == 0


def test_a_reboot_keeps_the_pose():
    """The autopilot reboots while the rover stands at its end: the pose stays, one reset."""
    flight = drive("half-circle", faults=("reboot@9",))
    before = odometry(flight)[-1][1]
    flight.run(13.0)
    back = odometry(flight, 9.5)
    assert back != []
    assert back[-1][1].reset_counter == 1
    assert math.dist((before.x, before.y), (back[-1][1].x, back[-1][1].y)) < 0.01
