"""Truth and estimates of flights on one time line: boots, gaps, what is heard and what is noted."""

import math

import numpy as np
import pytest

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.errors import BadInput
from h2nav.evaluation.flights import scores
from h2nav.evaluation.flights.events import (
    Event,
    FlightPhase,
    events_path,
    parse_phase,
    phases_of,
    read_events,
)
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardEstimates
from h2nav.evaluation.flights.tracks import ErrorTrack, figures, track_of
from h2nav.evaluation.flights.truth import (
    EPOCH_US,
    Truth,
    _between,
    pairs,
    read_truth,
    truth_of,
    truth_paths,
)
from h2nav.maths.units import DEG

LEVEL = (1.0, 0.0, 0.0, 0.0)


def yawed(deg):
    return (math.cos(0.5 * deg * DEG), 0.0, 0.0, math.sin(0.5 * deg * DEG))


# --- clocks -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("back_us", "epochs"), [(1_000_000, 0), (1_000_001, 1)])
def test_a_clock_that_steps_back_by_more_than_a_second_has_restarted(back_us, epochs):
    heard = FromAutopilot()
    heard.boot_time(10, 50_000_000)
    heard.boot_time(20, 50_000_000 - back_us)
    assert heard.epochs(np.array([19, 20, 21])).tolist() == [0, epochs, epochs]
    # from there on the later times count
    heard.boot_time(30, 49_000_000 - back_us + epochs)
    assert heard.epochs(np.array([30])).tolist() == [1]


def test_a_recording_begins_with_the_first_time_and_ends_with_the_last():
    heard = FromAutopilot()
    for t_ns in (5_000, 7_999, 9_000):
        heard.time(t_ns)
    assert (heard.start_us, heard.end_us) == (5, 9)
    assert heard.boot_offset_us() is None


def test_the_offset_of_the_clocks_is_the_median_before_the_first_restart():
    heard = FromAutopilot()
    times = ((100, 2_000_000), (300, 3_000_000), (110, 4_000_000), (8_000_000, 1_000_000))
    for offset_us, boot_us in times:
        arrived_us = boot_us + offset_us
        heard.boot_time(arrived_us, boot_us)
        heard.ekf.add(arrived_us, 0.0, 0.0, 0.0)
        heard.ekf_boot_us.append(boot_us)
    assert heard.boot_offset_us() == 110


@pytest.mark.parametrize("listens", [True, False])
def test_one_run_of_several_listens_and_tells_the_time(listens):
    autopilot = FromAutopilot()
    run = FromService(autopilot, listens=listens)
    assert bool(run.message_ids) is listens
    zero = (0.0, 0.0, 0.0)
    for t_ns, t_us in ((5_999, 60_000_000), (8_000, 1_000_000)):
        run.estimate(
            t_ns, AttitudeEstimate(t_us, yawed(90.0), zero, zero, zero, 0.5 * DEG, Trust(0), DEG), 0
        )
    found = run.estimates()
    assert (found.arrived_us.tolist(), found.boot_us.tolist()) == ([5, 8], [60_000_000, 1_000_000])
    assert found.q_nb[1] == pytest.approx(yawed(90.0))
    assert found.sigma_tilt_deg == pytest.approx([0.5, 0.5])
    assert found.sigma_heading_deg == pytest.approx([1.0, 1.0])
    assert autopilot.epochs(np.array([9])).tolist() == [int(listens)]
    assert FromService(autopilot, listens=True).estimates().q_nb.shape == (0, 4)


# --- pairs ------------------------------------------------------------------------------------


def estimates_at(*t_us, q_nb=LEVEL):
    count = len(t_us)
    times = np.array(t_us, dtype=np.int64)
    ones = np.ones(count)
    return HeardEstimates(times, times, np.tile(q_nb, (count, 1)), ones, np.full(count, np.nan))


def truth_at(*rows):
    t_us, degs = zip(*rows, strict=True)
    return Truth("t", np.array(t_us), np.array([yawed(deg) for deg in degs]), True)


@pytest.mark.parametrize(
    ("t_us", "deg"),
    [
        (1_000_000, 0.0),
        (1_020_000, 10.0),
        (1_010_000, 5.0),
        (979_999, None),
        (980_000, 0.0),
        (1_060_000, 20.0),
        (1_060_001, None),
    ],
)
def test_an_estimate_has_the_truth_between_two_that_are_near(t_us, deg):
    """20 ms before the first or behind the last are near."""
    truth = truth_at((1_000_000, 0.0), (1_040_000, 20.0))
    found = pairs(truth, FromAutopilot(), estimates_at(t_us))
    assert found.rows.tolist() == ([] if deg is None else [0])
    if deg is not None:
        assert found.q_nb[0] == pytest.approx(yawed(deg), abs=2e-4)


