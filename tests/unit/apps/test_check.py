"""`h2nav check`: when it says that nothing is wrong, and with which status it ends."""

import json
from types import SimpleNamespace

import pytest
from one_command import main

from h2nav.apps import check
from h2nav.apps.check import verdict_of
from h2nav.cli import BAD_INPUT, FAILED, INTERRUPTED, SUCCESS
from h2nav.integrity.preflight import NOT_READ, GroundFault, GroundVerdict, Item

TILTED = GroundFault(Item.TILT, "autopilot", 12.34, "deg", 5.0)
UNREAD = GroundFault(Item.COMPASS, "compass 1", 0.0, NOT_READ, 0.0)
GROUND = frozenset({Item.GYRO, Item.TILT})


def service(faults=(), judged=GROUND, reasons=(), vehicle="1/1", is_armed=False):
    return SimpleNamespace(
        before_arming=GroundVerdict(faults, judged),
        reasons_not_to_arm=reasons,
        bound_to=vehicle,
        health=SimpleNamespace(armed=is_armed),
    )


WRONG = service((TILTED,), reasons=(TILTED.text, "autopilot: no GPS"))


class FakeSession:
    """A daemon that has heard what the test says."""

    heard = service()
    is_stopped = False

    def __init__(self, configuration, console):
        FakeSession.configuration, self.service = configuration, self.heard

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def run(self, stop, seconds):
        FakeSession.seconds = seconds
        if self.is_stopped:
            stop.stop()


@pytest.fixture
def session(monkeypatch):
    class Own(FakeSession):
        pass

    monkeypatch.setattr(check, "Session", Own)
    return Own


def run(*words):
    return main(["check", "--connect", "udpin:127.0.0.1:0", *words])


@pytest.mark.parametrize(
    ("heard", "ok"),
    [
        (service(), True),
        (service(judged=frozenset()), False),
        (service(reasons=("x",)), False),
        (WRONG, False),
    ],
)
def test_it_is_well_only_where_something_was_judged_and_nothing_speaks_against_arming(
    session, heard, ok
):
    assert verdict_of(heard)["ok"] is ok
    session.heard = heard
    assert run() == (SUCCESS if ok else FAILED)


def test_the_document_has_every_check_in_one_of_two_lists(session, capsys):
    session.heard = WRONG
    assert run("--json") == FAILED
    found = json.loads(capsys.readouterr().out)
    assert found["judged"] == ["gyro", "tilt"]
    assert found["not_judged"] == [item.value for item in Item if item not in GROUND]
    assert found["reasons"] == [TILTED.text, "autopilot: no GPS"]
    assert (found["vehicle"], found["armed"]) == ("1/1", False)
    assert found["faults"] == [
        {"item": "tilt", "sensor": "autopilot", "size": 12.34, "unit": "deg", "limit": 5.0,
         "text": TILTED.text},
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        (service(), ["nothing wrong with: gyro, tilt"]),
        (WRONG, [f"wrong: {TILTED.text} (at most 5)", "wrong: autopilot: no GPS"]),
        # What has no size has no limit.
        (service((UNREAD,), reasons=(UNREAD.text,)), ["wrong: compass 1 is no longer read"]),
        (service(judged=frozenset(), vehicle=""), ["no autopilot was detected"]),
        (
            service(judged=frozenset(), is_armed=True),
            ["the vehicle is armed: no check was made"],
        ),
        (
            service(judged=frozenset()),
            [
                "no check was possible: the vehicle has to stand still and send its IMU's messages",
            ],
        ),
    ],
)
def test_people_are_told_what_is_wrong_and_what_was_not_judged(session, capsys, heard, said):
    session.heard = heard
    run()
    left = [item.value for item in Item if item not in heard.before_arming.judged]
    assert capsys.readouterr().out.splitlines() == [*said, f"not judged: {', '.join(left)}"]


def test_where_everything_was_judged_nothing_is_listed_as_left(session, capsys):
    session.heard = service(judged=frozenset(Item))
    assert run() == SUCCESS
    assert "not judged" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("seconds", "status"),
    [("1", SUCCESS), ("3600", SUCCESS), ("0.99", BAD_INPUT), ("3600.1", BAD_INPUT),
     ("nan", BAD_INPUT)],
)  # fmt: skip
def test_it_listens_from_a_second_to_an_hour(session, capsys, seconds, status):
    assert run("--seconds", seconds) == status
    said = "h2nav: --seconds: expected a number from 1 to 3600\n"
    assert capsys.readouterr().err == (said if status else "")
    if status == SUCCESS:
        assert FakeSession.seconds == float(seconds)


def test_who_ends_it_early_gets_no_verdict(session, capsys):
    session.is_stopped = True
    assert run() == INTERRUPTED
    assert capsys.readouterr().out == ""


def test_it_sends_no_outputs_and_writes_no_log(session):
    assert run() == SUCCESS
    chosen = FakeSession.configuration
    assert chosen.link.url == "udpin:127.0.0.1:0"
    assert chosen.log.folder == ""
    sent = chosen.output
    assert sent.attitude_rate_hz == sent.attitude_quaternion_rate_hz == 0.0
    assert sent.estimator_status_rate_hz == 0.0
    assert sent.status_text is False
