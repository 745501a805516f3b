import json
import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav import cli
from h2nav.calibration.odometry.tracks import TimedPose, increments
from h2nav.files.plain_yaml import parse_mapping
from h2nav.files.strict_yaml import into_record
from h2nav.maths import se2
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheels import DifferentialDrive, OmniDrive
from h2nav.wire.codec import Encoder

SOLVERS = ("qr", "svd", "ridge", "min-norm", "normal")
DIFF = "phi_left_rad,phi_right_rad,dx_m,dy_m,dtheta_rad"


def write(path, header, rows):
    lines = [header] + [",".join(f"{value:.9g}" for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def differential(rows=400, seed=0):
    rng = np.random.default_rng(seed)
    phi = rng.uniform(0.0, 8.0, (rows, 2))
    ahead, turn = 0.5 * phi @ [0.0502, 0.0498], phi @ [-0.0502, 0.0498] / 0.305
    motion = np.stack([ahead, 0 * ahead, turn], axis=1) + 1e-3 * rng.normal(size=(rows, 3))
    return np.hstack([phi, motion])


def calibrate(capsys, path, *options):
    status = cli.main(["odometry", "calibrate", str(path), *options])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_table_of_400_noisy_rows(tmp_path, capsys, solver):
    path = write(tmp_path / "d.csv", DIFF, differential())
    status, out, _ = calibrate(capsys, path, "--json", "--model", "diff", "--solver", solver)
    document = json.loads(out)
    assert status == 0
    assert document["track_m"] == pytest.approx(0.305, rel=0.01)
    assert document["radius_left_m"] == pytest.approx(0.0502, rel=0.01)
    assert document["radius_right_m"] == pytest.approx(0.0498, rel=0.01)
    assert document["rank"] == 2
    assert document["condition"] < 10.0
    assert document["residual_rms"] == pytest.approx(1e-3, rel=0.1)
    assert np.array(document["covariance"]).shape == (3, 3)
    assert document["determined"] is True


def test_the_configuration_block_is_a_section_of_the_settings(tmp_path, capsys):
    path = write(tmp_path / "d.csv", DIFF, differential())
    _, out, _ = calibrate(capsys, path, "--json", "--autopilot-radius-m", "0.05")
    settings = OdometrySettings(**json.loads(out)["configuration"])
    assert settings.scales == pytest.approx((1.004, 0.996), rel=0.002)
    assert settings.track_m == pytest.approx(0.305, rel=0.01)


def test_the_text_holds_the_block_too(tmp_path, capsys):
    path = write(tmp_path / "d.csv", DIFF, differential())
    _, out, _ = calibrate(capsys, path)
    mapping = parse_mapping(out[out.index("odometry:") :], "the block")
    settings = into_record(OdometrySettings, mapping["odometry"], "the block")
    assert settings.layout == "differential"
    assert settings.track_m == pytest.approx(0.305, rel=0.01)


def test_omni_and_matrix_by_their_headers(tmp_path, capsys):
    rng = np.random.default_rng(1)
    phi = rng.uniform(-5.0, 5.0, (400, 3))
    rows = np.asarray(OmniDrive(tuple(np.radians([10.0, 130.0, 250.0])), 0.2).jacobian())
    motion = 0.05 * phi @ rows.T + 1e-3 * rng.normal(size=(400, 3))
    header = "phi_1_rad,phi_2_rad,phi_3_rad,dx_m,dy_m,dtheta_rad"
    path = write(tmp_path / "o.csv", header, np.hstack([phi, motion]))
    _, out, _ = calibrate(capsys, path, "--json", "--wheel-angles-deg", "10,130,250")
    document = json.loads(out)
    assert document["model"] == "omni"
    assert document["arm_m"] == pytest.approx(0.2, rel=0.01)
    OdometrySettings(**document["configuration"]).chassis()

    X = np.array([[1.05, 0.02, 0.0], [0.0, 0.97, 0.1], [0.0, 0.05, 1.02]])
    header = "odo_dx_m,odo_dy_m,odo_dtheta_rad,dx_m,dy_m,dtheta_rad"
    path = write(tmp_path / "m.csv", header, np.hstack([phi, phi @ X.T]))
    _, out, _ = calibrate(capsys, path, "--json")
    document = json.loads(out)
    assert np.array(document["matrix"]) == pytest.approx(X, abs=1e-6)
    assert OdometrySettings(**document["configuration"]).correction[1] == pytest.approx(
        X[1], abs=1e-6
    )


def test_rank_deficient_data_are_said_in_text_and_json(tmp_path, capsys):
    rows = [(i, i, 0.05 * i, 0.0, 0.0) for i in range(1, 20)]
    path = write(tmp_path / "s.csv", DIFF, rows)
    status, out, _ = calibrate(capsys, path, "--json")
    document = json.loads(out)
    assert status == 0
    assert document["rank"] == 1
    assert document["track_m"] is None
    assert document["configuration"] is None
    assert any("rank-deficient" in note for note in document["notes"])
    _, out, _ = calibrate(capsys, path)
    assert "rank-deficient: rank 1 of 2" in out
    assert "no configuration block" in out


def test_under_determined_data_are_said(tmp_path, capsys):
    path = write(tmp_path / "u.csv", DIFF, [(5.0, 5.5, 0.26, 0.0, 0.1)])
    status, out, _ = calibrate(capsys, path, "--json", "--solver", "min-norm")
    assert status == 0
    assert any("under-determined" in note for note in json.loads(out)["notes"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        (DIFF + "\n", "a header without rows"),
        ("a,b\n1,2\n", "no known columns"),
        (DIFF + "\n1,2,3,4,5\n1,2,nan,4,5\n", ":3: dx_m = 'nan': expected a finite number"),
        (DIFF + "\n1,2,3,4,inf\n", ":2: dtheta_rad = 'inf'"),
        (DIFF + "\n1,x,3,4,5\n", ":2: phi_right_rad = 'x'"),
        (DIFF + "\n1,2,3,4\n", ":2: 4 cells, expected 5"),
        (DIFF + "\n1,2,3,4,5,6\n", ":2: 6 cells, expected 5"),
        (DIFF + ",dx_m\n1,2,3,4,5,6\n", "dx_m stand twice"),
        ("phi_left_rad,phi_right_rad,dx_m,dy_m\n1,2,3,4\n", "no known columns|dtheta_rad missing"),
        ('"' + DIFF, "cannot be read as CSV"),
        (f"{DIFF}\n1e308,1e308,1e308,0,1e308\n", ":2: phi_left_rad = '1e308'"),
        (f"{DIFF}\n1,2,3,4,{'9' * 1000}\n", ":2: dtheta_rad = '999"),
        (f"{DIFF}\n1,2,3,4,{'9' * 200_000}\n", "field larger than field limit"),
    ],
)
def test_bad_tables_are_named_by_line(tmp_path, capsys, text, words):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    status, out, err = calibrate(capsys, path)
    assert status == 2
    assert out == ""
    assert any(word in err for word in words.split("|")), err
    assert str(path) in err


def test_every_bad_row_is_named_but_not_without_end(tmp_path, capsys):
    path = tmp_path / "bad.csv"
    path.write_text(DIFF + "\n" + "1,2,nan,4,5\n" * 50)
    _, _, err = calibrate(capsys, path)
    assert err.count("expected a finite number") == 20
    assert "and 30 more bad rows" in err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--wheel-angles-deg", "1,2"), "expected three numbers"),
        (("--wheel-angles-deg", "0,0,240", "--model", "omni"), "phi_1_rad"),
        (("--autopilot-radius-m", "0"), "expected a number from"),
        (("--model", "matrix"), "odo_dx_m"),
    ],
)
def test_bad_options_are_refused(tmp_path, capsys, options, words):
    path = write(tmp_path / "d.csv", DIFF, differential(10))
    status, _, err = calibrate(capsys, path, *options)
    assert status == 2
    assert words in err