@pytest.mark.parametrize(
    ("gap_us", "t_us", "deg"),
    [
        (40_000, 1_010_000, 5.0),
        (40_002, 1_010_000, 0.0),  # the middle of a longer gap is unknown: the nearer one
        (40_002, 1_030_002, 20.0),
        (80_000, 1_030_000, None),
    ],
)
def test_in_a_gap_the_nearer_truth_counts(gap_us, t_us, deg):
    truth = truth_at((1_000_000, 0.0), (1_000_000 + gap_us, 20.0))
    found = pairs(truth, FromAutopilot(), estimates_at(t_us))
    assert len(found.rows) == (deg is not None)
    if deg is not None:
        assert found.q_nb[0] == pytest.approx(yawed(deg), abs=2e-4)


def test_between_quaternions_of_either_sign_is_the_short_way():
    q = np.array([yawed(10.0)])
    assert _between(q, -q, np.array([0.5])) == pytest.approx(q)
    assert _between(q, q, np.array([0.3])) == pytest.approx(q)


def test_truth_by_the_autopilots_time_is_that_of_its_boot():
    heard = FromAutopilot()
    heard.boot_time(100, 50_000_000)
    heard.boot_time(200, 1_000_000)
    t_us = np.array([50_000_000, EPOCH_US + 1_000_000])
    truth = Truth("t", t_us, np.array([yawed(5.0), yawed(8.0)]), False)
    said = estimates_at(100, 200)._replace(boot_us=np.array([50_000_000, 1_000_000]))
    found = pairs(truth, heard, said)
    assert found.rows.tolist() == [0, 1]
    assert found.q_nb == pytest.approx(truth.q_nb)
    track = track_of(truth, heard, said)
    assert track.heading == pytest.approx([-5.0, -8.0])
    assert track.sigma_tilt.tolist() == [1.0, 1.0]
    assert track.sigma_heading is None
    assert track.t_s == pytest.approx([100e-6, 200e-6])


# --- files ------------------------------------------------------------------------------------


def test_truth_files_are_one_or_numbered_from_zero_without_a_gap(tmp_path):
    recording = tmp_path / "f.tlog"
    assert truth_paths(recording) == []
    for number in (0, 1, 3):
        (tmp_path / f"f_truth_{number}.csv").touch()
    assert [path.name for path in truth_paths(recording)] == ["f_truth_0.csv", "f_truth_1.csv"]
    (tmp_path / "f_truth.csv").touch()
    assert [path.name for path in truth_paths(recording)] == ["f_truth.csv"]


@pytest.mark.parametrize(
    ("row", "is_usable"),
    [
        ("0,1,0,0,0", True),
        ("-1,1,0,0,0", False),
        ("99999999999999,1,0,0,0", True),
        ("100000000000000,1,0,0,0", False),
        ("5,1.009,0,0,0", True),
        ("5,1.011,0,0,0", False),
        ("5,0.991,0,0,0", True),
        ("5,0.989,0,0,0", False),
    ],
)
def test_a_row_of_truth_is_of_a_boot_and_an_attitude(tmp_path, row, is_usable):
    path = tmp_path / "x.csv"
    path.write_text(f"t_us,q_w,q_x,q_y,q_z\n{row}\n")
    if is_usable:
        found = read_truth(path)
        assert found.t_us.tolist() == [int(row.split(",")[0])]
        assert np.isnan(found.ekf_nb).all()
    else:
        with pytest.raises(BadInput, match=r"x\.csv"):
            read_truth(path)


def test_boots_are_one_after_the_other_on_the_time_line_of_the_truth(tmp_path):
    for number in range(2):
        (tmp_path / f"f_truth_{number}.csv").write_text("t_us,q_w,q_x,q_y,q_z\n7,1,0,0,0\n")
    truth, notes = truth_of(tmp_path / "f.tlog", FromAutopilot())
    assert truth.t_us.tolist() == [7, EPOCH_US + 7]
    assert (truth.is_by_arrival, truth.ekf_nb) == (False, None)
    assert truth.name == "f_truth_0.csv, f_truth_1.csv"
    assert notes == ["the autopilot booted 1 times, the truth is of 2 of them"]


