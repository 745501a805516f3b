"""The command line: help, exit statuses, readers that go away, Ctrl-C."""

import importlib
import io
import os
import socket
import subprocess
import sys

import pytest
from daemon_process import H2NAV, WAIT_S, daemon

from h2nav import __version__
from h2nav.apps import setup
from h2nav.apps.session import Session
from h2nav.cli import BAD_INPUT, COMMANDS, GROUPS, THREADS, main


def said(capsys, *words):
    """What a command that ends at once with 0 prints."""
    with pytest.raises(SystemExit) as caught:
        main(list(words))
    assert caught.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_has_help_with_its_example(command, capsys):
    text = said(capsys, *command, "--help")
    assert "usage: h2nav " + " ".join(command) in text
    assert f"example:\n  h2nav {' '.join(command)}" in text


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_example_is_understood(command, capsys):
    """It parses; what it names need not exist."""
    example = COMMANDS[command].example.split()
    module = importlib.import_module(f"h2nav.apps.{COMMANDS[command].module}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "run", lambda args: 0)
        assert main(example) == 0
    assert capsys.readouterr().err == ""


def test_the_overview_names_every_command_in_one_line(capsys):
    lines = said(capsys, "--help").splitlines()
    for command, (_, summary, _) in COMMANDS.items():
        assert any(line.split() == [*command, *summary.split()] for line in lines)
    assert max(map(len, lines)) <= 96


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_lists_its_commands(group, capsys):
    text = said(capsys, group, "--help")
    for command in COMMANDS:
        assert (f"\n  {' '.join(command)} " in text) == (command[0] == group)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("reveiw flight.bin", "h2nav review"),
        ("log exprt x", "h2nav log export"),
        ("evalute dataset x", "h2nav evaluate dataset"),
        ("info x", "h2nav log info"),
        ("fake_autopilot", "h2nav fake-autopilot"),
    ],
)
def test_a_mistyped_command_gets_its_nearest(words, meant, capsys):
    assert main(words.split()) == BAD_INPUT
    said = capsys.readouterr().err
    assert f"did you mean `{meant}`?" in said
    assert said.count("\n") == 1


def test_what_is_like_no_command_leads_to_the_help(capsys):
    assert main(["zzzzzz"]) == BAD_INPUT
    assert capsys.readouterr().err == (
        "h2nav: zzzzzz: no such command; `h2nav --help` lists them all\n"
    )


def test_names_keep_their_capitals(capsys):
    assert "A SITL-style autopilot for tests." in said(capsys, "fake-autopilot", "--help")
    assert "C99." in said(capsys, "export", "c", "--help")


def test_version_names_the_backend(capsys, monkeypatch):
    monkeypatch.setenv("H2NAV_NATIVE", "forbid")
    assert f"h2nav {__version__} (python kernels" in said(capsys, "--version")


@pytest.mark.parametrize(
    ("words", "usage"),
    [
        ([], "h2nav [-h] [--version] COMMAND ..."),
        (["log"], "h2nav log [-h] COMMAND ..."),
        (["run", "--unheard-of"], "h2nav run [-h]"),
        (["log", "info", "a", "--unheard-of"], "h2nav log info [-h]"),
        (["--unheard-of", "run"], "h2nav [-h]"),
    ],
)
def test_wrong_words_end_with_2_and_the_usage_of_their_command(words, usage, capsys):
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2
    assert capsys.readouterr().err.startswith(f"usage: {usage}")


