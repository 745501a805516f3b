"""What the daemon keeps beside the estimates."""

import dataclasses
import io
import json
import socket
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from h2nav import __version__
from h2nav.apps import session
from h2nav.apps.configuration import Configuration, build
from h2nav.apps.console import Console
from h2nav.apps.log_contents import open_recorder
from h2nav.apps.log_fetcher import LogFetcher
from h2nav.apps.session import Session, _flight_keeper
from h2nav.errors import BadInput

LINK = {"link": {"url": "udpin:127.0.0.1:0"}}
MS = 1_000_000


class Noted:
    """A part of a session: notes every call in the list of all."""

    def __init__(self, name: str, calls: list[tuple[Any, ...]], **fields: Any) -> None:
        self._name, self._calls = name, calls
        self.__dict__.update(fields)

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *args: self._calls.append((self._name, name, *args))


@pytest.mark.parametrize("has_log", [True, False])
@pytest.mark.parametrize(("review", "fetch_log"), [(True, False), (False, True), (False, False)])
def test_flights_are_kept_where_there_is_a_log_and_they_are_reviewed_or_fetched(
    tmp_path: Path, has_log: bool, review: bool, fetch_log: bool
) -> None:
    usual = Configuration()
    configuration = dataclasses.replace(
        usual,
        log=dataclasses.replace(usual.log, folder=str(tmp_path) if has_log else ""),
        flights=dataclasses.replace(usual.flights, review=review, fetch_log=fetch_log),
    )
    recorder = open_recorder(configuration.log, 0)
    try:
        keeper = _flight_keeper(configuration, recorder, Console(stream=io.StringIO()), None)
    finally:
        if recorder is not None:
            recorder.close(10.0)
    assert (keeper is not None) == (has_log and (review or fetch_log))


def opened(sections: dict[str, Any], **options: Any) -> Session:
    return Session(build({**LINK, **sections}, "test"), Console(stream=io.StringIO()), **options)


@pytest.mark.parametrize(
    ("sections", "backend", "said"),
    [
        ({}, "native", "filter default, native kernels, no log"),
        (
            {"log": {"folder": "/logs"}},
            "python",
            "filter default, python kernels (no compiler at installation: slower), log in /logs",
        ),
        (
            {"filter": {"arithmetic": "fixed"}},
            "native",
            "filter default in fixed arithmetic (without hard iron learnt in flight, without "
            "repair of clipped rates), native kernels, no log",
        ),
        (
            {"filter": {"name": "constant_gain", "arithmetic": "fixed"}},
            "native",
            "filter constant_gain in fixed arithmetic, native kernels, no log",
        ),
    ],
)
def test_a_run_begins_with_what_it_is(
    monkeypatch: pytest.MonkeyPatch, sections: dict[str, Any], backend: str, said: str
) -> None:
    monkeypatch.setattr(session, "backend", lambda: backend)
    greeting = session._greeting(build({**LINK, **sections}, "test"))
    assert greeting == f"h2nav {__version__} on udpin:127.0.0.1:0, {said}"


def test_a_run_of_a_moment_says_hello_and_good_bye(capsys: pytest.CaptureFixture[str]) -> None:
    """With no time left not a single turn is made."""
    people = io.StringIO()
    console = Console(events_as_json=True, stream=people)
    with Session(build(LINK, "test"), console) as run:
        run.open()
        assert run.page_url == ""
        assert run.recorder is None
        run.run(SimpleNamespace(stopped=False), seconds=0.0)
    first, last = people.getvalue().splitlines()
    assert f"h2nav {__version__} on udpin:127.0.0.1:0" in first
    assert last.endswith("0 samples used, 0 refused, 0 attitudes sent; no log")
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [event["event"] for event in events] == ["notice", "started", "stopped"]
    assert {name: events[1][name] for name in ("version", "link", "log")} == {
        "version": __version__, "link": "udpin:127.0.0.1:0", "log": "",
    }  # fmt: skip