def test_a_missing_file_is_refused(tmp_path, capsys):
    status, _, err = calibrate(capsys, tmp_path / "none.csv")
    assert status == 2
    assert "none.csv" in err


@pytest.mark.thorough
def test_pictures(tmp_path, capsys):
    path = write(tmp_path / "d.csv", DIFF, differential(60))
    status, _, err = calibrate(capsys, path, "--plots", str(tmp_path / "plots"))
    assert status == 0
    for name in ("calibration_residuals.png", "odometry_path.png"):
        assert (tmp_path / "plots" / name).stat().st_size > 5_000
        assert name in err


# --- recordings -----------------------------------------------------------------------------------

TRACK, SCALES = 0.42, (1.03, 0.98)


def drive(seconds=60.0, step_us=20_000):
    """(t_us, true pose, counters as the autopilot reports them), x ahead, y left."""
    chassis = DifferentialDrive(TRACK)
    pose, counters = (0.0, 0.0, 0.0), [10.0, -4.0]
    for i in range(round(seconds * 1e6 / step_us)):
        t_s = i * step_us * 1e-6
        yield 1_000_000 + i * step_us, pose, tuple(counters)
        motion = (0.8 * step_us * 1e-6, 0.0, 0.9 * math.sin(0.5 * t_s) * step_us * 1e-6)
        pose = se2.compose(pose, se2.exp(motion))
        ways = chassis.wheels(motion)
        counters = [c + w / s for c, w, s in zip(counters, ways, SCALES, strict=True)]


