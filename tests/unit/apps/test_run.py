"""`h2nav run`: what the command line changes of the configuration."""

import json
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from h2nav.apps import run
from h2nav.cli import BAD_INPUT, SUCCESS, main

URL = "udpin:127.0.0.1:14550"


class Daemon:
    """Takes the place of the session; what it was made of."""

    def __init__(self, configuration, console, own_socket=None):
        self.configuration, self.console, self.own_socket = configuration, console, own_socket
        self.steps = []

    def __enter__(self):
        self.steps.append("entered")
        return self

    def __exit__(self, *_):
        self.steps.append("left")

    def run(self, stop):
        self.steps.append(stop)


@pytest.fixture
def started(monkeypatch):
    """The daemons that were run."""
    made = []

    def session(*args, **kwargs):
        made.append(Daemon(*args, **kwargs))
        return made[-1]

    signals = SimpleNamespace(installed=lambda: nullcontext("stop"))
    monkeypatch.setattr(run, "Session", session)
    monkeypatch.setattr(run, "StopSignals", lambda: signals)
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    return made


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(f"link: {{url: '{URL}'}}\nlog: {{folder: /logs}}\n")
    return path


def chosen(started, *words):
    assert main(["run", *map(str, words)]) == SUCCESS
    return started[-1].configuration


def test_it_runs_until_it_is_stopped(started, config):
    chosen(started, "-c", config)
    assert started[0].steps == ["entered", "stop", "left"]
    assert len(started) == 1


def test_the_file_counts_where_nothing_else_is_said(started, config):
    found = chosen(started, "-c", config)
    assert (found.link.url, found.log.folder) == (URL, "/logs")
    assert (found.live.address, found.events.socket) == ("", "")


def test_the_command_line_overrides_the_file(started, config, tmp_path):
    other = "tcp:127.0.0.1:5760"
    found = chosen(
        started, "-c", config, "--connect", other, "--log-dir", tmp_path, "--live", "127.0.0.1:99"
    )
    assert (found.link.url, found.log.folder) == (other, str(tmp_path))
    assert found.live.address == "127.0.0.1:99"


def test_without_a_file_the_rest_is_as_usual(started):
    found = chosen(started, "--connect", URL)
    assert (found.link.url, found.log.folder) == (URL, "")


def test_a_folder_at_home_is_written_out(started, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert chosen(started, "--connect", URL, "--log-dir", "~/logs").log.folder == f"{tmp_path}/logs"


def test_a_live_view_has_a_usual_address(started):
    assert chosen(started, "--connect", URL, "--live").live.address == "127.0.0.1:8080"


def test_events_go_to_the_folder_of_the_service_unless_the_file_names_a_socket(
    started, config, monkeypatch
):
    monkeypatch.setenv("RUNTIME_DIRECTORY", "/run/h2nav")
    assert chosen(started, "-c", config).events.socket == "/run/h2nav/events"
    with config.open("a") as file:
        file.write("events: {socket: /run/other}\n")
    assert chosen(started, "-c", config).events.socket == "/run/other"


@pytest.mark.parametrize(("words", "is_json"), [((), False), (("--json",), True)])
def test_events_are_printed_on_request(started, capsys, words, is_json):
    chosen(started, "--connect", URL, *words)
    started[0].console.started(1, {"version": "1.2"})
    printed = [json.loads(line)["event"] for line in capsys.readouterr().out.splitlines()]
    assert printed == (["started"] if is_json else [])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "run: give -c CONFIG.yaml or --connect URL; --help shows both"),
        (("--log-dir", "logs"), "run: give -c CONFIG.yaml or --connect URL; --help shows both"),
        (("--connect", "udpin"), "'udpin'"),
        (("--connect", URL, "--live", "8080"), "live.address: '8080' is not HOST:PORT"),
    ],
)
def test_what_cannot_be_run_is_told_before_anything_is_opened(started, capsys, words, said):
    assert main(["run", *words]) == BAD_INPUT
    assert said in capsys.readouterr().err
    assert started == []


def test_the_schema_of_the_events_is_printed_instead(started, capsys):
    assert main(["run", "--schema"]) == SUCCESS
    assert json.loads(capsys.readouterr().out)["$schema"].startswith("https://json-schema.org")
    assert started == []
