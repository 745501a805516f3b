"""The sections `motion`, `twist` and `odometry` of the daemon's configuration."""

import json
import re

import numpy as np
import pytest

from h2nav import cli
from h2nav.apps import configuration
from h2nav.errors import BadInput
from h2nav.motion.wheels import DifferentialDrive, OmniDrive

RADIUS_M = 0.05
DRIVES = {
    "phi_left_rad,phi_right_rad": DifferentialDrive(0.3),
    "phi_1_rad,phi_2_rad,phi_3_rad": OmniDrive(tuple(np.radians([0.0, 120.0, 240.0])), 0.2),
}


def errors(text, tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        configuration.read(path)
    return caught.value.lines


def test_motion_is_checked_with_the_rest(tmp_path):
    text = (
        "motion: {estimator: twist, pose_component_id: 191}\ntwist: {velocity: measured}\n"
        "odometry: {layout: omni, angle_2_deg: 0}\n"
    )
    lines = errors(text, tmp_path)
    for key in ("motion.pose_component_id", "twist.velocity", "odometry.angle_1_deg"):
        assert any(key in line for line in lines)


def test_the_observers_own_rule_names_the_file_and_the_section(tmp_path):
    (line,) = errors("twist: {a1: 0.5}\n", tmp_path)
    assert "config.yaml: twist" in line
    assert "above 0.5" in line


def test_wheel_distances_and_odometry_count_on_a_serial_link(tmp_path):
    text = (
        "link: {url: 'serial:/dev/ttyAMA0:57600'}\nautopilot: {imu_rate_hz: 50}\n"
        "motion: {estimator: wheels}\noutput: {attitude_rate_hz: 40}\n"
    )
    lines = errors(text, tmp_path)
    assert any("lower it to 21 " in line for line in lines)
    assert any("the outputs need" in line for line in lines)


@pytest.mark.parametrize("columns", DRIVES)
def test_what_calibrate_prints_is_a_configuration_of_the_daemon(tmp_path, capsys, columns):
    drive = DRIVES[columns]
    rng = np.random.default_rng(1)
    phi = rng.uniform(-5.0, 5.0, (200, columns.count(",") + 1))
    motion = [drive.motion(tuple(RADIUS_M * angle for angle in row)) for row in phi.tolist()]
    table = np.hstack([phi, np.array(motion) + 1e-3 * rng.normal(size=(200, 3))])
    data = tmp_path / "data.csv"
    np.savetxt(data, table, delimiter=",", header=columns + ",dx_m,dy_m,dtheta_rad", comments="")
    words = ["odometry", "calibrate", str(data), "--autopilot-radius-m", "0.05"]
    assert cli.main(words) == 0
    printed = capsys.readouterr().out
    path = tmp_path / "config.yaml"
    path.write_text("motion: {estimator: wheels}\n" + printed[printed.index("\nodometry:") :])
    assert cli.main(["check-config", str(path)]) == 0
    scales = configuration.read(path).odometry.scales
    assert scales == pytest.approx([1.0] * len(scales), rel=0.01)
    capsys.readouterr()
    assert cli.main([*words, "--json"]) == 0
    the_same(printed, json.loads(capsys.readouterr().out))


def the_same(printed, document):
    """What is printed for people is what the document says."""
    lines = printed.split("\n\nodometry:")[0].splitlines()
    first, *parameters, fit = [line for line in lines if not line.startswith("  note: ")]
    assert first.startswith(f"{document['model']} from ")
    assert first.endswith(f"; reference read as {document['reference_read_as']}")
    assert len(parameters) == len(document["parameters"])
    for place, (line, name) in enumerate(zip(parameters, document["parameters"], strict=True)):
        shown, value, between, sigma = line.split()
        assert (shown, between) == (name, "+-")
        assert float(value) == pytest.approx(document[name], rel=1e-5)
        assert float(sigma) == pytest.approx(document["covariance"][place][place] ** 0.5, rel=0.05)
    numbers = [float(text) for text in re.findall(r"[-+.e\d]*\d", fit)]
    assert numbers == pytest.approx(
        [
            document["rank"],
            document["unknowns"],
            document["condition"],
            1e3 * document["residual_rms_m"],
            1e3 * document["residual_rms_rad"],
        ],
        rel=0.01,
    )
    assert f"solver {document['solver']}," in fit
    notes = [line.removeprefix("  note: ") for line in lines if line.startswith("  note: ")]
    assert notes == document["notes"]
