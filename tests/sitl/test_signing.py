"""Message signing between processes: the daemon and the fake autopilot, with one key or two."""

import contextlib
import io
import json
import socket
import subprocess

import pytest
from daemon_process import H2NAV, WAIT_S, daemon, fake_autopilot, free_udp_port, the_log
from signing_peer import Peer

from h2nav.cli import main
from h2nav.files.signing_keys import read_signing_key
from h2nav.recordings.recording import open_recording

FAR_AHEAD = 200_000_000_000_000  # a stamp of 2078
SECRET = "correct-horse-battery-staple"


@pytest.fixture
def key_file(tmp_path):
    """As a user makes it."""
    path = tmp_path / "key"
    command = [*H2NAV, "signing-key", "-o", str(path)]
    subprocess.run(command, input=f"{SECRET}\n", text=True, check=True, capture_output=True)
    return path


@pytest.fixture
def port():
    return free_udp_port()


def written_configuration(folder, url):
    path = folder / "config.yaml"
    path.write_text(
        f"link: {{url: '{url}'}}\n"
        f"signing: {{key_file: '{folder / 'key'}', state_file: '{folder / 'stamp'}'}}\n"
        f"log: {{folder: '{folder / 'logs'}'}}\n"
    )
    return str(path)


def last(log, topic):
    return [fields for _, fields in open_recording(log).records(topic)][-1]


@pytest.mark.thorough
def test_a_signed_flight_is_estimated_answered_and_replayed(tmp_path, port, key_file):
    with (
        daemon("-c", written_configuration(tmp_path, f"udpin:127.0.0.1:{port}")) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--signing-key", str(key_file)),
    ):
        # 100 Hz come only if the autopilot has obeyed, so verified, our requests.
        running.wait_for_samples(300)
        assert running.stop() == 0
    log = the_log(tmp_path / "logs")
    counts = last(log, "/signing")
    assert counts["signed"] > 300
    assert not any(counts[cause] for cause in ("unsigned", "bad_signature", "replayed"))
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert main(["replay", str(log), "--no-log", "--json"]) == 0
    result = json.loads(said.getvalue())
    assert result["estimates_compared"] > 200
    assert result["estimates_equal"] == result["estimates_compared"]


@pytest.mark.thorough
@pytest.mark.parametrize("other", ["no key", "another key"])
def test_an_autopilot_without_our_key_is_not_used_and_the_cause_is_told(
    tmp_path, port, key_file, other
):
    arguments = []
    if other == "another key":
        wrong = tmp_path / "wrong"
        wrong.write_bytes(b"x" * 32)
        wrong.chmod(0o600)
        arguments = ["--signing-key", str(wrong)]
    told = "its signature is wrong" if arguments else "it is not signed"
    with (
        daemon("-c", written_configuration(tmp_path, f"udpin:127.0.0.1:{port}")) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", *arguments),
    ):
        running.wait_for(lambda event: told in event.get("text", ""))
        status = running.wait_for(lambda event: "samples_used" in event)
        assert status["samples_used"] == 0
        assert status["state"] == "no_autopilot"
        assert running.stop() == 0


def test_pymavlink_believes_all_that_we_send_also_after_a_restart_with_the_clock_behind(
    tmp_path, key_file
):
    """To it a stamp that is not later is a replay."""
    peer = Peer(key=read_signing_key(key_file), stamp=0)
    (tmp_path / "stamp").write_text(f"{FAR_AHEAD}\n")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ears:
        ears.bind(("127.0.0.1", 0))
        ears.settimeout(WAIT_S)
        written = written_configuration(tmp_path, f"udpout:127.0.0.1:{ears.getsockname()[1]}")
        for _ in range(2):
            with daemon("-c", written) as running:
                for _ in range(3):
                    assert peer.believes(ears.recv(1024))
                assert running.stop() == 0
            ears.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                while True:
                    assert peer.believes(ears.recv(1024))
            ears.settimeout(WAIT_S)
    assert peer.mav.signing.timestamp > FAR_AHEAD
    assert int((tmp_path / "stamp").read_text()) == peer.mav.signing.timestamp


@pytest.mark.thorough
def test_an_autopilot_whose_clock_is_behind_is_used_once_it_has_heard_us(tmp_path, port, key_file):
    """As PX4 is at each start, and ArduPilot until its GPS has the time."""
    (tmp_path / "stamp").write_text(f"{FAR_AHEAD}\n")
    with (
        daemon("-c", written_configuration(tmp_path, f"udpin:127.0.0.1:{port}")) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--signing-key", str(key_file)),
    ):
        running.wait_for_samples(50)
        assert running.stop() == 0
    assert last(the_log(tmp_path / "logs"), "/signing")["old_stamp"] > 0


@pytest.mark.thorough
def test_without_a_place_for_the_stamp_the_daemon_signs_on_and_says_so(tmp_path, port, key_file):
    written = written_configuration(tmp_path, f"udpin:127.0.0.1:{port}")
    (tmp_path / "stamp.new").mkdir()
    with (
        daemon("-c", written) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--signing-key", str(key_file)),
    ):
        event = running.wait_for(lambda event: "cannot be stored" in event.get("text", ""))
        assert event["severity"] == "error"
        running.wait_for_samples(50)
        assert running.stop() == 0


@pytest.mark.parametrize("command", ["run -c", "check-config"])
def test_a_key_that_others_can_read_is_refused_in_one_line(tmp_path, port, key_file, command):
    key_file.chmod(0o644)
    written = written_configuration(tmp_path, f"udpin:127.0.0.1:{port}")
    words = [*H2NAV, *command.split(), written]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"{key_file}: " in done.stderr
    assert "chmod 600" in done.stderr


def test_the_passphrase_is_never_shown(tmp_path):
    path = tmp_path / "key"
    command = [*H2NAV, "signing-key", "-o", str(path)]
    done = subprocess.run(command, input=SECRET, text=True, capture_output=True, check=True)
    assert SECRET not in done.stdout + done.stderr
    again = subprocess.run(command, input=SECRET, text=True, capture_output=True, check=False)
    assert again.returncode == 2
    assert again.stderr.count("\n") == 1
