"""`h2nav odometry calibrate`: from a table of made increments to the daemon's configuration."""

import json
import math

import numpy as np
import pytest

from h2nav.apps import odometry_calibrate
from h2nav.apps.odometry_calibrate import FED_REMARK
from h2nav.calibration.odometry.tracks import Drive
from h2nav.cli import BAD_INPUT, SUCCESS, main

TRACK_M, LEFT_M, RIGHT_M = 0.3, 0.05, 0.052
PHI = np.array([[1.0, 2.0], [3.0, 1.0], [2.0, 2.5], [4.0, 0.5], [1.5, 3.0]])
OFF_M = 1e-3 * np.array([1.0, -1.0, 1.0, -1.0, 0.0])


@pytest.fixture
def table(tmp_path):
    """Increments of a differential drive, with errors ahead that its radii do not explain."""
    ahead = 0.5 * PHI @ [LEFT_M, RIGHT_M]
    # orthogonal to what the radii explain: the fit stays that of the truth
    off_m = OFF_M - PHI @ np.linalg.lstsq(PHI, OFF_M, rcond=None)[0]
    rows = np.column_stack([PHI, ahead + off_m, 0.0 * ahead, PHI @ [-LEFT_M, RIGHT_M] / TRACK_M])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path = tmp_path / "wheels.csv"
    path.write_text("\n".join(["phi_left_rad,phi_right_rad,dx_m,dy_m,dtheta_rad", *lines]))
    return path, float(np.sqrt(np.sum(off_m**2) / (2 * len(PHI))))


def calibrated(capsys, path, *words):
    assert main(["odometry", "calibrate", str(path), *words]) == SUCCESS
    return capsys.readouterr().out


def test_what_is_found_is_told_with_its_deviation_and_the_section_of_the_daemon(table, capsys):
    path, rms_m = table
    lines = calibrated(capsys, path).splitlines()
    document = json.loads(calibrated(capsys, path, "--json"))
    assert lines[0] == f"diff from 5 rows of {path}; reference read as twist"
    sigmas = np.sqrt(np.diag(document["covariance"]))
    assert lines[1:4] == [
        f"  {name:16} {value} +- {sigma:.2g}"
        for name, value, sigma in zip(
            ("track_m", "radius_left_m", "radius_right_m"), ("0.3", "0.05", "0.052"), sigmas,
            strict=True,
        )
    ]  # fmt: skip
    assert lines[4].startswith("  rank 2 of 2, condition 2.")
    assert f"solver qr, residual rms {1e3 * rms_m:.3g} mm, " in lines[4]
    assert lines[5:] == [
        "",
        "odometry:",
        "  layout: differential",
        "  track_m: 0.3",
        "  radius_left_m: 0.05",
        "  radius_right_m: 0.052",
        f"  autopilot_radius_m: 1.0{FED_REMARK}",
    ]


def test_the_document_has_every_figure(table, capsys):
    path, rms_m = table
    found = json.loads(calibrated(capsys, path, "--json"))
    assert found["parameters"] == ["track_m", "radius_left_m", "radius_right_m"]
    values = [found[name] for name in found["parameters"]]
    assert values == pytest.approx([TRACK_M, LEFT_M, RIGHT_M], rel=1e-9)
    assert found["residual_rms_m"] == pytest.approx(rms_m)
    assert found["residual_rms_rad"] == pytest.approx(0.0, abs=1e-12)
    # of three numbers a row, two of them lengths
    assert found["residual_rms"] == pytest.approx(rms_m * math.sqrt(2.0 / 3.0))
    assert {name: found[name] for name in ("rank", "unknowns", "increments", "determined")} == {
        "rank": 2, "unknowns": 2, "increments": 5, "determined": True,
    }  # fmt: skip
    assert (found["model"], found["solver"], found["reference_read_as"]) == ("diff", "qr", "twist")
    assert (found["notes"], found["drive"]) == ([], None)
    assert found["configuration"]["track_m"] == 0.3


@pytest.mark.parametrize(
    ("radius", "is_taken"),
    [("0.0001", True), ("1000", True), ("0.00009", False), ("1001", False)],
)
def test_a_wheel_of_the_autopilot_has_a_size(table, capsys, radius, is_taken):
    words = ["odometry", "calibrate", str(table[0]), "--autopilot-radius-m", radius]
    assert main(words) == (SUCCESS if is_taken else BAD_INPUT)
    told = capsys.readouterr()
    if is_taken:
        assert told.out.splitlines()[-1] == f"  autopilot_radius_m: {float(radius)}"
    else:
        said = f"--autopilot-radius-m {float(radius)}: expected a number from 0.0001 to 1000"
        assert told.err == f"h2nav: {said}\n"


def test_another_solver_finds_the_same(table, capsys):
    found = json.loads(calibrated(capsys, table[0], "--json", "--solver", "svd"))
    assert found["solver"] == "svd"
    assert found["track_m"] == pytest.approx(TRACK_M, rel=1e-9)


