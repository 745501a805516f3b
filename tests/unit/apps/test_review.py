"""The command `h2nav review`: a page and a document per flight, whatever else is in the list."""

import json
import os
import webbrowser
from pathlib import Path

import numpy as np
import pytest
from made_logs import DataflashWriter
from replayed import Replayed, rewritten

from h2nav.apps import reviewing
from h2nav.apps.configuration import Configuration
from h2nav.apps.playback import PlaybackOptions, inputs_for
from h2nav.apps.review import SOMETHING_SERIOUS, page_names
from h2nav.attitude.samples import Trust
from h2nav.cli import BAD_INPUT, SUCCESS, main
from h2nav.files.earth_field import UNDATED_UNIX_S
from h2nav.recordings.opening import open_flight
from h2nav.recordings.receiver_tables import GPS_EPOCH_UNIX_S, WEEK_S


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> Path:
    return rewritten(tmp_path_factory.mktemp("flight") / "short.tlog", first_s=12.0)


def test_a_flight_becomes_a_page_and_a_document(flight, tmp_path, capsys):
    assert main(["review", str(flight), "-o", str(tmp_path), "--json"]) == SUCCESS
    (printed,) = json.loads(capsys.readouterr().out)
    written = json.loads((tmp_path / "short.json").read_bytes())
    assert printed == written
    assert written["file"] == "short.tlog"
    assert written["duration_s"] == pytest.approx(12.0, abs=0.1)
    assert written["why_no_estimate"] is None
    page = (tmp_path / "short.html").read_text(encoding="utf-8")
    assert "short.tlog" in page
    assert page.rstrip().endswith("</html>")


