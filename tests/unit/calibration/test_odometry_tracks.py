"""Drives in closed form: where increments end, what a drive is off by, and what is refused."""

import dataclasses
import math
from types import SimpleNamespace as Message

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.calibration.odometry import pictures, recordings, tables, tracks
from h2nav.calibration.odometry.calibration import (
    calibrate_differential,
    calibrate_matrix,
    configuration,
)
from h2nav.calibration.odometry.tracks import Increments, PoseTrack, TimedPose, of_track
from h2nav.errors import BadInput
from h2nav.maths import se2
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheels import DifferentialDrive


def straight(seconds, step_us=100_000, speed=1.0):
    times = range(0, round(seconds * 1e6) + 1, step_us)
    readings = [WheelSample(t, (speed * t * 1e-6,) * 2) for t in times]
    return readings, [TimedPose(t, (speed * t * 1e-6, 0.0, 0.0)) for t in times]


@pytest.mark.parametrize(("seconds", "count"), [(1.4, 2), (1.5, 3)])
def test_three_increments_of_half_a_second_are_enough(seconds, count):
    track = PoseTrack(*straight(seconds))
    if count < 3:
        with pytest.raises(BadInput) as caught:
            of_track(track, "diff", "some.csv")
        assert str(caught.value) == (
            "some.csv: 2 increment(s) with wheels and a pose at the same time; expected at least 3 "
            "of 0.5 s on one clock"
        )
        return
    found = of_track(track, "diff", "some.csv")
    assert found.readings == pytest.approx(np.full((3, 2), 0.5))
    assert found.motion == pytest.approx(np.tile((0.5, 0.0, 0.0), (3, 1)))
    assert (found.model, found.source, found.track) == ("diff", "3 increments of some.csv", track)


@pytest.mark.parametrize(
    ("t_us", "share"), [(1_000_000, 0.0), (1_250_000, 0.5), (1_499_999, 1.0), (1_500_000, 1.0)]
)
def test_between_poses_the_vehicle_drives_an_arc(t_us, share):
    """Of a quarter of a circle of 2 m to the left."""
    poses = [TimedPose(1_000_000, (1.0, 1.0, 0.0)), TimedPose(1_500_000, (3.0, 3.0, 0.5 * math.pi))]
    angle = 0.5 * math.pi * share
    found = tracks._pose_at(t_us, [pose.t_us for pose in poses], poses)
    expected = (1.0 + 2.0 * math.sin(angle), 3.0 - 2.0 * math.cos(angle), angle)
    assert found == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("t_us", "gap_us", "is_known"),
    [(999_999, 500_000, False), (1_500_001, 500_000, False), (1_250_000, 500_000, True),
     (1_250_000, 500_001, False), (1_000_000, 500_001, True)],
)  # fmt: skip
def test_no_pose_is_known_beyond_the_poses_or_in_a_gap_of_them(t_us, gap_us, is_known):
    poses = [TimedPose(1_000_000, (0.0,) * 3), TimedPose(1_000_000 + gap_us, (1.0, 0.0, 0.0))]
    found = tracks._pose_at(t_us, [pose.t_us for pose in poses], poses)
    assert (found is not None) is is_known


def test_a_drive_is_off_by_the_last_pose_as_seen_from_the_first():
    """The reference begins later, elsewhere and heads elsewhere; it ends 0.1 m to the left."""
    readings, _ = straight(4.0)
    first = (5.0, -3.0, 1.0)
    ends = [
        se2.compose(first, (t - 1.0, 0.1 * (t - 1.0) / 3.0, 0.0)) for t in np.arange(1.0, 4.05, 0.1)
    ]
    poses = [TimedPose(1_000_000 + 100_000 * k, end) for k, end in enumerate(ends)]
    settings = OdometrySettings()
    found = tracks.drive(PoseTrack(readings, poses), settings)
    assert found.length_m == pytest.approx(3.0)
    assert found.end_error_m == pytest.approx(0.1, abs=1e-6)
    assert 0.0 < found.end_error_sigmas < math.inf
    assert tracks.drive(PoseTrack(readings, []), settings) is None
    compared = tracks._compared(
        (1.0, 2.0, 0.0), np.diag((0.25, 4.0, 1.0)), (0.0,) * 3, (0.0,) * 3, 7.0
    )
    assert compared == (7.0, pytest.approx(math.sqrt(5.0)), pytest.approx(math.sqrt(5.0)))
    sure = tracks._compared((1.0, 0.0, 0.0), np.zeros((3, 3)), (0.0,) * 3, (0.0,) * 3, 7.0)
    assert sure.end_error_sigmas == math.inf


