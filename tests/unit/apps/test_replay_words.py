"""What a replay tells: of its log, of the estimates of before, of what went through."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.apps import replay
from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.severity import Severity
from h2nav.maths import quaternion
from h2nav.recordings.reference import TimedEstimates
from h2nav.recordings.smoothed import smoothed_record
from h2nav.service.records import estimate_record

LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
RESULT = {
    "imu_samples": 1200, "imu_message": "RAW_IMU", "duration_s": 12.04, "x_realtime": 151.6,
    "reference": "ATTITUDE", "compared": 5,
    "rms_deg": {"total": 0.5, "tilt": 0.1234}, "rejected": {"late": 0, "bad_crc": 3},
    "states": {"active": 10.04, "no_link": 2.0},
    "findings": [], "log": "out.mcap",
}  # fmt: skip
USUAL = [
    "1200 samples of RAW_IMU in 12.0 s of recording, 152 x real time",
    "RMS error against ATTITUDE in deg:  total 0.500  tilt 0.123",
    "refused: {'bad_crc': 3}",
    "states: active 10.0 s  no_link 2.0 s",
    "log: out.mcap",
]


def estimate(t_us, angle=0.0):
    q_nb = quaternion.turned(LEVEL, (angle, 0.0, 0.0))
    return AttitudeEstimate(t_us, q_nb, ZERO, ZERO, ZERO, 0.01, next(iter(Trust)))


def recorded(at_us, angle=0.0, **changes):
    """As a log has it: without NaN."""
    fields = estimate_record(estimate(at_us, angle), 0)._asdict()
    known = {n: None if isinstance(v, float) and math.isnan(v) else v for n, v in fields.items()}
    return (0, {**known, **changes})


def watching(*records):
    """A watcher of a log with these estimates."""
    original = SimpleNamespace(
        records=lambda topic: iter(records if topic == "/estimate" else ()),
        metadata={"h2nav": {"version": "1.2"}},
    )
    return replay._Watcher(original)


@pytest.mark.parametrize(
    ("changes", "line", "said"),
    [
        ({}, 0, USUAL[0]),
        (
            {"imu_message": ""},
            0,
            "1200 samples of no IMU message in 12.0 s of recording, 152 x real",
        ),
        (
            {"reference": None},
            1,
            "the recording holds neither SIMSTATE nor ATTITUDE to compare with",
        ),
        ({"rejected": {"late": 0}}, 2, "refused: nothing"),
    ],
)
def test_what_went_through_is_told(capsys, changes, line, said):
    replay._show({**RESULT, **changes})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(USUAL)
    assert lines[line].startswith(said)
    assert lines[:line] + lines[line + 1 :] == USUAL[:line] + USUAL[line + 1 :]


def test_smoothed_errors_findings_and_comparison_are_told_where_there_are_some(capsys):
    finding = {"from_s": 1.04, "to_s": 2.0, "source": "IMU 1", "text": "stuck", "evidence": "still"}
    more = {
        "rms_deg_smoothed": {"total": 0.25}, "findings": [finding], "log": None,
        "estimates_compared": 7, "estimates_equal": 7,
    }  # fmt: skip
    replay._show({**RESULT, **more})
    assert capsys.readouterr().out.splitlines() == [
        *USUAL[:2],
        "smoothed against ATTITUDE in deg:  total 0.250",
        *USUAL[2:4],
        "1.0 to 2.0 s: IMU 1: stuck (still)",
        "estimates equal: 7 of 7",
    ]


@pytest.mark.parametrize(
    ("equal", "version", "said"),
    [
        (5, "1.2", "estimates equal: 5 of 5"),
        (4, "1.2", "1 of 5 estimates differ by up to 0.012 deg (recorded by version 1.2)"),
        (0, "", "5 of 5 estimates differ by up to 0.012 deg (recorded by version unknown)"),
    ],
)
def test_what_differs_is_counted_with_the_version_that_recorded_it(equal, version, said):
    result = {
        "estimates_compared": 5, "estimates_equal": equal, "estimates_apart_deg": 0.01234,
        "recorded_by": version,
    }  # fmt: skip
    assert replay._compared(result) == said


@pytest.mark.parametrize(
    ("dropped", "trouble", "said"),
    [
        (0, None, None),
        (3, None, "3 of 10 messages are lost (they could not be encoded)"),
        (3, "disk full", "3 of 10 messages are lost (disk full)"),
        (0, "disk full", "0 of 7 messages are lost (disk full)"),
    ],
)
def test_a_log_that_lacks_something_is_told_with_the_remedy(dropped, trouble, said):
    recorder = SimpleNamespace(
        dropped=dropped, trouble=trouble, statistics=lambda: SimpleNamespace(written=7)
    )
    told = said and f"the log is incomplete: {said}; name another place with -o, or use --no-log"
    assert replay._loss(recorder) == told


def test_a_log_is_named_after_the_recording_and_writes_over_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = []
    for _ in range(3):
        names.append(str(replay._free_name(tmp_path / "else" / "flight.tlog")))
        (tmp_path / names[-1]).touch()
    assert names == ["flight.replay.mcap", "flight.replay-2.mcap", "flight.replay-3.mcap"]


@pytest.mark.parametrize(
    ("changes", "is_equal"),
    [
        ({}, True),
        ({"late_ms": 99.0}, True),
        ({"roll_deg": 1e-300}, False),
        ({"t_us": 6}, False),
        ({"sigma_tilt_deg": None}, False),
        ({"roll_deg": None}, False),
    ],
)
def test_an_estimate_is_equal_by_every_bit_but_its_lateness(changes, is_equal):
    record = estimate_record(estimate(5), 0)
    assert replay._is_equal(recorded(5, **changes)[1], record) is is_equal


def test_what_is_no_number_is_null_in_a_log_and_a_field_that_is_missing_is_not_compared():
    record = estimate_record(estimate(5), 0)._replace(sigma_tilt_deg=math.nan)
    same = recorded(5, sigma_tilt_deg=None)[1]
    assert replay._is_equal(same, record)
    assert not replay._is_equal({**same, "sigma_tilt_deg": 0.5}, record)
    del same["sigma_tilt_deg"]
    assert replay._is_equal(same, record)


def test_estimates_are_compared_by_their_times():
    """One is missing here, one there; two differ, by 0.1 and 0.2 rad."""
    watcher = watching(*(recorded(t_us) for t_us in (1, 2, 4, 5, 6)))
    for t_us, angle in ((1, 0.0), (3, 0.0), (4, 0.2), (5, 0.1), (6, 0.0), (7, 0.0)):
        watcher.estimate(1000 * t_us, estimate(t_us, angle), 0)
    assert (watcher.compared, watcher.equal) == (4, 2)
    assert watcher.apart_rad == pytest.approx(0.2, abs=1e-9)
    assert (watcher.compares, watcher.recorded_by) == (True, "1.2")


def test_without_a_log_of_before_nothing_is_compared():
    watcher = replay._Watcher(None)
    watcher.estimate(1000, estimate(1), 0)
    assert (watcher.compares, watcher.recorded_by, watcher.compared) == (False, "", 0)


def test_smoothed_estimates_are_kept_and_logged_at_their_arrivals(monkeypatch):
    found, logged = [estimate(7), estimate(8, 0.1)], []
    batches = [(np.array([1000 + n]), SimpleNamespace(estimates=lambda e=e: [e]))
               for n, e in enumerate(found)]  # fmt: skip
    asked = []

    def smoothed(*words):
        asked.append(words)
        return batches

    monkeypatch.setattr(replay, "smoothed", smoothed)
    monkeypatch.setattr(TimedEstimates, "add", lambda self, *added: logged.append(added))
    recorder = SimpleNamespace(record=lambda *record: logged.append(record))
    filters = SimpleNamespace(filter_for="maker")
    for kept in recorder, None:
        logged.clear()
        replay._smooth("listener", filters, kept, 5)
        records = [(1_000_000 + 1000 * n, each) for n, each in enumerate(found)]
        assert [each for each in logged if len(each) == 2] == records
        channel = [("/smoothed", smoothed_record(each), t_ns + 5) for t_ns, each in records]
        written = [each for each in logged if len(each) == 3]
        assert repr(written) == repr([] if kept is None else channel)  # some are NaN
    assert asked == [("listener", "maker")] * 2


def test_messages_of_an_imported_log_are_references():
    watcher, seen = watching(), []
    watcher.reference = SimpleNamespace(message=seen.append)
    watcher.message(1, "attitude")
    assert seen == ["attitude"]


def test_notices_go_to_the_user(capsys):
    watching().notice(0, Severity.WARNING, "the compass is lost")
    assert capsys.readouterr().err == "warning: the compass is lost\n"


def test_the_result_has_the_figures_of_the_pass():
    table = SimpleNamespace(reference="", compared=0, as_mapping=dict)
    watcher = watching(recorded(1))
    watcher.estimate(1000, estimate(1, math.radians(0.5)), 0)
    watcher.reference = SimpleNamespace(table=lambda: table, honesty=lambda: "honest")
    service = SimpleNamespace(
        health=SimpleNamespace(samples_used=9, imu_message="RAW_IMU"),
        rejected={"late": 2},
        state_s={"active": 1.23456},
        findings=(),
    )
    counters = SimpleNamespace(bad_crc=1, unknown_id=2, skipped_bytes=3)
    played = SimpleNamespace(span_ns=12_345_678_901, counters=counters)
    result = replay._result(SimpleNamespace(service=service), played, watcher, 2.0)
    assert result.pop("estimates_apart_deg") == pytest.approx(0.5, abs=1e-9)
    assert json.loads(json.dumps(result)) == {
        "imu_samples": 9, "imu_message": "RAW_IMU", "duration_s": 12.346, "x_realtime": 6.2,
        "reference": None, "compared": 0, "rms_deg": {},
        "rejected": {"late": 2, "bad_crc": 1, "unknown_id": 2, "skipped_bytes": 3},
        "states": {"active": 1.235}, "honesty": "honest", "findings": [],
        "estimates_compared": 1, "estimates_equal": 0, "recorded_by": "1.2",
    }  # fmt: skip
    assert "estimates_equal" not in replay._result(
        SimpleNamespace(service=service),
        played,
        SimpleNamespace(compares=False, reference=watcher.reference),
        2.0,
    )