def test_a_matrix_is_a_document_by_rows(tmp_path, capsys):
    matrix = np.array([[1.05, 0.02, 0.0], [-0.01, 0.97, 0.1], [0.0, 0.05, 1.02]])
    odo = np.vstack([np.eye(3), -np.eye(3), 2.0 * np.eye(3)])
    lines = [",".join(map(repr, row)) for row in np.hstack([odo, odo @ matrix.T]).tolist()]
    path = tmp_path / "odo.txt"
    head = "odo_dx_m,odo_dy_m,odo_dtheta_rad,dx_m,dy_m,dtheta_rad"
    path.write_text("\n".join([head, *lines]))
    found = json.loads(calibrated(capsys, path, "--json"))
    assert np.array(found["matrix"]) == pytest.approx(matrix, abs=1e-9)
    assert found["configuration"]["ahead_per_ahead"] == 1.05


def test_three_wheels_stand_at_the_angles_that_are_given(tmp_path, capsys):
    """Each rolls r phi = -sin a x + cos a y + arm turn."""
    arm_m, radius_m = 0.2, 0.05
    angles = np.radians([10.0, 130.0, 250.0])
    motion = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.3], [0.1, -0.2, 0.1]])
    ways = np.column_stack([-np.sin(angles), np.cos(angles), np.full(3, arm_m)]) @ motion.T
    lines = [",".join(map(repr, row)) for row in np.hstack([ways.T / radius_m, motion]).tolist()]
    path = tmp_path / "omni.csv"
    path.write_text("\n".join(["phi_1_rad,phi_2_rad,phi_3_rad,dx_m,dy_m,dtheta_rad", *lines]))
    words = ("--json", "--wheel-angles-deg", "10,130,250")
    found = json.loads(calibrated(capsys, path, *words))
    values = [found[name] for name in found["parameters"]]
    assert values == pytest.approx([arm_m, *[radius_m] * 3], rel=1e-6)


@pytest.mark.parametrize("angles", ["0,120", "0,120,240,360", "a,b,c"])
def test_angles_are_three_numbers(table, capsys, angles):
    words = ["odometry", "calibrate", str(table[0]), f"--wheel-angles-deg={angles}"]
    assert main(words) == BAD_INPUT
    said = f"--wheel-angles-deg {angles}: expected three numbers, such as 0,120,240"
    assert capsys.readouterr().err == f"h2nav: {said}\n"


def test_a_recording_has_no_matrix(tmp_path, capsys):
    path = tmp_path / "drive.tlog"
    path.write_bytes(b"")
    assert main(["odometry", "calibrate", str(path), "--model", "matrix"]) == BAD_INPUT
    said = f"h2nav: {path}: a recording holds wheel distances; the model matrix needs a CSV\n"
    assert capsys.readouterr().err == said


@pytest.fixture
def drive(tmp_path):
    """A drive whose counters are metres of wheels of 0.1 m: ahead, and round to the left."""
    rows, x_m, y_m, heading = [], 0.0, 0.0, 0.0
    left_m = right_m = 0.0
    for number in range(60):
        rows.append((0.1 * number, left_m, right_m, x_m, y_m, heading))
        left, right = 0.5 + 0.02 * number, 0.9 - 0.01 * number  # wheel angles, rad
        ahead, turn = (
            0.5 * (LEFT_M * left + RIGHT_M * right),
            (RIGHT_M * right - LEFT_M * left) / 0.3,
        )
        half = 0.5 * turn
        chord_m = ahead * math.sin(half) / half if half else ahead
        x_m += chord_m * math.cos(heading + half)
        y_m += chord_m * math.sin(heading + half)
        heading += turn
        left_m, right_m = left_m + 0.1 * left, right_m + 0.1 * right
    path = tmp_path / "drive.csv"
    lines = [",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(["time_s,way_left_m,way_right_m,x_m,y_m,heading_rad", *lines]))
    return path


def test_counters_in_metres_are_angles_of_the_autopilots_wheel(drive, capsys):
    found = json.loads(calibrated(capsys, drive, "--json", "--autopilot-radius-m", "0.1"))
    values = [found[name] for name in found["parameters"]]
    assert values == pytest.approx([TRACK_M, LEFT_M, RIGHT_M], rel=0.02)
    assert found["configuration"]["autopilot_radius_m"] == 0.1
    assert found["drive"]["end_error_m"] < 0.02 * found["drive"]["length_m"]


def test_the_drive_is_repeated_with_the_new_section(drive, capsys, monkeypatch):
    repeated = []

    def again(track, settings):
        repeated.append(settings)
        return Drive(12.345, 0.12345, 1.234)

    monkeypatch.setattr(odometry_calibrate, "drive", again)
    said = calibrated(capsys, drive, "--autopilot-radius-m", "0.1")
    assert (
        "  driven again: after 12.3 m the odometry ends 0.123 m off, 1.2 sigma of its covariance\n"
    ) in said
    ((settings),) = repeated
    assert (settings.layout, settings.autopilot_radius_m) == ("differential", 0.1)


def test_what_the_data_do_not_show_is_told(tmp_path, capsys):
    path = tmp_path / "straight.csv"
    lines = [f"{n},{n},{0.05 * n},0,0" for n in range(1, 9)]
    path.write_text("\n".join(["phi_left_rad,phi_right_rad,dx_m,dy_m,dtheta_rad", *lines]))
    said = calibrated(capsys, path)
    assert "  track_m          not determined\n" in said
    assert "  rank 1 of 2, " in said
    assert "  note: " in said
    assert said.endswith("no configuration block: the data do not determine every parameter\n")