# --- events -----------------------------------------------------------------------------------


def test_events_stand_beside_the_recording_by_its_name_or_its_stem(tmp_path):
    recording = tmp_path / "f.tlog"
    assert events_path(recording) is None
    (tmp_path / "f.events").touch()
    assert events_path(recording).name == "f.events"
    (tmp_path / "f.tlog.events").touch()
    assert events_path(recording).name == "f.tlog.events"


@pytest.mark.parametrize(
    ("line", "event"),
    [
        ("12 PHASE a b  ", Event(12.0, "PHASE a b")),
        ("  0.123456789\tx", Event(0.123456789, "x")),
        ("999999999999 x", Event(999999999999.0, "x")),
        ("1000000000000 x", None),
        ("1.0123456789 x", None),
        ("-1 x", None),
        ("12", None),
        ("12x", None),
    ],
)
def test_an_event_is_a_time_and_a_text(tmp_path, line, event):
    path = tmp_path / "f.events"
    path.write_text(f"\n{line}\n")
    if event is None:
        with pytest.raises(BadInput) as caught:
            read_events(path)
        assert str(caught.value) == f"{path}:2: expected a time in s and a text"
    else:
        assert read_events(path) == [event]


def test_a_phase_lasts_until_the_next_one():
    events = [Event(1.0, "PHASE a"), Event(2.0, "x PHASE b"), Event(3.0, "PHASE c d")]
    assert phases_of(events) == [FlightPhase("a", 1.0, 3.0), FlightPhase("c d", 3.0, math.inf)]
    assert phases_of([]) == []


@pytest.mark.parametrize(
    ("text", "phase"),
    [("a b=1-2.5", FlightPhase("a b", 1.0, 2.5)), ("a=2-2", None), ("=1-2", None), ("a=1-", None)],
)
def test_a_phase_given_as_text(text, phase):
    if phase is None:
        with pytest.raises(ValueError, match=f"expected NAME=FROM-TO, found {text}"):
            parse_phase(text)
    else:
        assert parse_phase(text) == phase


# --- figures ----------------------------------------------------------------------------------


def test_figures_are_of_the_part_alone():
    track = ErrorTrack(
        np.arange(3.0), np.array([5.0, 3.0, 99.0]), np.array([-4.0, 2.0, 99.0]),
        np.array([3.0, 1.0, 99.0]), np.full(3, 2.0), None,
    )  # fmt: skip
    found = figures(track, np.array([True, True, False]))
    assert found["total"] == pytest.approx(math.sqrt(17.0))
    assert found["heading"] == pytest.approx(math.sqrt(10.0))
    assert found["tilt"] == pytest.approx(math.sqrt(5.0))
    worst = [found[f"worst_{name}"] for name in ("total", "heading", "tilt")]
    assert worst == [5.0, 4.0, 3.0]
    assert found["estimates"] == 2
    assert "nees_heading" not in found
    assert figures(track, np.zeros(3, bool)) is None


def test_a_stretch_begins_with_its_beginning_and_ends_before_its_end():
    found = scores._inside(np.arange(6.0), [(1.0, 3.0), (4.0, 5.0)])
    assert found.tolist() == [False, True, True, False, True, False]


def test_means_leave_out_what_no_flight_has_and_the_worst():
    rows = [{"tilt": 1.0, "nees_tilt": None, "worst_tilt": 9.0, "estimates": 4}, {"tilt": 4.0}]
    assert scores._mean(rows) == {"tilt": 2.5, "nees_tilt": None, "flights": 2}
    spans = {"settled": {}, "airborne": {}}
    one, other = ({"whole": {"a": {"tilt": tilt}}, **spans} for tilt in (1.0, 3.0))
    assert scores.mean([one, other])["whole"] == {"a": {"tilt": 2.0, "flights": 2}}
    assert scores._best({"a": {"total": 2.0}, "b": {"total": 1.5}}) == "b"


@pytest.mark.parametrize("suffix", [".tlog", ".mcap"])
def test_recordings_of_a_folder_are_in_order_of_their_names(tmp_path, suffix):
    for name in ("b", "a"):
        (tmp_path / f"{name}{suffix}").touch()
    (tmp_path / "c.txt").touch()
    (tmp_path / f"d{suffix}").mkdir()
    assert [path.stem for path in scores.flight_paths(tmp_path)] == ["a", "b"]
    assert scores.flight_paths(tmp_path / "c.txt") == [tmp_path / "c.txt"]