def test_pages_go_into_the_folder_reviews_where_none_is_named(
    flight, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main(["review", str(flight), "--no-smooth"]) == SUCCESS
    assert Path("reviews/short.html").is_file()
    assert main(["review"]) == BAD_INPUT
    assert "name a recording" in capsys.readouterr().err
    assert main(["review", "none.bin", "-o", "pages"]) == BAD_INPUT
    assert not Path("pages").exists()


def test_the_attitude_of_a_review_is_that_of_the_daemon(flight):
    daemon = Replayed(flight, Configuration()).estimates
    reviewed = reviewing.review(
        open_flight(flight), PlaybackOptions(), smooths=False
    ).flight.estimates
    assert reviewed is not None
    expected = [(each.q_w, each.q_x, each.q_y, each.q_z) for each in daemon]
    assert list(map(tuple, reviewed.q_nb.tolist())) == expected


def test_what_held_the_attitude_is_told_as_the_estimates_say_it(flight):
    daemon = Replayed(flight, Configuration()).estimates
    held = reviewing.review(open_flight(flight), PlaybackOptions(), smooths=False).flight.held
    used = {
        name: any(each.trust & flag for each in daemon)
        for name, flag in (("velocity", Trust.VELOCITY_USED), ("compass", Trust.FIELD_USED))
    }
    assert any(used.values())
    assert {name: any(span.name == name for span in held) for name in used} == used
    assert all(0.0 <= span.from_s <= span.to_s <= 12.1 for span in held)


def test_a_log_without_a_date_is_looked_at_in_the_same_field_on_every_day(tmp_path):
    log = tmp_path / "undated.bin"
    dated, undated = DataflashWriter(), DataflashWriter()
    t_us = np.arange(1_000_000, 3_000_000, 20_000)
    for writer in (dated, undated):
        columns = "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
        writer.add("IMU", "Qffffff", columns, t_us, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8)
    dated.add("GPS", "QBIHLL", "TimeUS,Status,GMS,GWk,Lat,Lng", t_us, 3, 1000, 2200, 47.0, 8.0)
    dates_s = []
    for writer in (dated, undated):
        log.write_bytes(writer.bytes())
        dates_s.append(inputs_for(open_flight(log), PlaybackOptions()).unix_s)
    assert dates_s[0] == pytest.approx(GPS_EPOCH_UNIX_S + 2200 * WEEK_S, abs=30.0)
    assert dates_s[1] == UNDATED_UNIX_S


def test_the_smoothed_attitude_can_be_left_out(flight):
    assert reviewing.review(open_flight(flight), PlaybackOptions()).flight.smoothed is not None
    assert (
        reviewing.review(open_flight(flight), PlaybackOptions(), smooths=False).flight.smoothed
        is None
    )


def test_what_cannot_be_reviewed_is_named_and_the_others_are(flight, tmp_path, capsys):
    garbage = tmp_path / "garbage.bin"
    garbage.write_bytes(b"no flight at all" * 100)
    absent = tmp_path / "absent.ulg"
    status = main(["review", str(garbage), str(absent), str(flight), "-o", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert status == BAD_INPUT
    assert str(garbage) in said
    assert str(absent) in said
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "short.html",
        "short.json",
    ]


def test_a_name_that_is_no_text_is_reviewed(flight, tmp_path):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/flight-\xff.tlog"))
    path.symlink_to(flight)
    assert main(["review", str(path), "-o", str(tmp_path / "out"), "--no-smooth"]) == SUCCESS
    (document,) = (tmp_path / "out").glob("*.json")
    assert json.loads(document.read_bytes())["file"] == "flight-\ufffd.tlog"


def test_a_pipe_is_refused_and_nothing_waits_for_it(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe.tlog")
    assert main(["review", str(tmp_path / "pipe.tlog"), "-o", str(tmp_path)]) == BAD_INPUT
    assert "pipe.tlog: is not a file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("severity", "word", "status"),
    [
        ("error", "error", SOMETHING_SERIOUS),
        ("critical", "error", SOMETHING_SERIOUS),
        ("warning", "error", SUCCESS),
        ("warning", "warning", SOMETHING_SERIOUS),
        ("notice", "warning", SUCCESS),
    ],
)
def test_the_status_says_whether_something_serious_was_found(
    monkeypatch, tmp_path, severity, word, status
):
    found = {"severity": severity, "from_s": 1.0, "to_s": 2.0, "source": "IMU 1", "text": "bad"}
    document = {"findings": [found], "duration_s": 3.0, "verdict": "Bad."}
    monkeypatch.setattr(reviewing, "write_review", lambda *_, **__: document)
    assert main(["review", "x", "-o", str(tmp_path), "--fail-on", word]) == status


@pytest.mark.parametrize("words", [(), ("--open",), ("--open", "--json")])
def test_the_page_is_opened_in_the_browser_on_request_alone(monkeypatch, tmp_path, words):
    document = {"findings": [], "duration_s": 3.0, "verdict": "Good."}
    monkeypatch.setattr(reviewing, "write_review", lambda *_, **__: document)
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert main(["review", "a/flight.tlog", "-o", str(tmp_path), *words]) == SUCCESS
    assert opened == ([(tmp_path / "flight.html").as_uri()] if words else [])


def test_a_recording_without_an_autopilot_says_why_there_is_no_estimate(tmp_path):
    path = rewritten(tmp_path / "silent.tlog", without=0, first_s=8.0)
    reviewed = reviewing.review(open_flight(path), PlaybackOptions()).flight
    assert reviewed.estimates is None
    assert "heartbeats" in reviewed.why_no_estimate


def test_flights_of_one_name_get_pages_of_their_own(tmp_path):
    flights = [
        Path("a/flight.bin"),
        Path("b/flight.tlog"),
        Path("c/flight.tlog"),
        Path("other.ulg"),
    ]
    names = page_names(flights, tmp_path)
    assert names == ["flight_bin", "flight_tlog", "flight_tlog-2", "other"]


def test_a_page_is_written_over_by_its_own_flight_alone(flight, tmp_path):
    assert main(["review", str(flight), "-o", str(tmp_path), "--no-smooth"]) == SUCCESS
    other = tmp_path / f"{flight.stem}.bytes"
    other.write_bytes(flight.read_bytes()[:1000])
    for path, name in ((flight, flight.stem), (other, f"{flight.stem}_bytes")):
        assert page_names([path], tmp_path) == [name]
        assert main(["review", str(path), "-o", str(tmp_path), "--no-smooth"]) == SUCCESS
        assert json.loads((tmp_path / f"{name}.json").read_bytes())["file"] == path.name
    assert len(list(tmp_path.glob("*.json"))) == 2
    (tmp_path / f"{flight.stem}.json").write_text("{ no document")
    assert page_names([other], tmp_path) == [flight.stem]


def made(count, severity="warning"):
    """A document with so many findings."""
    finding = {"severity": severity, "from_s": 1.04, "to_s": 2.0, "source": "IMU 1", "text": "bad"}
    return {"findings": [finding] * count, "duration_s": 3.6, "verdict": "Shaken."}


@pytest.mark.parametrize(
    ("count", "head", "tail"),
    [
        (0, "4 s, no findings", []),
        (1, "4 s, 1 finding", []),
        (20, "4 s, 20 findings", []),
        (21, "4 s, 21 findings", ["  and 1 more"]),
    ],
)
def test_a_review_is_told_with_its_first_findings(monkeypatch, tmp_path, capsys, count, head, tail):
    monkeypatch.setattr(reviewing, "write_review", lambda *_, **__: made(count))
    assert main(["review", "x/flight.tlog", "-o", str(tmp_path)]) == SUCCESS
    assert capsys.readouterr().out.splitlines() == [
        f"{tmp_path}/flight.html: {head}",
        "  Shaken.",
        *["  warning: 1.0 to 2.0 s: IMU 1: bad"] * min(count, 20),
        *tail,
    ]


@pytest.mark.parametrize(
    ("words", "smooths", "earlier"),
    [((), True, 0), (("--no-smooth",), False, 0), (("--earlier", "OLD"), True, 1)],
)
def test_a_review_smooths_calibrates_and_knows_earlier_flights(
    monkeypatch, tmp_path, words, smooths, earlier
):
    old, asked = tmp_path / "old", []
    old.mkdir()
    (old / "a.json").write_text(
        json.dumps(
            {
                "name": "a", "airframe": {"id": "uid:1"}, "start_utc": "2026-01-01T00:00:00Z",
                "features": {},
                "flown": {"flown_s": 1.0, "distance_m": 1.0, "landings": 1, "hard_landings": 0},
            }
        )
    )  # fmt: skip

    def write(path, folder, name, options, *, smooths, progress):
        asked.append((path, folder, name, options, smooths))
        return made(0)

    monkeypatch.setattr(reviewing, "write_review", write)
    words = [str(old) if word == "OLD" else word for word in words]
    out = tmp_path / "out"
    assert main(["review", "x.tlog", "--class", "rover", "-o", str(out), *words]) == SUCCESS
    ((path, folder, name, options, is_smoothed),) = asked
    assert (path, folder, name, is_smoothed) == (Path("x.tlog"), out, "x", smooths)
    assert (options.calibrates, options.vehicle_class) == (smooths, "rover")
    assert len(options.earlier) == earlier


def test_a_page_that_cannot_be_written_ends_it_and_a_folder_too(monkeypatch, tmp_path, capsys):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(reviewing, "write_review", full)
    assert main(["review", "x.tlog", "-o", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"h2nav: {tmp_path}: No space left on device\n"
    (tmp_path / "file").touch()
    assert main(["review", "x.tlog", "-o", str(tmp_path / "file" / "out")]) == BAD_INPUT
    said = f"{tmp_path}/file/out: Not a directory; name a folder that can be written with -o"
    assert capsys.readouterr().err == f"h2nav: {said}\n"


def test_the_folder_of_earlier_reviews_stays_where_nothing_could_be_reviewed(tmp_path):
    out = tmp_path / "out"
    assert main(["review", str(tmp_path / "none.bin"), "-o", str(out)]) == BAD_INPUT
    assert not out.exists()
    out.mkdir()
    (out / "old.json").touch()
    assert main(["review", str(tmp_path / "none.bin"), "-o", str(out)]) == BAD_INPUT
    assert (out / "old.json").exists()


def test_the_schema_of_the_documents_is_printed_instead(capsys):
    assert main(["review", "--schema"]) == SUCCESS
    assert json.loads(capsys.readouterr().out)["$schema"].startswith("https://json-schema.org")
