"""The whole program over loopback, as processes: start, stop, kill, no disk, exact replay."""

import io
import json
import signal
import subprocess
from contextlib import redirect_stdout

import pytest
from daemon_process import H2NAV, daemon, fake_autopilot, free_udp_port, the_log

from h2nav.cli import main
from h2nav.recordings.recording import open_recording

FILTERS = (
    "name: default",
    *(
        pytest.param(keys, marks=pytest.mark.thorough)
        for keys in ("name: constant_gain, arithmetic: fixed", "arithmetic: fixed")
    ),
)


def replayed(log, *arguments):
    with redirect_stdout(io.StringIO()) as said:
        assert main(["replay", str(log), "--no-log", "--json", *arguments]) == 0
    return json.loads(said.getvalue())


def configuration(folder, port, filter_keys="name: default"):
    path = folder / "config.yaml"
    path.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\n"
        f"filter: {{{filter_keys}}}\n"
        f"autopilot: {{simulation_truth: true}}\n"
        f"log: {{folder: '{folder / 'logs'}'}}\n"
    )
    return str(path)


@pytest.mark.parametrize("filter_keys", FILTERS)
def test_a_recorded_flight_replays_to_the_very_same_estimates(tmp_path, filter_keys):
    port = free_udp_port()
    with (
        daemon("-c", configuration(tmp_path, port, filter_keys)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "flight", "--seed", "3"),
    ):
        running.wait_for_samples(400)
        assert running.stop() == 0
    log = the_log(tmp_path / "logs")
    link = [fields for _, fields in open_recording(log).records("/link")][-1]
    deframer = [fields for _, fields in open_recording(log).records("/deframer")][-1]
    assert link["opened"] == 1
    assert link["frames_out"] > 100
    assert deframer["frames"] >= link["chunks_in"] > 400
    result = replayed(log)
    assert result["estimates_compared"] > 300
    assert result["estimates_equal"] == result["estimates_compared"]
    assert result["reference"] == "SIMSTATE"
    assert result["rms_deg"]["tilt"] < 1.0


def test_sigint_ends_with_0_and_a_closed_log_as_sigterm_does(tmp_path):
    port = free_udp_port()
    with (
        daemon("--connect", f"udpin:127.0.0.1:{port}", "--log-dir", str(tmp_path)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "rest"),
    ):
        running.wait_for_samples(50)
        assert running.stop(signal.SIGINT) == 0
    assert the_log(tmp_path).stat().st_size > 0


@pytest.mark.thorough
def test_a_killed_daemon_leaves_a_log_that_can_be_recovered(tmp_path):
    port = free_udp_port()
    with (
        daemon("--connect", f"udpin:127.0.0.1:{port}", "--log-dir", str(tmp_path)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "rest"),
    ):
        running.wait_for_samples(300)
        running.stop(signal.SIGKILL)
    recovered = tmp_path / "recovered.mcap"
    cut = the_log(tmp_path, ".active")
    assert main(["log", "recover", str(cut), "-o", str(recovered)]) in (0, 3)
    # At most the last second is lost: of more than three seconds of samples, two remain.
    assert replayed(recovered)["imu_samples"] >= 190


def test_without_a_usable_log_folder_the_daemon_flies_on_and_says_so(tmp_path):
    blocked = tmp_path / "file-in-the-way"
    blocked.write_text("")
    port = free_udp_port()
    with (
        daemon(
            "--connect", f"udpin:127.0.0.1:{port}", "--log-dir", str(blocked / "logs")
        ) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "rest"),
    ):
        running.wait_for_samples(150)
        assert running.stop() == 0
        said = running.process.stderr.read().decode()
    assert str(blocked) in said


def test_wrong_use_is_one_line_and_2(tmp_path):
    for words in (["run"], ["run", "--connect", "smoke:1"], ["run", "-c", str(tmp_path / "no")]):
        done = subprocess.run([*H2NAV, *words], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1


def test_the_daemons_imports_stay_light():
    """No solver, no plotting, and nothing that takes a second to load."""
    code = "import sys, h2nav.apps.session; print(' '.join(sys.modules))"
    done = subprocess.run([H2NAV[0], "-c", code], capture_output=True, text=True, check=True)
    assert not {"cvxpy", "scipy", "matplotlib", "numpy"} & set(done.stdout.split())
