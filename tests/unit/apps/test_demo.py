"""`h2nav demo`: when it counts as flown, what it tells, and how it treats the other process."""

import io
import json
import subprocess
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from one_command import main

from h2nav.apps import demo
from h2nav.cli import BAD_INPUT, FAILED, INTERRUPTED, SUCCESS
from h2nav.recordings.reference import ErrorTable
from h2nav.service.records import HealthRecord
from h2nav.sim.orders import KEYS

GOOD = ErrorTable("SIMSTATE", 900, 0.1, 0.2, 0.3, 0.25, 0.4)
HEALTH = HealthRecord("active", "", "1/1", "RAW_IMU", 100.0, 950, 3, 940, True, True)


class FakeProcess:
    """The fake autopilot's process: `status` once it has ended."""

    def __init__(self):
        self.status, self.stdin, self.calls, self.is_stubborn = None, io.BytesIO(), [], False

    def poll(self):
        return self.status

    def terminate(self):
        self.calls.append("terminate")

    def kill(self):
        self.calls.append("kill")

    def wait(self, timeout_s=None):
        self.calls.append(("wait", timeout_s))
        if timeout_s is not None and self.is_stubborn:
            raise subprocess.TimeoutExpired("fake", timeout_s)


class FakeReference:
    """Notes what it is told of, and has the table that a test made."""

    message_ids = frozenset({30})

    def __init__(self, table):
        self.frames, self.estimates, self.made = [], [], table

    def table(self):
        return self.made

    def frame(self, t_ns, frame):
        self.frames.append((t_ns, frame))

    def estimate(self, t_ns, estimate):
        self.estimates.append((t_ns, estimate))


class Bench:
    """A demo whose processes and flight a test makes."""

    def __init__(self, monkeypatch, tmp_path):
        self.process, self.table, self.health = FakeProcess(), GOOD, HEALTH
        self.folder, self.orders, self.opened = tmp_path, [], []
        self.log, self.page_url, self.looks = tmp_path / "a.mcap", "", 1
        self.is_signalled, self.said = False, b""
        bench = self

        class FakeSession:
            def __init__(self, configuration, onlooker):
                bench.configuration, bench.onlooker = configuration, onlooker
                self.link = SimpleNamespace(local_port=4711)
                self.service = SimpleNamespace(health=bench.health)
                self.recorder = bench.log and SimpleNamespace(path=bench.log)
                self.page_url = bench.page_url

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

            def open(self):
                pass

            def run(self, stop, seconds):
                bench.seconds = seconds
                bench.onlooker.frame(1, "a frame")
                bench.onlooker.estimate(2, "an estimate", 3)
                bench.notices = []
                bench.onlooker.notice = lambda *notice: bench.notices.append(notice)
                if bench.is_signalled:
                    stop.stop()
                for number in range(bench.looks):
                    bench.onlooker.status(number, lambda t_ns: None)

        def start_module(module, *words, stderr, **streams):
            self.words, self.streams = (module, *words), streams
            stderr.write(self.said)
            stderr.flush()
            return self.process

        @contextmanager
        def order_input(keys):
            self.keys = keys
            reader, writer = demo.os.pipe()
            demo.os.write(writer, b"x" if self.orders else b"")
            demo.os.close(writer)
            given = SimpleNamespace(
                has_keys=False,
                fileno=lambda: reader if self.orders else None,
                read=lambda: self.orders.pop(0) if self.orders else [],
            )
            yield given
            demo.os.close(reader)

        monkeypatch.setattr(demo, "Reference", lambda: FakeReference(self.table))
        monkeypatch.setattr(demo, "Session", FakeSession)
        monkeypatch.setattr(demo, "start_module", start_module)
        monkeypatch.setattr(demo, "order_input", order_input)
        monkeypatch.setattr(demo, "open_page", self.opened.append)

    def run(self, *words):
        return main(["demo", "--log-dir", str(self.folder), *words])


@pytest.fixture
def bench(monkeypatch, tmp_path):
    return Bench(monkeypatch, tmp_path)


