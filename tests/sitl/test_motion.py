"""Motion over real loopback: fake autopilot and daemon as processes, checked by the log."""

import bisect
import math

import numpy as np
import pytest
from daemon_process import daemon, fake_autopilot, free_udp_port, the_log
from needs import DEG

from h2nav.cli import main
from h2nav.maths import quaternion
from h2nav.recordings.recording import open_recording
from h2nav.service.lateness import LATE_NS
from h2nav.sim.scenarios import scenario

pytestmark = pytest.mark.thorough

BIAS_DEG_S = (1.5, -1.0, 0.8)


def flown(folder, sections, samples, *autopilot):
    """The log of a run of so many IMU samples at 100 Hz."""
    port = free_udp_port()
    path = folder / "config.yaml"
    path.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\nlog: {{folder: '{folder / 'logs'}'}}\n{sections}"
    )
    with (
        daemon("-c", str(path)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--seed", "3", *autopilot),
    ):
        running.wait_for_samples(samples)
        assert running.stop() == 0
    return the_log(folder / "logs")


def records(log, topic):
    """The records of a topic, without what depends on when they were made."""
    found = [fields for _, fields in open_recording(log).records(topic)]
    return [{k: v for k, v in fields.items() if k != "late_ms"} for fields in found]


def assert_replays_exactly(log, topics):
    """A replay gives the very same estimates of motion."""
    again = log.parent / "again.mcap"
    assert main(["replay", str(log), "-o", str(again)]) == 0
    for topic in topics:
        assert records(again, topic) == records(log, topic)


def in_time(log):
    """How many estimates of motion were not held back, as those are that come late."""
    recording = open_recording(log)
    attitudes = [fields for _, fields in recording.records("/estimate")]
    times = [fields["t_us"] for fields in attitudes]
    moved = [fields["t_us"] for fields in records(log, "/odometry")]
    newest = [max(bisect.bisect_right(times, t_us) - 1, 0) for t_us in moved]
    return sum(attitudes[row]["late_ms"] * 1e6 <= LATE_NS for row in newest)


def sent_odometry(log):
    """How many ODOMETRY frames the log says were sent."""
    folder = log.parent / "csv"
    assert main(["log", "export", str(log), "-o", str(folder)]) == 0
    (table,) = folder.glob("*tx*ODOMETRY*.csv")
    return len(table.read_text().splitlines()) - 1


def assert_mostly_below(errors, median, most):
    """Half and 95 % of the errors; poses that a held-up machine loses make some larger."""
    assert np.quantile(errors, 0.5) < median
    assert np.quantile(errors, 0.95) < most


def test_a_camera_gives_twist_and_bias(tmp_path):
    """2 deg/s of bias, 30 Hz, 50 ms late, a tenth lost; exact replay; ODOMETRY on the wire.

    How fast the errors fall depends on where in the motion a loaded machine begins: that 5 s are
    enough is shown without processes, in scenarios/test_motion_twist.py.
    """
    log = flown(
        tmp_path,
        "motion: {estimator: twist}\n",
        960,
        *("--scenario", "hover", "--gyro-bias-deg-s", *map(str, BIAS_DEG_S)),
        *("--vision", "odometry", "--vision-delay-ms", "50", "--vision-drop-out", "0.1"),
    )
    twists = records(log, "/twist")
    settled = twists[-50:]
    assert settled[0]["t_us"] > twists[0]["t_us"] + 5_000_000
    velocity_m_s, position_m, bias_deg_s = [], [], []
    for record in settled:
        truth = scenario("hover").motion(record["t_us"] * 1e-6)
        v_b = quaternion.rotate(quaternion.conjugate(truth.q_nb), truth.v_n)
        velocity_m_s.append(math.dist(v_b, [record[f"v{axis}_m_s"] for axis in "xyz"]))
        position_m.append(math.dist(truth.p_n, [record[f"{axis}_m"] for axis in "xyz"]))
        bias = [record[f"bias_{axis}_rad_s"] / DEG for axis in "xyz"]
        bias_deg_s.append(math.dist(bias, BIAS_DEG_S))
    assert_mostly_below(velocity_m_s, median=0.15, most=0.25)
    assert_mostly_below(position_m, median=0.06, most=0.1)
    # 0.1 deg/s per axis are drawn from the seed.
    assert_mostly_below(bias_deg_s, median=0.5, most=0.7)
    assert in_time(log) == sent_odometry(log) > 90
    assert all(r["verdict"] != "pose_jump" for r in records(log, "/pose_measured"))
    assert_replays_exactly(log, ("/estimate", "/twist", "/odometry", "/pose_measured"))


def test_wheels_give_the_way_of_a_rover(tmp_path):
    """Half of the half circle, 0.4 m track, within 0.15 m; exact replay; ODOMETRY on the wire."""
    log = flown(
        tmp_path,
        "motion: {estimator: wheels}\nodometry: {track_m: 0.4}\nfilter: {vehicle_class: rover}\n",
        520,
        *("--scenario", "half-circle"),
    )
    sent = records(log, "/odometry")
    assert in_time(log) == sent_odometry(log) > 60
    last = sent[-1]
    north, east, _ = scenario("half-circle").motion(last["t_us"] * 1e-6).p_n
    assert math.hypot(north, east) > 1.0
    assert math.dist((north, east), (last["x_m"], last["y_m"])) < 0.15
    assert last["reset_counter"] == 0
    wheels = records(log, "/wheels")[-1]
    assert wheels["x_m"] == pytest.approx(last["x_m"], abs=0.2)
    assert_replays_exactly(log, ("/wheels", "/odometry"))
