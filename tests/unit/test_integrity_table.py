"""tools/integrity_table.py: its faults exist, and its figures are those of a fault's own time."""

import needs
import numpy as np
import pytest

from h2nav.evaluation.flights.tracks import ErrorTrack
from h2nav.integrity.findings import Severity
from h2nav.sim.faults import parse_fault
from h2nav.sim.scenarios import SCENARIOS


@pytest.fixture(scope="module")
def tool():
    return needs.tool("integrity_table")


def test_every_case_is_a_fault_of_a_flight(tool):
    for case in tool.CASES:
        assert case.flown in SCENARIOS
        for imus in (1, 3):
            faults = [parse_fault(text) for text in case.texts(imus)]
            assert [fault.imu for fault in faults] == list(range(1, len(faults) + 1))
            assert len(faults) == (imus if case.everywhere else 1)


def flight(tool):
    """100 s with an error of 1 deg that is 10 deg from 40 s on, when the service says so."""
    said = tool.Words()
    said.start_us = 5_000_000
    heard = tool.Heard(said)
    heard.changes = [(5_000_000, "active"), (45_000_000, "degraded"), (65_000_000, "active")]
    heard.notices = [
        (6_000_000, Severity.INFO, "active"),
        (30_000_000, Severity.NOTICE, "not independent: it is PX4"),
        (46_000_000, Severity.WARNING, "gyro frozen"),
        (90_000_000, Severity.WARNING, "something else"),
    ]
    t_s = np.arange(0.0, 100.0, 0.5)
    error = np.where((t_s >= 40.0) & (t_s < 60.0), 10.0, 1.0)
    track = ErrorTrack(
        t_s, error, 0.5 * error, 0.8 * error, np.full(len(t_s), 2.0), np.ones(len(t_s))
    )
    return tool.Flight(said, heard, [], track, None)


def test_what_a_fault_does_is_measured_in_its_time_alone(tool):
    found = tool.effect(flight(tool), 30.0, 70.0)
    assert found["told_after_s"] == 11.0
    assert [told["text"] for told in found["told"]] == ["gyro frozen"]
    assert found["states_s"] == {"degraded": 20.0, "active": 20.0}
    assert found["worst_before"] == {"total": 10.0, "tilt": 8.0}
    assert found["worst_after"] == {"total": 10.0, "tilt": 8.0}
    assert found["worst_sigma"] == {"tilt": 2.0, "heading": 1.0}
    assert found["tilt_beyond_3_sigma"] == 0.5  # 8 deg of tilt at 2 stated: 20 of 40 s
    assert found["deceived_share"] == 0.0  # the state says degraded from 40 to 60 s
    assert found["nees_tilt"] == pytest.approx(0.5 * (4.0**2 + 0.4**2))


def test_an_error_that_is_called_well_deceives(tool):
    wrong = flight(tool)
    wrong.heard.changes[1:] = [(50_000_000, "degraded"), (65_000_000, "active")]
    assert tool.effect(wrong, 30.0, 70.0)["deceived_share"] == 0.125  # 5 of 40 s


def test_silence_is_called_never(tool):
    found = tool.effect(flight(tool), 0.0, 40.0)
    assert found["told_after_s"] is None
    assert found["worst_after"] is None
    assert found["worst_before"] == {"total": 1.0, "tilt": 0.8}
    assert found["states_s"] == {"active": 40.0}


def test_what_is_said_outside_faults_counts_as_a_false_alarm(tool):
    failure = {"from_s": 20.0, "to_s": 25.0}
    quiet = tool.quiet_part(flight(tool), "x", [failure], 100.0)
    assert [told["text"] for told in quiet["told"]] == ["something else"]
    assert quiet["hours"] == pytest.approx((20.0 + 100.0 - 85.0) / 3600.0)
