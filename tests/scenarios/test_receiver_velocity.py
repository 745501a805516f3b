"""The receiver's velocity on its way to the filter: the vehicle's own, and only a good one."""

import json
import math

import pytest
from mcap.reader import make_reader
from motion_flights import altered
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import START_NS, SimulatedFlight

from h2nav.log.recorder import Recorder
from h2nav.sim.personalities import ARDUPILOT
from h2nav.sim.scenarios import scenario

FLOWN = "aggressive"
END_S = 9.0
# The fake receiver errs by 0.05 m/s (one sigma, per axis); the fix is a few milliseconds old.
APART_M_S = 0.4


def told(folder, **changed):
    """(time of arrival in s, record) of each velocity that the filter was told.

    Args:
        folder: for the log.
        changed: fields of every GPS_RAW_INT that say something else.
    """

    def change(_t_s, message):
        for name, value in changed.items():
            setattr(message, name, value)
        return message

    gps = mavlink.MAVLink_gps_raw_int_message
    streams = tuple(
        altered(stream, change) if stream.message is gps else stream for stream in ARDUPILOT.streams
    )
    path = folder / "flight.mcap"
    with Recorder.to_file(path) as recorder:
        receiver = ARDUPILOT._replace(streams=streams)
        SimulatedFlight(FLOWN, personality=receiver, recorder=recorder).run(END_S)
    with path.open("rb") as file:
        rows = [
            ((message.log_time - START_NS) * 1e-9, json.loads(message.data))
            for _, _, message in make_reader(file).iter_messages(["/aiding"])
        ]
    return [(t_s, row) for t_s, row in rows if row["kind"] == "velocity"]


def test_it_is_the_velocity_of_the_vehicle(tmp_path):
    """In NED and m/s, at up to 11 m/s in changing directions; with the accuracy that was stated."""
    rows = told(tmp_path, vel_acc=250)
    fastest_m_s = 0.0
    for t_s, row in rows:
        north, east, _ = scenario(FLOWN).motion(t_s).v_n
        assert math.dist((row["north_m_s"], row["east_m_s"]), (north, east)) < APART_M_S
        assert row["sigma_m_s"] == pytest.approx(0.25)
        assert row["independent"]
        fastest_m_s = max(fastest_m_s, math.hypot(north, east))
    assert fastest_m_s > 5.0
    assert len(rows) > 20


def test_a_receiver_that_states_no_accuracy_is_taken_at_half_a_metre_per_second(tmp_path):
    rows = told(tmp_path, vel_acc=0)
    assert len(rows) > 20
    assert {row["sigma_m_s"] for _, row in rows} == {0.5}


@pytest.mark.parametrize(("accuracy_mm_s", "is_used"), [(2990, True), (3010, False)])
def test_beyond_3_m_s_it_is_not_used(tmp_path, accuracy_mm_s, is_used):
    assert bool(told(tmp_path, vel_acc=accuracy_mm_s)) == is_used


@pytest.mark.parametrize(
    "lacking",
    [
        {"fix_type": mavlink.GPS_FIX_TYPE_2D_FIX},
        {"vel": 65_535},
        {"cog": 65_535},
    ],
    ids=["fix", "speed", "course"],
)
def test_without_fix_speed_or_course_it_is_not_used(tmp_path, lacking):
    assert told(tmp_path, **lacking) == []
