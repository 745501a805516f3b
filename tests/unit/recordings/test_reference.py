"""Errors against the attitude in a recording: pairs in time, and known errors of closed form."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.maths.units import DEG
from h2nav.recordings.frame_tables import FrameTable, fields_type
from h2nav.recordings.reference import ATTITUDE, SIMSTATE, ErrorTable, Reference, TimedEstimates
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.codec import Encoder
from h2nav.wire.deframer import Deframer

AUTOPILOT, CAMERA = 1, 100
START_US = 5_000_000


def quaternion(*angles_deg):
    x, y, z, w = Rotation.from_euler("ZYX", angles_deg[::-1], degrees=True).as_quat().tolist()
    return w, x, y, z


def estimate(t_us, angles_deg, sigma_tilt_deg=1.0, sigma_heading_deg=2.0):
    still = ((0.0, 0.0, 0.0),) * 3
    tilt, heading = sigma_tilt_deg * DEG, sigma_heading_deg * DEG
    return AttitudeEstimate(t_us, quaternion(*angles_deg), *still, tilt, Trust(0), heading)


def heard(reference, message, t_us=0, component=AUTOPILOT):
    for frame in Deframer().feed(Encoder(1, component).encode(message)):
        reference.frame(t_us * 1000, frame)


def simstate(*angles_deg):
    return mavlink.MAVLink_simstate_message(*np.radians(angles_deg), *[0] * 8)


def attitude(t_ms, *angles_deg):
    return mavlink.MAVLink_attitude_message(t_ms, *np.radians(angles_deg), 0, 0, 0)


def of_truth(truths, estimates, **more):
    """A reference with a SIMSTATE a second, and estimates at these times."""
    found = Reference()
    for number, angles in enumerate(truths):
        heard(found, simstate(*angles), START_US + number * 1_000_000)
    for t_s, angles in estimates:
        found.estimate(START_US * 1000 + round(t_s * 1e9), estimate(7, angles, **more))
    return found


@pytest.mark.parametrize(
    ("truth", "ours", "expected"),
    [
        ((0, 0, 0), (3, 0, 0), (3, 0, 0, 3, 3)),
        ((0, 0, 0), (0, -4, 0), (0, 4, 0, 4, 4)),
        ((10, 20, 30), (10, 20, 35), (0, 0, 5, 0, 5)),
        # On both sides of the cut an angle is as far as it is round the other way.
        ((179, 0, 0), (-179, 0, 0), (2, 0, 0, 2, 2)),
        ((0, 0, -178), (0, 0, 178), (0, 0, 4, 0, 4)),
        ((0, 0, 90), (3, 4, 90), (3, 4, 0, None, None)),
    ],
)
def test_the_errors_of_one_pair(truth, ours, expected):
    table = of_truth([truth], [(0.0, ours)]).table()
    assert table[:2] == ("SIMSTATE", 1)
    turns = [Rotation.from_euler("ZYX", each[::-1], degrees=True) for each in (truth, ours)]
    total = np.degrees((turns[0].inv() * turns[1]).magnitude())
    down = [turn.inv().apply((0, 0, 1)) for turn in turns]
    tilt = np.degrees(np.arccos(np.clip(np.dot(*down), -1, 1)))
    assert table[2:5] == pytest.approx(expected[:3], abs=1e-4)
    assert table[5:] == pytest.approx((tilt, total), abs=1e-4)
    if expected[3] is not None:
        assert table[5:] == pytest.approx(expected[3:], abs=1e-4)


def test_errors_are_root_mean_squares_in_degrees():
    found = of_truth([(0, 0, 0)] * 3, [(0.0, (1, 0, 0)), (1.0, (2, 0, 0)), (2.0, (2, 0, 0))])
    assert found.table().roll == pytest.approx(math.sqrt(3.0), abs=1e-4)
    assert found.table().as_mapping() == {
        "roll": 1.73205, "pitch": 0.0, "yaw": 0.0, "tilt": 1.73205, "total": 1.73205,
    }  # fmt: skip
    # Of what comes after the skipped time, from the first reference on.
    assert found.table(skip_s=1.0)[1:3] == (2, pytest.approx(2.0, abs=1e-4))
    assert found.table(skip_s=1.01)[1] == 1
    assert found.table(skip_s=9.0) == ErrorTable("", 0) or found.table(skip_s=9.0).compared == 0


@pytest.mark.parametrize(
    ("times_s", "compared"),
    [([0.02], 1), ([-0.02], 1), ([0.020001], 0), ([-0.020001], 0), ([], 0), ([0.5], 0)],
)
def test_a_pair_is_within_twenty_milliseconds(times_s, compared):
    found = of_truth([(0, 0, 0)], [(t_s, (1, 0, 0)) for t_s in times_s])
    assert found.table().compared == compared
    values = set(found.table().as_mapping().values())
    assert (None in values) == (compared == 0)


@pytest.mark.parametrize(
    ("times_s", "roll_deg"),
    [
        ([0.001, 0.002], 1.0),
        ([0.003, 0.002], 2.0),  # in any order
        ([-0.003, 0.002], 2.0),
        ([-0.001, 0.002], 1.0),
        ([-0.002, 0.002], 1.0),
        ([-0.5, 0.01, 0.5], 2.0),
    ],
)
def test_the_nearest_sample_is_the_one(times_s, roll_deg):
    found = of_truth([(0, 0, 0)], [(t_s, (i + 1, 0, 0)) for i, t_s in enumerate(times_s)])
    assert found.table()[1:3] == (1, pytest.approx(roll_deg, abs=1e-4))


def test_the_truth_counts_more_than_the_autopilot_and_only_its_own():
    found = Reference()
    found.estimate(START_US * 1000, estimate(7_000, (2, 0, 0)))
    heard(found, attitude(7, 9, 0, 0), component=CAMERA)
    assert found.table() == ErrorTable("", 0) or found.table().compared == 0
    heard(found, attitude(7, 1, 0, 0))
    assert found.table()[:3] == ("ATTITUDE", 1, pytest.approx(1.0, abs=1e-4))
    # Of its time since boot, not of its arrival.
    heard(found, attitude(28, 9, 0, 0), START_US)
    assert found.table().compared == 1
    heard(found, simstate(-1, 0, 0), START_US)
    assert found.table()[:3] == ("SIMSTATE", 1, pytest.approx(3.0, abs=1e-4))


def test_frames_tables_and_events_say_the_same():
    events = Reference()
    for t_ms, roll in ((7, 1), (1007, 2)):
        events.message(ReportedAttitude(False, t_ms, quaternion(roll, 0, 0)))
    events.message(ReportedAttitude(True, None, quaternion(50, 0, 0)))
    nothing = FrameTable(np.empty(0, np.int64), np.empty((0, 2), np.uint8),
                         np.empty(0, fields_type(SIMSTATE)))  # fmt: skip
    fields = np.zeros(3, fields_type(ATTITUDE))
    fields["time_boot_ms"], fields["roll"] = (7, 1007, 7), np.radians((1, 2, 50))
    senders = np.array([(1, AUTOPILOT), (1, AUTOPILOT), (1, CAMERA)], np.uint8)
    tables = Reference()
    tables.tables({SIMSTATE: nothing, ATTITUDE: FrameTable(np.zeros(3, np.int64), senders, fields)})
    for found in (events, tables):
        for t_us in (7_000, 1_007_000):
            found.estimate(0, estimate(t_us, (0, 0, 0)))
        assert found.table()[:3] == ("ATTITUDE", 2, pytest.approx(math.sqrt(2.5), abs=1e-4))
    truth = np.zeros(2, fields_type(SIMSTATE))
    truth["roll"] = np.radians((4, 4))
    t_ns = np.array([0, 500_000_000])
    tables.tables({SIMSTATE: FrameTable(t_ns, senders[:2], truth), ATTITUDE: FrameTable(
        np.empty(0, np.int64), senders[:0], fields[:0])})  # fmt: skip
    assert tables.table()[:3] == ("SIMSTATE", 1, pytest.approx(4.0, abs=1e-4))


def test_other_estimates_are_compared_in_place_of_the_added_ones():
    found, others = of_truth([(0, 0, 0)], [(0.0, (1, 0, 0))]), TimedEstimates()
    others.add(START_US * 1000, estimate(9, (0, 5, 0)))
    assert [each.tolist() for each in others.times()] == [[START_US], [9]]
    np.testing.assert_allclose(others.sigmas_deg(np.array([0])), [(1.0, 2.0)])
    assert found.table().roll == pytest.approx(1.0, abs=1e-4)
    assert found.table(estimates=others)[2:4] == pytest.approx((0.0, 5.0), abs=1e-4)
    assert found.table().roll == pytest.approx(1.0, abs=1e-4)


def test_deviations_are_honest_against_the_truth_alone():
    flown = [(0, 0, 0)] * 2, [(0.0, (1, 0, 2)), (1.0, (1, 0, 2))]
    for sigma_deg, nees, beyond in ((1.0, 1.0, 0.0), (0.1, 100.0, 1.0)):
        assert of_truth(*flown, sigma_tilt_deg=sigma_deg).honesty() == pytest.approx(
            {
                "nees_tilt": nees,
                "tilt_beyond_3_sigma": beyond,
                "nees_heading": 1.0,
                "heading_beyond_3_sigma": 0.0,
            },
            rel=1e-3,
        )
    found = Reference()
    found.estimate(0, estimate(7_000, (1, 0, 0)))
    heard(found, attitude(7, 0, 0, 0))
    assert set(found.honesty().values()) == {None}