def test_the_link_is_closed_first_and_the_events_last() -> None:
    """So that what the others say in the end is still written and told."""
    run, calls = opened({}), []
    run.link.close()
    health = run.service.health
    for name, fields in {
        "link": {}, "_keeper": {}, "_live": {}, "_signing": {},
        "recorder": {"path": Path("a.mcap")},
        "_pipeline": {}, "_console": {}, "_events": {}, "service": {"health": health},
    }.items():  # fmt: skip
        setattr(run, name, Noted(name, calls, **fields))
    run.__exit__(None, None, None)
    assert [call[:2] for call in calls] == [
        ("link", "close"),
        ("_keeper", "close"),
        ("_live", "close"),
        ("_signing", "close"),
        ("recorder", "close"),
        ("_pipeline", "report_recorder"),
        ("_console", "closing"),
        ("_events", "close"),
    ]
    assert calls[4][2:] == (1.5,)
    assert calls[6][3:] == (health, Path("a.mcap"))


def test_new_clients_of_the_events_are_let_in_ten_times_a_second(tmp_path: Path) -> None:
    path = tmp_path / "events"
    with opened({"events": {"socket": str(path)}}) as run:
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))
            assert run._let_in(100 * MS, 0, run.service) == []
            with client.makefile() as lines:
                assert json.loads(lines.readline())["event"] == "started"
                assert json.loads(lines.readline())["state"] == "no_link"
        calls: list[tuple[Any, ...]] = []
        events, run._events = run._events, Noted("events", calls)
        for t_ns in (199 * MS, 200 * MS, 299 * MS, 300 * MS):
            run._let_in(t_ns, 0, run.service)
        assert len(calls) == 2
        run._events = events
    assert not path.exists()


def test_the_record_of_flights_is_shown_each_second() -> None:
    calls: list[tuple[Any, ...]] = []
    with opened({}) as run:
        run._keeper = SimpleNamespace(
            tend=lambda *args: [args], record="counts", close=lambda: None
        )
        run._live = SimpleNamespace(feed=Noted("feed", calls), close=lambda: None)
        for t_ms in (1000, 1999, 2000):
            assert run._keep_flights(t_ms * MS, 7, run.service) == [(t_ms * MS, 7, run.service)]
        assert calls == [("feed", "record", session.FLIGHTS_TOPIC, "counts", 7)] * 2
        run._live = None
        run._keep_flights(3000 * MS, 7, run.service)


def test_a_socket_of_its_own_is_only_a_convenience(tmp_path: Path) -> None:
    own = tmp_path / "h2nav" / "events"
    with opened({}, own_socket=own):
        assert own.is_socket()
        assert own.parent.stat().st_mode & 0o777 == 0o700
        with opened({}, own_socket=own) as second:  # another daemon has it
            assert second._events is None
    with opened({}, own_socket=tmp_path / "no" / "h2nav" / "events") as run:
        assert run._events is None


def test_a_socket_that_is_named_has_to_be_there(tmp_path: Path) -> None:
    named, own = tmp_path / "named", tmp_path / "own" / "events"
    with opened({"events": {"socket": str(named)}}, own_socket=own):
        assert named.is_socket()
        assert not own.parent.exists()
    with pytest.raises(BadInput):
        opened({"events": {"socket": str(tmp_path / "no" / "events")}})


@pytest.mark.parametrize(
    ("fetch_log", "folder", "fetches"),
    [(True, True, True), (True, False, False), (False, True, False)],
)
def test_logs_are_fetched_into_the_folder_of_the_log(
    tmp_path: Path, fetch_log: bool, folder: bool, fetches: bool
) -> None:
    usual = build(LINK, "test")
    configuration = dataclasses.replace(
        usual,
        log=dataclasses.replace(usual.log, folder=str(tmp_path) if folder else ""),
        flights=dataclasses.replace(usual.flights, fetch_log=fetch_log),
    )
    console = Console(stream=io.StringIO())
    found = session._log_fetcher(configuration, console)
    assert isinstance(found, LogFetcher) is fetches


def test_what_is_shown_of_the_log_is_the_recorders() -> None:
    with opened({}) as run:
        assert run._sight(5).log is None
        run.recorder = SimpleNamespace(path=Path("a.mcap"), trouble="full", statistics=lambda: 7)
        sight = run._sight(5)
        run.recorder = None
    assert sight.log == (Path("a.mcap"), "full", 7)
    assert sight.health.state == sight.status.state == "no_link"