# --- configuration --------------------------------------------------------------------------------


def test_the_section_of_the_daemon_has_six_digits_and_the_radius_that_is_fed():
    rng = np.random.default_rng(1)
    phi = rng.uniform(0.0, 8.0, (40, 2))
    motion = np.stack(
        [phi @ (0.05, 0.05) / 2.0, 0.0 * phi[:, 0], phi @ (-0.05, 0.05) / 0.3333333], axis=1
    )
    section = configuration(calibrate_differential(phi, motion), (), 0.07)
    assert section == {
        "layout": "differential",
        "track_m": 0.333333,
        "radius_left_m": 0.05,
        "radius_right_m": 0.05,
        "autopilot_radius_m": 0.07,
    }
    odo = rng.normal(size=(9, 3))
    matrix = configuration(calibrate_matrix(odo, odo), (), 0.07)
    assert list(matrix)[:4] == [
        "ahead_per_ahead",
        "ahead_per_left",
        "ahead_per_turn",
        "left_per_ahead",
    ]
    assert list(matrix.values()) == pytest.approx(np.eye(3).ravel(), abs=1e-9)
    assert configuration(calibrate_differential(0.0 * phi, motion), (), 0.07) is None


# --- tables ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "model", "says"),
    [
        ("a,b\n1,2\n", None, ":1: the header has no known columns; expected dx_m,dy_m,dtheta_rad "
         "with one of (diff: phi_left_rad,phi_right_rad; omni: phi_1_rad,phi_2_rad,phi_3_rad; "
         "matrix: odo_dx_m,odo_dy_m,odo_dtheta_rad)"),
        ("time_s,x_m\n1,2\n", "matrix", ":1: the model matrix needs increments, not counters over "
         "time_s"),
        ("time_s,way_1_m\n1,2\n", None, ":1: column(s) way_2_m, way_3_m, x_m, y_m, heading_rad "
         "missing for the model omni; expected the header time_s,way_1_m,way_2_m,way_3_m,x_m,y_m,"
         "heading_rad"),
        ("time_s\n1\n", None, ":1: column(s) way_left_m, way_right_m, x_m, y_m, heading_rad "
         "missing for the model diff; expected the header time_s,way_left_m,way_right_m,x_m,y_m,"
         "heading_rad"),
        ("b,a,b,a\n", None, ":1: column(s) a, b stand twice"),
        ("\n \n", None, ": empty; expected a header line and rows of numbers"),
    ],
)  # fmt: skip
def test_a_table_that_lacks_something_says_what(tmp_path, text, model, says):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        tables.read_increments(path, model)
    assert str(caught.value) == f"{path}{says}"


@pytest.mark.parametrize(
    ("value", "is_possible"), [("1e12", True), ("-1e12", True), ("1.01e12", False)]
)
def test_the_largest_number_of_a_table(tmp_path, value, is_possible):
    path = tmp_path / "x.csv"
    path.write_text(f" dx_m ,dy_m,dtheta_rad,phi_left_rad,phi_right_rad\n\n{value},2,3,4,5\n")
    if is_possible:
        found = tables.read_increments(path, None)
        assert found.readings.tolist() == [[4.0, 5.0]]
        assert found.motion.tolist() == [[float(value), 2.0, 3.0]]
        assert (found.model, found.source) == ("diff", f"1 rows of {path}")
    else:
        with pytest.raises(BadInput, match=r":3: dx_m = '1.01e12': expected a finite number up to"):
            tables.read_increments(path, None)


# --- recordings -----------------------------------------------------------------------------------


def test_poses_are_finite_and_in_order_and_to_the_left():
    """North, east and a heading to the east become ahead, right, and a turn to the right."""
    assert recordings._planar(7, 3.0, 4.0, 0.5) == TimedPose(7, (3.0, -4.0, -0.5))
    times = (5, 5, 4, 6, 7)
    poses = [TimedPose(t, (float(k), 0.0, 0.0)) for k, t in enumerate(times)]
    poses[3] = poses[3]._replace(pose=(math.nan, 0.0, 0.0))
    assert [pose.pose[0] for pose in recordings._sound(iter(poses))] == [0.0, 4.0]