def test_bad_input_is_one_line_and_2(tmp_path, capsys):
    assert main(["check-config", str(tmp_path / "none.yaml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


READS = (
    "replay", "calibrate", "review", "compare", "odometer", "fleet", "log info", "log recover",
    "log export", "log anonymise", "log decode", "synthesize", "evaluate dataset",
    "evaluate flights", "odometry calibrate",
)  # fmt: skip


@pytest.mark.parametrize("name", READS)
def test_a_file_that_is_not_there_is_named_in_a_line_and_no_file_is_written(
    name, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    words = COMMANDS[tuple(name.split())].example.split()
    assert main(words) == BAD_INPUT
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert any(f"{word}: " in line for word in words)
    assert said.out == ""
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


@pytest.mark.parametrize("words", [["setup", "--connect", "nonsense:1"], ["run", "--connect", "x"]])
def test_a_link_that_is_none_is_named(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == BAD_INPUT
    said = capsys.readouterr().err
    assert words[-1] in said
    assert said.count("\n") == 1


def test_shipped_configurations_can_be_printed_and_are_fine(tmp_path, capsys):
    for name in ("ardupilot-serial", "ardupilot-udp", "px4-serial", "px4-udp", "sitl"):
        assert main(["check-config", "--example", name]) == 0
        path = tmp_path / f"{name}.yaml"
        path.write_text(capsys.readouterr().out)
        assert main(["check-config", str(path)]) == 0
        assert capsys.readouterr().out == f"{path}: fine\n"


@pytest.mark.parametrize(("chosen", "used"), [(None, "1"), ("3", "3")])
def test_linear_algebra_takes_one_thread_unless_told_otherwise(chosen, used, monkeypatch, capsys):
    for name in THREADS:
        monkeypatch.setenv(name, chosen or "")
        if chosen is None:
            monkeypatch.delenv(name)
    assert main(["check-config", "--example", "sitl"]) == 0
    assert [os.environ[name] for name in THREADS] == [used, used]


def test_a_reader_that_has_gone_is_no_traceback(tmp_path):
    """As in `h2nav check-config --example sitl | head -0`."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [*H2NAV, "check-config", "--example", "sitl"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, check=False)
    os.close(writer)
    assert done.stderr == b""
    assert done.returncode == 141


def test_the_daemon_flies_on_without_readers():
    """Both its outputs are pipes that nobody reads any more; TERM still ends it with 0."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot:
        autopilot.bind(("127.0.0.1", 0))
        autopilot.settimeout(WAIT_S)
        with daemon("--connect", f"udpout:127.0.0.1:{autopilot.getsockname()[1]}") as running:
            running.wait_for(lambda event: event["event"] == "status")
            running.process.stdout.close()
            running.process.stderr.close()
            running.process.stdout = running.process.stderr = None
            for _ in range(4):  # heartbeats, one a second like the events that cannot be written
                autopilot.recv(512)
            assert running.stop() == 0


def test_ctrl_c_is_one_line_and_130(monkeypatch, capsys):
    """Python turns SIGINT into KeyboardInterrupt where a command does not handle it."""

    def interrupted(_args):
        raise KeyboardInterrupt

    monkeypatch.setattr(importlib.import_module("h2nav.apps.check_config"), "run", interrupted)
    assert main(["check-config", "x"]) == 130
    assert capsys.readouterr().err == "h2nav: interrupted\n"


def test_a_check_before_arming_that_is_interrupted_gives_no_verdict(monkeypatch, capsys):
    monkeypatch.setattr(Session, "run", lambda _, stop, seconds: stop.stop())
    assert main(["check", "--connect", "udpin:127.0.0.1:0"]) == 130
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "h2nav: interrupted\n")


@pytest.mark.parametrize("name", ["stdin", "stdout", "stderr"])
def test_a_stream_that_is_closed_is_as_good_as_empty(name, monkeypatch):
    monkeypatch.setattr(sys, name, None)
    assert main(["check-config", "--example", "sitl"]) == 0
    with getattr(sys, name) as opened:
        assert opened.name == os.devnull


def test_a_full_disk_under_the_errors_changes_no_exit_status(monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stderr", full)
        assert main(["zzzzzz"]) == BAD_INPUT


@pytest.mark.parametrize(
    ("typed", "reason"), [(b"\xff\n", "is no text"), (b"\n", "is empty"), (b"", "is empty")]
)
@pytest.mark.parametrize("errors", ["strict", "surrogateescape"])
def test_a_passphrase_that_is_none_writes_no_key(
    typed, reason, errors, tmp_path, monkeypatch, capsys
):
    stream = io.TextIOWrapper(io.BytesIO(typed), encoding="utf-8", errors=errors)
    monkeypatch.setattr(sys, "stdin", stream)
    assert main(["signing-key", "-o", str(tmp_path / "key")]) == BAD_INPUT
    said = f"h2nav: signing-key: the passphrase {reason}; nothing was written\n"
    assert capsys.readouterr().err == said
    assert list(tmp_path.iterdir()) == []


def test_the_end_of_the_input_at_a_question_is_as_ctrl_c(tmp_path, monkeypatch, capsys):
    def ends(_question):
        raise EOFError

    monkeypatch.setattr("getpass.getpass", ends)
    monkeypatch.setattr("builtins.input", ends)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    assert main(["signing-key", "-o", str(tmp_path / "key")]) == 130
    with pytest.raises(KeyboardInterrupt):
        setup._agrees("start the service?")
    assert capsys.readouterr().err == "h2nav: interrupted\n"
