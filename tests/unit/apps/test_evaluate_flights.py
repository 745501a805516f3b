"""`h2nav evaluate flights`: recordings of an autopilot, from the command line."""

import json
import os
from pathlib import Path

import pytest
from needs import need_package, shared_data
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from replayed import TAKEOFF, rewritten

from h2nav.cli import main

SIMSTATE = mavlink.MAVLINK_MSG_ID_SIMSTATE
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
ERRORS = {"tilt", "heading", "total", "worst_tilt", "worst_heading", "worst_total", "estimates"}
HONESTY = {"nees_tilt", "nees_heading", "tilt_beyond_3_sigma", "heading_beyond_3_sigma"}
FIRST_S = 8.0


def evaluated(capsys, *words) -> dict:
    assert main(["evaluate", "flights", *map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(autouse=True)
def one_processor(monkeypatch) -> None:
    """Processes would be started for seconds, to evaluate a few seconds of flight."""
    monkeypatch.setattr(os, "cpu_count", lambda: 1)


@pytest.fixture(scope="module")
def takeoff(tmp_path_factory) -> dict:
    """Of the take-off; with a copy beside whose name has events."""
    path = tmp_path_factory.mktemp("flight") / "takeoff.tlog"
    path.write_bytes(TAKEOFF.read_bytes())
    # The recording begins at 55.09 s of the autopilot's time.
    path.with_name("takeoff.tlog.events").write_text("60.09 PHASE ground\n75.09 PHASE air\n")
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr("sys.stdout.write", lines.append)
        assert main(["evaluate", "flights", str(path), "--json"]) == 0
    return json.loads("".join(lines))


def test_the_json_has_the_keys_that_others_read(takeoff):
    assert set(takeoff) == {"flights", "mean", "left_out"}
    flight = takeoff["flights"]["takeoff"]
    assert {"whole", "settled", "airborne", "phases", "states", "notices", "notes"} <= set(flight)
    assert set(flight["whole"]) == {"h2nav", "h2nav_no_gps", "ekf"}
    assert set(flight["whole"]["h2nav"]) == ERRORS | HONESTY
    assert set(flight["whole"]["ekf"]) == ERRORS
    assert takeoff["mean"]["whole"]["ekf"]["flights"] == 1
    assert flight["truth"] == "SIMSTATE"
    assert flight["settled"] == {}


@pytest.mark.thorough
def test_several_places_are_scored_together(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    (tmp_path / "folder").mkdir()
    places = [tmp_path / "one.tlog", tmp_path / "folder"]
    rewritten(places[0], first_s=FIRST_S)
    rewritten(places[1] / "two.tlog", first_s=FIRST_S)
    rewritten(places[1] / "one.tlog", first_s=FIRST_S)
    found = evaluated(capsys, *places, places[0])["flights"]
    assert len(found) == 3
    assert "two" in found
    assert {name.rpartition("_")[2] for name in found} == {"one.tlog", "two"}
    assert not any("/" in name for name in found)  # they name the files of figures, too


@pytest.mark.parametrize(("estimator", "words"), [("h2nav", []), ("h2nav_no_gps", ["--no-gps"])])
def test_it_says_what_replay_says(takeoff, capsys, estimator, words):
    assert main(["replay", str(TAKEOFF), "--no-log", "--json", *words]) == 0
    replayed = json.loads(capsys.readouterr().out)
    figures = takeoff["flights"]["takeoff"]["whole"][estimator]
    assert figures["estimates"] == pytest.approx(replayed["compared"], abs=5)
    for name in ("tilt", "total"):
        assert figures[name] == pytest.approx(replayed["rms_deg"][name], rel=0.01)


def test_parts_of_the_flight(takeoff):
    flight = takeoff["flights"]["takeoff"]
    counts = {name: part["h2nav"]["estimates"] for name, part in flight["phases"].items()}
    assert counts == pytest.approx({"ground": 1500, "air": 2000}, abs=40)
    assert 1000 < flight["airborne"]["h2nav"]["estimates"] < 4000


def test_what_the_service_said_meanwhile(takeoff):
    flight = takeoff["flights"]["takeoff"]
    assert flight["states"]["h2nav"]["active"] == pytest.approx(38.9, abs=0.5)
    assert sum(flight["states"]["h2nav"].values()) == pytest.approx(flight["duration_s"], abs=0.2)
    notices = [notice["text"] for notice in flight["notices"]["h2nav"]]
    assert notices[-1] == "active"
    assert {"t_s", "severity", "text"} == set(flight["notices"]["h2nav"][0])


@pytest.mark.thorough
def test_what_cannot_be_scored_is_left_out_and_the_others_are_not(tmp_path, capsys):
    rewritten(tmp_path / "good.tlog", first_s=FIRST_S)
    rewritten(tmp_path / "blind.tlog", first_s=FIRST_S, without=SIMSTATE)
    (tmp_path / "notes.txt").write_text("not looked at")
    (tmp_path / "broken.tlog").write_text("no recording")
    result = evaluated(capsys, tmp_path)
    assert list(result["flights"]) == ["good"]
    assert set(result["left_out"]) == {"blind", "broken"}
    assert "no truth" in result["left_out"]["blind"]
    assert "not a recording" in result["left_out"]["broken"]


def test_the_table_is_of_all_estimators(tmp_path, capsys):
    path = rewritten(tmp_path / "good.tlog", first_s=FIRST_S)
    words = ["evaluate", "flights", str(path), "--phase", "start=55-58"]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line for line in lines if any(name in line for name in ("h2nav ", "no_gps ", "ekf "))]
    assert len(rows) >= 3
    assert sum("*" in row for row in rows) == 1
    assert any(line.startswith("start") for line in lines)


def test_the_same_from_our_own_log(tmp_path, capsys):
    path = rewritten(tmp_path / "flight.tlog", first_s=FIRST_S)
    assert main(["replay", str(path), "-o", str(tmp_path / "log.mcap")]) == 0
    capsys.readouterr()
    first = evaluated(capsys, path)["flights"]["flight"]["whole"]
    again = evaluated(capsys, tmp_path / "log.mcap")["flights"]["log"]["whole"]
    assert first == again


def test_two_recordings_of_one_name_keep_their_suffixes(tmp_path, capsys):
    rewritten(tmp_path / "flight.tlog", first_s=4.0)
    frames = [data for _, data in open_frames(tmp_path / "flight.tlog")]
    (tmp_path / "flight.bytes").write_bytes(b"".join(frames))
    assert set(evaluated(capsys, tmp_path)["flights"]) == {"flight.tlog", "flight.bytes"}


def open_frames(path: Path):
    from h2nav.recordings.recording import open_recording

    return list(open_recording(path).received())


def test_another_filter_and_class(tmp_path, capsys):
    path = rewritten(tmp_path / "flight.tlog", first_s=FIRST_S)
    words = ("--filter", "constant_gain", "--class", "handheld")
    figures = evaluated(capsys, path, *words)["flights"]["flight"]["whole"]
    assert figures["h2nav"]["total"] == figures["h2nav_no_gps"]["total"], "it knows no velocity"


@pytest.mark.thorough
def test_pictures(tmp_path, capsys):
    need_package("matplotlib")
    path = rewritten(tmp_path / "flight.tlog", first_s=FIRST_S)
    path.with_name("flight.events").write_text("56 PHASE one\n57 MODE LOITER\n58 PHASE two\n")
    evaluated(capsys, path, "--plots", tmp_path / "new" / "pictures")
    picture = tmp_path / "new" / "pictures" / "flight.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda place: None, "no recordings in this folder; expected .tlog, .mcap, .bytes"),
        (lambda place: (place / "a.tlog").write_text("x"), "a.tlog: not a recording; expected"),
        (
            lambda place: rewritten(place / "a.tlog", first_s=4.0, without=HEARTBEAT),
            "no estimate of ours at a time of the truth; expected IMU samples",
        ),
        (
            lambda place: rewritten(place / "a.tlog", first_s=4.0, without=SIMSTATE),
            "no truth; expected SIMSTATE in the recording, or beside it a_truth.csv",
        ),
    ],
)
def test_a_place_without_flights_is_one_line(tmp_path, capsys, make, says):
    make(tmp_path)
    assert main(["evaluate", "flights", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"h2nav: {tmp_path}")
    assert says in line


def test_a_place_that_is_none_is_bad_input(tmp_path, capsys):
    assert main(["evaluate", "flights", str(tmp_path / "nowhere")]) == 2
    assert "no such file or folder" in capsys.readouterr().err


def test_a_phase_of_another_form_is_bad_input(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", "flights", str(TAKEOFF), "--phase", "climb"])
    assert ended.value.code == 2
    assert "expected NAME=FROM-TO, found climb" in capsys.readouterr().err


@pytest.mark.thorough
def test_a_flight_with_a_reboot_and_truth_beside_it(capsys):
    """PX4, booted again in flight: 45 deg of tilt; EKF2 stands beside the truth."""
    path = shared_data("flights/px4_agile_reboot.tlog")
    flight = evaluated(capsys, path)["flights"]["px4_agile_reboot"]
    assert all("have no truth near them" in note for note in flight["notes"])  # PX4 was stopped
    assert flight["whole"]["h2nav"]["estimates"] > 21_000
    assert flight["whole"]["ekf"]["tilt"] == pytest.approx(1.07, abs=0.05)
    assert flight["whole"]["h2nav"]["tilt"] < 2.5
    assert flight["states"]["h2nav"]["no_imu"] > 3.0