def test_a_position_has_the_heading_sent_nearest_propagated_with_its_rate():
    attitudes = [
        Message(time_boot_ms=t, yaw=yaw, yawspeed=2.0) for t, yaw in ((100, 0.5), (200, 1.0))
    ]
    positions = [Message(time_boot_ms=t, x=1.0, y=2.0) for t in (90, 149, 151, 230)]
    found = list(recordings._joined(positions, attitudes))
    assert [pose.t_us for pose in found] == [90_000, 149_000, 151_000, 230_000]
    assert [-pose.pose[2] for pose in found] == pytest.approx([0.48, 0.598, 0.902, 1.06])


def test_after_a_restart_of_the_autopilot_no_position_has_a_heading_of_another_time():
    """Times begin anew, in a shorter run."""
    times = [*range(0, 1000, 100), *range(0, 700, 100)]
    attitudes = [Message(time_boot_ms=t, yaw=2e-3 * t, yawspeed=9.0) for t in times]
    positions = [Message(time_boot_ms=t, x=1.0, y=2.0) for t in range(0, 1000, 100)]
    found = list(recordings._joined(positions, attitudes))
    assert [-pose.pose[2] for pose in found] == pytest.approx(
        [2e-3 * p.time_boot_ms for p in positions]
    )


def test_a_stream_is_that_of_the_component_that_sent_most():
    streams = {(32, 1, 1): [1], (32, 1, 2): [2, 3], (30, 1, 1): [4, 5, 6]}
    assert recordings._longest(streams, 32) == [2, 3]
    assert recordings._longest(streams, 9000) == []


# --- pictures -------------------------------------------------------------------------------------


def test_an_ellipse_is_at_three_deviations():
    turn = Rotation.from_euler("z", 0.7).as_matrix()[:2, :2]
    P = turn @ np.diag((4.0, 0.25)) @ turn.T
    x, y = pictures.ellipse((10.0, -2.0), P)
    off = np.stack((x - 10.0, y + 2.0))
    assert np.einsum("in,ij,jn->n", off, np.linalg.inv(P), off) == pytest.approx(9.0)
    assert np.hypot(*off).max() == pytest.approx(6.0, rel=1e-3)
    assert (off[:, 0], len(x)) == (pytest.approx(off[:, -1]), 60)


class Axes:
    """What is drawn."""

    def __init__(self):
        self.drawn = {}
        self.lines = []

    def __getattr__(self, name):
        return lambda *args, **kwargs: self.drawn.__setitem__(name, (args, kwargs))

    def plot(self, *args, **kwargs):
        self.lines.append((args, kwargs.get("label")))


def calibrated():
    rng = np.random.default_rng(1)
    phi = rng.uniform(4.0, 8.0, (30, 2))
    turn = phi @ (-0.05, 0.05) / 0.3
    motion = np.stack([phi @ (0.05, 0.05) / 2.0, 0.0 * turn, turn], axis=1)
    return calibrate_differential(phi, motion), Increments("diff", phi, motion, "")


def test_residuals_are_drawn_in_millimetres_and_milliradians():
    result, _ = calibrated()
    residuals = np.tile((0.003, -0.004, 0.005), (30, 1))
    residuals[::2] *= -1.0
    axes = [Axes() for _ in range(3)]
    pictures._residuals(axes, dataclasses.replace(result, residuals=residuals))
    for ax, size, name in zip(
        axes, (3.0, 4.0, 5.0), ("ahead [mm]", "left [mm]", "turn [mrad]"), strict=True
    ):
        assert np.abs(ax.lines[0][0][0]) == pytest.approx(size)
        (low, high), _ = ax.drawn["axhspan"]
        assert (low, high) == pytest.approx((-size, size))
        assert ax.drawn["set_ylabel"][0] == (name,)
        assert ("set_xlabel" in ax.drawn) is (ax is axes[-1])


def test_the_path_of_exact_wheels_is_that_of_the_reference():
    result, data = calibrated()
    chassis = pictures._chassis(result, (0.0, 0.0, 0.0))
    assert isinstance(chassis, DifferentialDrive)
    ax = Axes()
    pictures._path(ax, chassis, result, data)
    by_label = {label: args for args, label in ax.lines if label}
    path, reference = (by_label[name] for name in ("calibrated odometry", "reference"))
    assert reference[0] == pytest.approx(path[0], abs=1e-6)
    assert reference[1] == pytest.approx(path[1], abs=1e-6)
    assert len(reference[0]) == 31
    ellipses = [args for args, label in ax.lines if label is None]
    assert len(ellipses) == 15  # every second of thirty