@pytest.mark.parametrize(
    ("words", "seconds"),
    [
        ([], 20.0),
        (["--live", "127.0.0.1:0"], 600.0),
        (["--live", "127.0.0.1:0", "--seconds", "7"], 7.0),
        (["--seconds", "3600"], 3600.0),
        (["--seconds", "0.5"], 0.5),
    ],
)
def test_it_flies_for_a_while_and_the_other_process_a_little_longer(bench, capsys, words, seconds):
    assert bench.run(*words) == SUCCESS
    assert bench.seconds == seconds
    assert bench.words == (
        "h2nav", "fake-autopilot", "--connect", "udpout:127.0.0.1:4711",
        "--seconds", str(seconds + 10.0), "--scenario", "flight", "--seed", "1",
    )  # fmt: skip
    assert f"flying scenario 'flight' for {seconds:g} s\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--seconds", "0"], "--seconds: expected a number above 0 up to 3600"),
        (["--seconds", "3600.1"], "--seconds: expected a number above 0 up to 3600"),
        (["--seconds", "nan"], "--seconds: expected a number above 0 up to 3600"),
        (["--seed", "-1"], "--seed: expected 0 or more"),
        (["--open"], "--open: without --live there is no page; give both"),
        (["--live", "nonsense"], "live.address: "),
    ],
)
def test_wrong_words_are_one_line(bench, capsys, words, said):
    assert bench.run(*words) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"h2nav: {said}")


def test_the_seed_may_be_zero_and_the_scenario_another(bench):
    assert bench.run("--seed", "0", "--scenario", "hover") == SUCCESS
    assert bench.words[-4:] == ("--scenario", "hover", "--seed", "0")


def test_the_daemon_is_the_usual_one_on_a_free_port_and_asks_for_the_truth(bench):
    assert bench.run("--live", "127.0.0.1:0") == SUCCESS
    chosen = bench.configuration
    assert chosen.link.url == "udpin:127.0.0.1:0"
    assert chosen.autopilot.simulation_truth is True
    assert chosen.log.folder == str(bench.folder)
    assert chosen.live.address == "127.0.0.1:0"
    assert bench.run() == SUCCESS
    assert bench.configuration.live.address == ""


def test_the_other_process_reads_orders_and_says_nothing_on_our_output(bench):
    assert bench.run() == SUCCESS
    assert bench.streams == {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL}
    assert bench.keys == KEYS | {"q": "quit"}


# --- how it went ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("total_deg", "complaint"),
    [
        (0.4, ""),
        (4.99, ""),
        (5.0, "the attitude is off by 5.0 deg; expected below 5"),
        (float("nan"), "the attitude is off by nan deg; expected below 5"),
    ],
)
def test_an_error_of_five_degrees_means_that_something_is_broken(
    bench, capsys, total_deg, complaint
):
    bench.table = GOOD._replace(total=total_deg)
    assert bench.run("--json") == (FAILED if complaint else SUCCESS)
    told = capsys.readouterr()
    assert json.loads(told.out)["ok"] is not bool(complaint)
    assert told.err.endswith(f"h2nav: demo: {complaint}\n" if complaint else "20 s\n")


@pytest.mark.parametrize(
    ("reason", "said"), [("", "no_imu after 7"), ("silent", "no_imu (silent) after 7")]
)
def test_without_a_comparison_the_state_is_the_reason(bench, capsys, reason, said):
    bench.table = ErrorTable("", 0)
    bench.health = HEALTH._replace(state="no_imu", reason=reason, samples_used=7)
    assert bench.run() == FAILED
    assert capsys.readouterr().err.endswith(
        "h2nav: demo: no attitude that could be compared with the truth: the service is "
        f"{said} samples; fly longer with --seconds\n"
    )
    assert bench.run("--json") == FAILED
    found = json.loads(capsys.readouterr().out)
    assert found["rms_deg"] == dict.fromkeys(("roll", "pitch", "yaw", "tilt", "total"))


def test_the_document_has_the_keys_that_others_read(bench, capsys):
    assert bench.run("--json") == SUCCESS
    assert json.loads(capsys.readouterr().out) == {
        "ok": True,
        "imu_messages": 950,
        "attitudes_sent": 940,
        "rms_deg": {"roll": 0.1, "pitch": 0.2, "yaw": 0.3, "tilt": 0.25, "total": 0.4},
        "log": str(bench.log),
    }
    bench.log = None
    assert bench.run("--json") == SUCCESS
    assert json.loads(capsys.readouterr().out)["log"] is None


