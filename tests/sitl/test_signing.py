"""Message signing between processes: the daemon and the fake autopilot, with one key or two."""

import json
import subprocess

import pytest
from daemon_process import H2NAV, daemon, fake_autopilot, free_udp_port, the_log

from h2nav.io.deframer import Deframer
from h2nav.io.recorder import SENT_TOPIC
from h2nav.io.recordings import open_recording

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


def written_configuration(folder, port, key_file):
    path = folder / "config.yaml"
    path.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\n"
        f"signing: {{key_file: '{key_file}', state_file: '{folder / 'stamp'}'}}\n"
        f"log: {{folder: '{folder / 'logs'}'}}\n"
    )
    return str(path)


def last(log, topic):
    return [fields for _, fields in open_recording(log).records(topic)][-1]


def sent_stamps(log):
    """The time stamps of all that was sent, from the signatures."""
    deframer = Deframer()
    frames = [
        frame
        for topic, _, stored in open_recording(log)._messages("mavlink")
        if topic.startswith(SENT_TOPIC)
        for frame in deframer.feed(stored.data)
    ]
    assert all(frame.signed for frame in frames)
    return [int.from_bytes(frame.raw[-12:-6], "little") for frame in frames]


def test_a_signed_flight_is_estimated_answered_and_replayed(tmp_path, port, key_file):
    with (
        daemon("-c", written_configuration(tmp_path, port, key_file)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--signing-key", str(key_file)),
    ):
        # 100 Hz come only if the autopilot has obeyed, so verified, our requests.
        running.wait_for_samples(300)
        assert running.stop() == 0
    log = the_log(tmp_path / "logs")
    counts = last(log, "/signing")
    assert counts["signed"] > 300
    assert not any(counts[cause] for cause in ("unsigned", "bad_signature", "replayed"))
    stamps = sent_stamps(log)
    assert stamps == sorted(set(stamps))
    assert int((tmp_path / "stamp").read_text()) >= stamps[-1]
    replay = [*H2NAV, "replay", str(log), "--no-log", "--json"]
    result = json.loads(subprocess.run(replay, capture_output=True, check=True, text=True).stdout)
    assert result["estimates_compared"] > 200
    assert result["estimates_equal"] == result["estimates_compared"]


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
        daemon("-c", written_configuration(tmp_path, port, key_file)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", *arguments),
    ):
        running.wait_for(lambda event: told in event.get("text", ""))
        status = running.wait_for(lambda event: "samples_used" in event)
        assert status["samples_used"] == 0
        assert status["state"] == "no_autopilot"
        assert running.stop() == 0


def test_stamps_go_on_where_they_ended_although_the_clock_is_behind(tmp_path, port, key_file):
    (tmp_path / "stamp").write_text(f"{FAR_AHEAD}\n")
    with (
        daemon("-c", written_configuration(tmp_path, port, key_file)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--signing-key", str(key_file)),
    ):
        # The autopilot's stamps are old until it has heard ours.
        running.wait_for_samples(50)
        assert running.stop() == 0
    stamps = sent_stamps(the_log(tmp_path / "logs"))
    assert min(stamps) > FAR_AHEAD
    assert int((tmp_path / "stamp").read_text()) >= max(stamps)


def test_without_a_place_for_the_stamp_the_daemon_signs_on_and_says_so(tmp_path, port, key_file):
    written = written_configuration(tmp_path, port, key_file)
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
    written = written_configuration(tmp_path, port, key_file)
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