def messages(kind):
    for i, (t_us, (x, y, heading), counters) in enumerate(drive()):
        yaw = -heading
        if i % 5 == 0:
            distances = [*counters, *[0.0] * 14]
            yield mavlink.MAVLink_wheel_distance_message(t_us, 2, distances)
        q = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
        if kind == "ODOMETRY":
            yield mavlink.MAVLink_odometry_message(
                t_us, 20, 12, x, -y, 0.0, q, 0.8, 0, 0, 0, 0, 0, [0.0] * 21, [0.0] * 21
            )
        elif kind == "VISION_POSITION_ESTIMATE":
            yield mavlink.MAVLink_vision_position_estimate_message(t_us, x, -y, 0, 0, 0, yaw)
        elif kind == "ATT_POS_MOCAP":
            yield mavlink.MAVLink_att_pos_mocap_message(t_us, q, x, -y, 0.0)
        elif kind == "LOCAL_POSITION_NED":
            ms = t_us // 1000
            yield mavlink.MAVLink_local_position_ned_message(ms, x, -y, 0, 0, 0, 0)
            yield mavlink.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0)


def tlog(path, kind):
    encoder = Encoder(1, 1)
    with path.open("wb") as file:
        for i, message in enumerate(messages(kind)):
            file.write(struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i))
            file.write(encoder.encode(message))
    return path


