"""What the autopilot said: severities, and texts that come in pieces."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage

from h2nav.integrity.findings import Severity
from h2nav.recordings.text_tables import said_of

NAN = math.nan


def said(kind, message, texts, **columns):
    name = "Message" if message == "MSG" else "text"
    made = {name: np.array([text.encode() for text in texts], "S60"), **columns}
    return said_of(MadeLog(kind, MadeMessage(message, made)))


@pytest.mark.parametrize(
    ("level", "severity"),
    [(0, 2), (1, 2), (2, 2), (3, 3), (4, 4), (5, 5), (6, 6), (7, 6), (255, 6)],
)
def test_a_severity_is_one_of_syslogs_between_critical_and_information(level, severity):
    for kind, message, column in (
        ("ulog", "logged_messages", "level"),
        ("telemetry", "STATUSTEXT", "severity"),
    ):
        more = {} if kind == "ulog" else {"id": 0, "chunk_seq": 0}
        (found,) = said(kind, message, ["x"], **{column: level}, **more)
        assert (found.text, found.severity) == ("x", Severity(severity))
    (found,) = said("dataflash", "MSG", ["x"])
    assert found.severity is Severity.INFO


@pytest.mark.parametrize(
    ("pieces", "whole"),
    [
        ([(0, 0, "a"), (0, 1, "b")], ["a", "b"]),  # without a number each is whole
        ([(7, 0, "a"), (7, 1, "b"), (7, 2, "c")], ["abc"]),
        ([(7, 0, "a"), (8, 0, "b"), (8, 1, "c")], ["a", "bc"]),
        ([(7, 0, "a"), (7, 0, "b")], ["a", "b"]),  # the number came round
        ([(7, 0, "a"), (0, 0, "b"), (7, 1, "c")], ["a", "b", "c"]),
        ([(7, 1, "b"), (7, 2, "c")], ["bc"]),  # the first piece was lost
        ([(7, 0, ""), (7, 1, "")], []),
    ],
)
def test_a_text_in_pieces_is_one(pieces, whole):
    numbers, places, texts = zip(*pieces, strict=True)
    levels = [4, *[6] * (len(texts) - 1)]
    found = said("telemetry", "STATUSTEXT", texts, id=numbers, chunk_seq=places, severity=levels)
    assert [one.text for one in found] == whole
    if whole:
        # The severity and the time are those of its first piece.
        assert (found[0].severity, found[0].t_s) == (Severity.WARNING, 0.0)


def test_a_piece_may_end_within_a_character():
    halves = np.array(["\u00e4".encode()[:1], "\u00e4".encode()[1:]], "S60")
    columns = {"text": halves, "severity": 6, "id": 3, "chunk_seq": [0, 1]}
    (found,) = said_of(MadeLog("telemetry", MadeMessage("STATUSTEXT", columns)))
    assert found.text == "\u00e4"
    columns["id"] = 0
    found = said_of(MadeLog("telemetry", MadeMessage("STATUSTEXT", columns)))
    assert [one.text for one in found] == ["\ufffd"] * 2
