"""What a flight is called in the list and at the ground station."""

from h2nav.flights.summary import sentence_of, summary_of
from h2nav.integrity.severity import Severity


def document(why=None, findings=()):
    return {
        "findings": list(findings), "spans": {"armed": []}, "start_utc": None, "vehicle": "",
        "airframe": {"id": None, "uid": None}, "autopilot": "", "firmware": "", "kind": "tlog",
        "duration_s": 0.0, "flown": {"distance_m": 0.0}, "receivers": [],
        "headline": "Nothing was found wrong in what could be looked at.", "why_no_estimate": why,
    }  # fmt: skip


def test_a_recording_that_shows_nothing_is_not_called_sound():
    found = summary_of(document("the recording holds no IMU samples"))
    assert (found["worst"], found["distance_m"]) == ("notice", None)
    said = "flight not judged: the recording holds no IMU samples"
    assert sentence_of(found) == (Severity.NOTICE, said)


def test_sound_and_not_sound():
    assert sentence_of(summary_of(document())) == (Severity.INFO, "flight sound")
    finding = {"severity": "error", "kind": "crash", "text": "crashed"}
    severity, text = sentence_of(summary_of(document("no IMU", [finding])))
    assert severity is Severity.ERROR
    assert text.startswith("flight: ")