@pytest.mark.parametrize(
    "kind", ["ODOMETRY", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP", "LOCAL_POSITION_NED"]
)
def test_wheel_distance_with_a_pose_from_a_tlog(tmp_path, capsys, kind):
    status, out, _ = calibrate(capsys, tlog(tmp_path / "rover.tlog", kind), "--json")
    document = json.loads(out)
    assert status == 0
    assert document["track_m"] == pytest.approx(TRACK, rel=0.01)
    assert document["radius_left_m"] == pytest.approx(SCALES[0], rel=0.01)
    assert document["radius_right_m"] == pytest.approx(SCALES[1], rel=0.01)
    assert OdometrySettings(**document["configuration"]).scales == pytest.approx(SCALES, rel=0.01)


DRIVE = "time_s,way_left_m,way_right_m,x_m,y_m,heading_rad"


def drive_rows():
    return [(t_us * 1e-6, *counters, *pose) for t_us, pose, counters in drive()]


def test_a_table_of_counters_and_poses(tmp_path, capsys):
    path = write(tmp_path / "drive.csv", DRIVE, drive_rows())
    status, out, _ = calibrate(capsys, path, "--json")
    document = json.loads(out)
    assert status == 0
    assert document["track_m"] == pytest.approx(TRACK, rel=0.01)
    assert document["radius_left_m"] == pytest.approx(SCALES[0], rel=0.01)
    # The same counters through the daemon's odometry: 48 m, and nearly where the reference is.
    assert document["drive"]["length_m"] == pytest.approx(0.8 * 60.0, rel=0.01)
    assert document["drive"]["end_error_m"] < 0.1
    assert document["drive"]["end_error_sigmas"] < 1.0


def test_the_autopilots_radius_turns_counters_into_angles(tmp_path, capsys):
    path = write(tmp_path / "drive.csv", DRIVE, drive_rows())
    _, out, _ = calibrate(capsys, path, "--json", "--autopilot-radius-m", "0.05")
    document = json.loads(out)
    assert document["radius_left_m"] == pytest.approx(0.05 * SCALES[0], rel=0.01)
    assert OdometrySettings(**document["configuration"]).scales == pytest.approx(SCALES, rel=0.01)
    assert document["drive"]["end_error_m"] < 0.1


def test_a_drive_that_goes_back_in_time_is_refused(tmp_path, capsys):
    rows = drive_rows()
    rows[100] = rows[3]
    status, _, err = calibrate(capsys, write(tmp_path / "drive.csv", DRIVE, rows))
    assert status == 2
    assert ":102: time_s does not rise" in err


@pytest.mark.parametrize(("kind", "words"), [("none", "no pose")])
def test_a_recording_without_a_pose_is_refused(tmp_path, capsys, kind, words):
    status, _, err = calibrate(capsys, tlog(tmp_path / "rover.tlog", kind))
    assert status == 2
    assert words in err


def test_a_recording_without_wheels_is_refused(tmp_path, capsys):
    path = tmp_path / "no_wheels.tlog"
    message = mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)
    path.write_bytes((struct.pack(">Q", 1_700_000_000_000_000) + Encoder(1, 1).encode(message)) * 3)
    status, _, err = calibrate(capsys, path)
    assert status == 2
    assert "no WHEEL_DISTANCE" in err


@pytest.mark.parametrize(("gap_s", "is_bridged"), [(1.5, True), (1.6, False), (7.0, False)])
def test_increments_end_where_the_wheels_are_unknown_for_long(gap_s, is_bridged):
    times_s = (*np.arange(0.0, 2.05, 0.5), *np.arange(2.0 + gap_s, 4.05 + gap_s, 0.5))
    readings = [WheelSample(1 + round(1e6 * t_s), (t_s, t_s)) for t_s in times_s]
    poses = [TimedPose(round(1e5 * k), (0.1 * k, 0.0, 0.0)) for k in range(130)]
    found = [motion[0] for _, motion in increments(readings, poses)]
    assert found == pytest.approx([*[0.5] * 4, *[gap_s] * is_bridged, *[0.5] * 4])


def test_increments_do_not_bridge_gaps_or_time_going_back():
    readings = [WheelSample(1_000_000 + 100_000 * i, (0.1 * i, 0.1 * i)) for i in range(40)]
    readings[20:] = [r._replace(t_us=r.t_us - 2_500_000) for r in readings[20:]]
    poses = [TimedPose(1_000_000 + 100_000 * i, (0.1 * i, 0.0, 0.0)) for i in range(60)]
    for ways, motion in increments(readings, poses):
        if ways[0] != pytest.approx(motion[0]):
            pytest.fail(f"{ways} against {motion}")
    holes = [pose for i, pose in enumerate(poses) if not 8 <= i <= 16]
    good = list(increments(readings[:20], holes))
    assert all(ways[0] == pytest.approx(motion[0]) for ways, motion in good)
