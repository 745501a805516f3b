"""tools/real_flights.py: made recordings with known events are reviewed, and scored by rules."""

import csv
import json
import sys

import needs
import numpy as np
import pytest
from made_logs import DataflashWriter, dataflash, made_flight

FIELDS = ("file", "event", "t_s", "about")
LABELS = ("file", "kind", "source", "severity", "from_s", "to_s", "verdict", "reason")
CRASH_S = 30.0


@pytest.fixture(scope="module")
def tool():
    return needs.tool("real_flights")


def crashed():
    """A flight that turns over in half a second and lies on its back."""
    flown = made_flight(imus=1)
    (imu,) = flown.imus
    since_s = (imu.t_us - imu.t_us[0]) * 1e-6
    w_b, f_b = imu.w_b.copy(), imu.f_b.copy()
    turning, lies = np.abs(since_s - CRASH_S + 0.25) < 0.25, since_s > CRASH_S
    w_b[turning, 0] += 2.0 * np.pi
    w_b[lies], f_b[lies] = 0.0, np.array([0.0, 0.0, 9.8])
    f_b[np.flatnonzero(lies)[:6]] = np.array([0.0, 20.0, -80.0])
    return flown._replace(imus=(imu._replace(w_b=w_b, f_b=f_b),))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights")
    (folder / "sound.bin").write_bytes(dataflash(made_flight(imus=1)))
    biased = made_flight("rest", duration_s=30.0, imus=1, bias_deg_s=12.0)
    (folder / "biased.bin").write_bytes(dataflash(biased))
    driven = DataflashWriter()
    times = crashed().t_us[::10]
    driven.add("CTUN", "Qf", "TimeUS,ThO", times, 0.4)
    (folder / "crashed.bin").write_bytes(dataflash(crashed(), extra=driven))
    write(
        folder / "events.csv",
        FIELDS,
        ("sound.bin", "no_crash", "", ""),
        ("biased.bin", "gyro_bias", "", "12 deg/s at rest"),
        ("crashed.bin", "crash", str(CRASH_S), ""),
        ("crashed.bin", "battery", "1", "nobody saw it"),
    )
    return folder


def write(path, head, *rows):
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows((head, *rows))


@pytest.mark.thorough
def test_made_recordings_are_reviewed_and_scored(tool, folder, tmp_path, monkeypatch, capsys):
    arguments = ["real_flights.py", str(folder), "-o", str(tmp_path), "--list"]
    monkeypatch.setattr(sys, "argv", arguments)
    assert tool.main() == 0
    lines = capsys.readouterr().out.splitlines()
    said = json.loads(next(line for line in lines if line.startswith("{")))
    assert said["recall"] == {"battery": "0/1", "crash": "1/1", "gyro_bias": "1/1"}
    assert said["false"] == {"crash": "0/1"}
    assert said["crash is the first finding"] == "1/1"
    assert "crashed.bin: missed battery 1 nobody saw it" in lines
    assert "| `crash` | 1 of 1 | 0 of 1 | 0 |" in lines


def finding(kind, from_s, to_s, severity="warning"):
    return {"kind": kind, "from_s": from_s, "to_s": to_s, "severity": severity}


def row(names, *values):
    return dict(zip(names, values, strict=True))


def test_a_crash_has_to_be_told_at_its_time_and_other_events_anywhere(tool):
    events = [row(FIELDS, "a", "crash", "50", ""), row(FIELDS, "a", "gyro_bias", "", "")]
    early = {"a": [finding("crash", 40.0, 44.0), finding("gyro_bias", 0.0, 1.0)]}
    assert tool.score(events, [], early).recall == {"crash": (0, 1), "gyro_bias": (1, 1)}
    then = {"a": [finding("crash", 46.0, 46.0)]}
    assert tool.score(events, [], then).recall == {"crash": (1, 1), "gyro_bias": (0, 1)}
    assert tool.score(events, [], {}).recall == {"crash": (0, 1), "gyro_bias": (0, 1)}


def test_what_did_not_happen_counts_where_it_is_said_and_elsewhere(tool):
    events = [row(FIELDS, "a", "no_crash", "", ""), row(FIELDS, "b", "propeller", "", "")]
    said = {"a": [finding("crash", 1.0, 2.0)], "b": [finding("motor_imbalance", 1.0, 2.0)]}
    result = tool.score(events, [], said)
    assert result.false == {"crash": (1, 1), "motor_imbalance": (1, 1)}
    assert result.elsewhere["crash"] == 1
    assert tool.score(events, [], {"a": [], "b": []}).false["crash"] == (0, 1)


def test_judged_findings_are_gone_or_kept_by_kind_time_and_severity(tool):
    labels = [
        row(LABELS, "a", "gps_velocity", "GPS", "warning", "10", "20", verdict, "")
        for verdict in ("true", "false", "undecidable")
    ]
    labels.append(row(LABELS, "a", "imu_slow", "IMU 1", "notice", "0", "9", "true", ""))
    for said, gone, kept in (
        (finding("gps_velocity", 19.0, 30.0), 0, 1),
        (finding("gps_velocity", 25.0, 30.0), 1, 0),
        (finding("gps_velocity", 12.0, 13.0, "notice"), 1, 0),
    ):
        result = tool.score([], labels, {"a": [said]})
        assert (result.gone, result.kept) == ((gone, 1), (kept, 1))


def test_the_crash_or_what_led_to_it_has_to_come_first(tool):
    events = [row(FIELDS, "a", "crash", "5", "")]
    for first, leads in (("crash", 1), ("loss_of_control", 1), ("gps_lost", 0)):
        found = [finding(first, 5.0, 5.0), finding("crash", 5.0, 5.0)]
        assert tool.score(events, [], {"a": found}).first == (leads, 1)