def test_people_get_a_table_and_what_to_try_next(bench, capsys):
    assert bench.run() == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "950 RAW_IMU messages in, 940 attitudes out"
    assert lines[2] == "RMS error against the simulator's truth (900 samples), deg"
    assert [line.split() for line in lines[3:8]] == [
        ["roll", "0.100"], ["pitch", "0.200"], ["yaw", "0.300"], ["tilt", "0.250"],
        ["total", "0.400"],
    ]  # fmt: skip
    assert f"log: {bench.log}" in lines
    assert lines[-3] == f"  h2nav log info {bench.log}"
    assert lines[-2].startswith(f"  h2nav replay {bench.log} --no-log")
    assert lines[-1].startswith("  h2nav run --connect udpin:0.0.0.0:14550")


def test_without_a_log_or_a_message_that_is_said(bench, capsys):
    bench.log, bench.health = None, HEALTH._replace(imu_message="")
    assert bench.run() == SUCCESS
    out = capsys.readouterr().out
    assert out.startswith("950 IMU messages in")
    assert out.endswith("no log: its folder is not usable\n")
    assert "next, try" not in out


def test_a_signal_interrupts_it(bench, capsys):
    bench.is_signalled = True
    assert bench.run() == INTERRUPTED
    assert capsys.readouterr().out == ""


def test_frames_and_estimates_reach_the_table(bench):
    assert bench.run() == SUCCESS
    assert bench.onlooker.reference.frames == [(1, "a frame")]
    assert bench.onlooker.reference.estimates == [(2, "an estimate")]
    assert bench.onlooker.message_ids == {30}
    assert bench.onlooker._latest == "an estimate"  # the panel shows it, too


# --- the user, and the other process ----------------------------------------------------------


def test_orders_are_passed_on_as_lines_and_answers_are_shown(bench):
    bench.orders = [["gps-lost", "wind 3"], ["rest"]]
    bench.said = b"lost\nnot yet a wh"
    bench.looks = 3
    bench.table = GOOD._replace(total=50.0)  # what an injected fault does is the user's business
    assert bench.run() == SUCCESS
    assert bench.process.stdin.getvalue() == b"gps-lost\nwind 3\nrest\n"
    assert [text for _, _, text in bench.notices] == ["lost"]


def test_a_user_who_quits_gets_the_result(bench, capsys):
    bench.orders = [[" quit "]]
    assert bench.run("--json") == SUCCESS
    assert json.loads(capsys.readouterr().out)["ok"] is True
    assert bench.process.stdin.getvalue() == b""
    bench.orders, bench.table = [["quit"]], GOOD._replace(total=50.0)
    assert bench.run() == FAILED  # to quit is no fault that was put in


def test_an_autopilot_that_ended_is_the_failure_with_its_last_line(bench, capsys):
    bench.process.status, bench.said = 2, b"hello\nh2nav: port in use\n"
    assert bench.run() == FAILED
    assert capsys.readouterr().err.endswith(
        "h2nav: demo: the fake autopilot ended with status 2: h2nav: port in use\n"
    )
    assert bench.process.calls[0] == "terminate"


def test_an_autopilot_that_no_longer_reads_is_found_at_the_next_look(bench):
    class Broken(io.BytesIO):
        def flush(self):
            raise BrokenPipeError

    bench.process.stdin, bench.orders = Broken(), [["rest"]]
    assert bench.run() == SUCCESS


@pytest.mark.parametrize(
    ("is_stubborn", "calls"),
    [
        (False, ["terminate", ("wait", 5.0)]),
        (True, ["terminate", ("wait", 5.0), "kill", ("wait", None)]),
    ],
)
def test_the_other_process_always_ends_gently_first(bench, is_stubborn, calls):
    bench.process.is_stubborn = is_stubborn
    assert bench.run() == SUCCESS
    assert bench.process.calls == calls


@pytest.mark.parametrize(("is_asked", "is_served", "pages"), [(True, True, 1), (True, False, 0), (False, True, 0)])  # fmt: skip  # noqa: E501
def test_the_page_is_opened_once_when_it_is_served(bench, is_asked, is_served, pages):
    bench.looks = 3
    bench.page_url = "http://127.0.0.1:1/" if is_served else ""
    assert bench.run("--live", "127.0.0.1:0", *["--open"] * is_asked) == SUCCESS
    assert bench.opened == ["http://127.0.0.1:1/"] * pages


def test_without_a_folder_the_log_is_in_a_temporary_one(bench, monkeypatch, tmp_path):
    monkeypatch.setattr(demo.tempfile, "mkdtemp", lambda prefix: str(tmp_path / prefix))
    assert main(["demo"]) == SUCCESS
    assert Path(bench.configuration.log.folder) == tmp_path / "h2nav-demo-"
