"""`h2nav demo` as a user runs it: its result, its log, and nothing left running."""

import json
import os
import pty
import select
import signal
import subprocess
import termios
from pathlib import Path

import pytest
from daemon_process import H2NAV, WAIT_S, the_log

SECONDS = "5"


def running_with(text):
    """Processes whose command line has this in it, by id."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            state = (process / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if text in words and state != "Z":
            found[int(process.name)] = words
    return found


def demo(*arguments, **options):
    return subprocess.run(
        [*H2NAV, "demo", *arguments], capture_output=True, text=True, check=False, **options
    )


def test_it_flies_prints_and_leaves_a_log(tmp_path):
    done = demo("--seconds", SECONDS, "--log-dir", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["ok"] is True
    assert result["imu_messages"] > 50
    assert result["attitudes_sent"] > 30
    assert {"roll", "pitch", "yaw"} <= set(result["rms_deg"])
    assert all(0.0 < result["rms_deg"][name] < 2.0 for name in ("roll", "pitch", "yaw"))
    assert Path(result["log"]) == the_log(tmp_path)


@pytest.mark.thorough
def test_it_says_what_to_try_next(tmp_path):
    done = demo("--seconds", SECONDS, "--log-dir", str(tmp_path))
    assert done.returncode == 0, done.stderr
    log = the_log(tmp_path)
    for line in ("  roll ", "  pitch ", "  yaw ", f"  h2nav log info {log}", "  h2nav run "):
        assert line in done.stdout
    assert "Traceback" not in done.stderr


def test_too_short_a_flight_fails_and_says_why(tmp_path):
    done = demo("--seconds", "0.01", "--log-dir", str(tmp_path), "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["ok"] is False
    # No byte has arrived, or no heartbeat: how far it came is the machine's.
    why = done.stderr.splitlines()[-1]
    assert any(f"the service is {state} " in why for state in ("no_link", "no_autopilot"))


@pytest.mark.parametrize("words", [["--seconds", "-1"], ["--seconds", "nan"], ["--scenario", "x"]])
def test_wrong_use_is_2(words):
    done = demo(*words)
    assert done.returncode == 2
    assert words[0] in done.stderr.splitlines()[-1]


@pytest.mark.thorough
def test_a_fake_autopilot_that_dies_ends_it(tmp_path):
    """With the reason, long before the flight's end."""
    seed = unlikely_seed(0)
    with subprocess.Popen(
        [*H2NAV, "demo", "--seconds", "600", "--seed", seed, "--log-dir", str(tmp_path)],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as process:
        wait_until_bound(process)
        (autopilot,) = (
            number for number, words in running_with(f"--seed {seed}").items() if "udpout" in words
        )
        os.kill(autopilot, signal.SIGKILL)
        assert process.wait(WAIT_S) == 1
        assert "fake autopilot ended with status -9" in process.stderr.read()


@pytest.mark.thorough
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_and_its_autopilot(tmp_path, number):
    seed = unlikely_seed(number)
    with subprocess.Popen(
        [*H2NAV, "demo", "--seconds", "600", "--seed", seed, "--log-dir", str(tmp_path)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        wait_until_bound(process)
        assert len(running_with(f"--seed {seed}")) == 2
        process.send_signal(number)
        assert process.wait(WAIT_S) == 130
        assert process.stderr.read().splitlines()[-1] == "h2nav: interrupted"
    assert running_with(f"--seed {seed}") == {}
    assert the_log(tmp_path).stat().st_size > 0


def unlikely_seed(number):
    """One that no other demo on this machine has, so that its processes can be told."""
    return str(os.getpid() * 100 + number)


def wait_until_bound(process):
    """Reads what the demo says until the daemon has found the autopilot."""
    for line in process.stderr:
        if "bound to" in line:
            return
    raise AssertionError("the demo ended early")


def test_its_keys_break_the_vehicle_and_the_terminal_is_clean_afterwards(tmp_path):
    words = [*H2NAV, "demo", "--seconds", "600", "--log-dir", str(tmp_path)]
    child, terminal = pty.fork()
    if child == 0:
        os.execve(words[0], words, {**os.environ, "TERM": "xterm"})
    shown = ""
    try:
        for awaited, key in (
            ("info: active", b"h"),
            ("notice: autopilot-heading=20: the heading of ATTITUDE", b"0"),
            ("notice: over: autopilot-heading=20", b"q"),
            ("next, try", b""),
        ):
            while awaited not in shown:
                assert select.select([terminal], [], [], WAIT_S)[0], shown
                shown += os.read(terminal, 65536).decode()
            os.write(terminal, key)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        child = 0
        assert termios.tcgetattr(terminal)[3] & termios.ECHO
    finally:
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        os.close(terminal)
    assert "h2nav " in shown  # the panel
