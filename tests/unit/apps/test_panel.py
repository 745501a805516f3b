"""The words of the live panel."""

import math
from pathlib import Path

import pytest

from h2nav.apps.panel import LogSight, Sight, panel_lines
from h2nav.log.recorder import RecorderRecord
from h2nav.maths import quaternion
from h2nav.service.records import EstimateRecord, HealthRecord, StatusRecord

HEALTH = HealthRecord("active", "", "1/1", "RAW_IMU", 99.6, 5012, 3, 2500, True, True)
HALF_TURN = quaternion.from_euler(0.1, -0.2, math.pi / 2)
STATUS = StatusRecord(
    "active", "", "ArduPilot quadrotor 1/1", 12.4, *HALF_TURN, "autopilot", 40.0,
    0.31, -1.2, 0.62, 2.4, "undecided", "undecided", 0.31, 0.12, math.nan, 1.5, "",
)  # fmt: skip
LOG = LogSight(Path("/logs/a.mcap"), None, RecorderRecord(900, 0, 0, 0, 1_540_000, 1))
OURS = EstimateRecord(
    1_000_000, *HALF_TURN, 12.345, -3.2, 123.4, *[0.0] * 9, 0.312, 0, 0.0, math.nan
)


def lines(health=HEALTH, status=STATUS, log=LOG, ours=OURS):
    return panel_lines(Sight(health, status, log), ours)


def test_all_is_well():
    assert lines() == [
        "active                          ArduPilot quadrotor 1/1, armed",
        "RAW_IMU  100 Hz  age 12 ms  used 5012  refused 3",
        "               roll    pitch      yaw  deg",
        "h2nav        +12.35    -3.20  +123.40  sigma: tilt 0.31, heading -",
        "autopilot     +5.73   -11.46   +90.00",
        "difference tilt 0.3 deg (0.5 sigma), heading -1.2 deg (0.5 sigma)",
        "tests      velocity 0.31  force 0.12  field -  turn 1.50  (1 = fails)",
        "log        1.5 MB  a.mcap in /logs",
    ]


def test_nothing_is_known_yet():
    health = HealthRecord("no_link", "link is down", "", "", 0.0, 0, 0, 0, False, True)
    none = [None] * 5
    status = StatusRecord(
        "no_link", "link is down", "", None, *none[:4], "", None, *none[:4], "", "",
        *[math.nan] * 4, "",
    )  # fmt: skip
    assert lines(health, status, None, None) == [
        "no_link: link is down",
        "no IMU  used 0  refused 0",
        "               roll    pitch      yaw  deg",
        "h2nav             -        -        -",
        "autopilot         -        -        -",
        "difference nothing to compare at present",
        "tests      velocity -  force -  field -  turn -  (1 = fails)",
        "log        none",
    ]


def test_what_is_wrong_stands_at_the_end_and_of_many_only_some():
    assert lines(status=STATUS._replace(alarms="a\nb"))[8:] == ["! a", "! b"]
    assert lines(status=STATUS._replace(alarms="a\nb\nc\nd\ne\nf"))[8:] == [
        "! a", "! b", "! c", "! and 3 more",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"tilt_verdict": "h2nav"}, "; GPS backs h2nav in tilt"),
        ({"heading_verdict": "autopilot"}, "; GPS backs the autopilot in heading"),
        ({"sigma_heading_deg": math.nan}, "heading -1.2 deg"),
        ({"sigma_tilt_deg": 0.0}, "tilt 0.3 deg, "),
    ],
)
def test_the_difference_says_whom_the_gps_backs_and_what_is_not_known(changes, expected):
    said = lines(status=STATUS._replace(**changes))[5]
    assert expected in said
    assert "nan" not in said


def test_the_second_estimator_is_named():
    assert lines(status=STATUS._replace(autopilot_source="AHRS2"))[4].endswith("AHRS2")


def test_trouble_with_the_log_is_seen():
    lost = LOG._replace(counters=LOG.counters._replace(lost_disk=2, dropped_queue_full=1))
    assert "3 messages LOST" in lines(log=lost)[7]
    refused = LOG._replace(counters=LOG.counters._replace(rejected=4))
    assert " MB, 4 messages LOST" in lines(log=refused)[7]
    assert lines(log=LOG._replace(trouble="disk full"))[7].endswith("NOT RECORDING: disk full")
    assert lines(log=LOG._replace(path=None))[7] == "log        1.5 MB"
