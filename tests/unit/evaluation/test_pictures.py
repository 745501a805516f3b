"""What the pictures show, in which units and under which names; nothing is drawn."""

import math
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.calibration import pictures
from h2nav.evaluation.campaign import pictures as of_campaign
from h2nav.evaluation.dataset import pictures as of_dataset
from h2nav.evaluation.dataset.filters import FilterTrack
from h2nav.evaluation.flights import pictures as of_flights
from h2nav.evaluation.flights.events import Event, FlightPhase
from h2nav.evaluation.flights.flight import PlayedFlight
from h2nav.evaluation.flights.tracks import ErrorTrack
from h2nav.evaluation.observer import pictures as of_observer
from h2nav.evaluation.paper import pictures as of_paper
from h2nav.integrity.findings import Severity
from h2nav.maths.attitude_errors import AttitudeErrors
from h2nav.maths.units import DEG
from h2nav.recordings.trials import Trial


class Axes:
    """What is drawn on it, by the name of the call."""

    def __init__(self):
        self.calls = []
        self.spines = defaultdict(lambda: SimpleNamespace(set_visible=lambda _: None))
        self.yaxis = SimpleNamespace(set_major_formatter=lambda _: None)

    def __getattr__(self, name):
        def call(*args, **kwargs):
            self.calls.append((name, args, kwargs))
            return SimpleNamespace()

        return call

    def get_legend_handles_labels(self):
        labels = [kwargs["label"] for _, _, kwargs in self.calls if "label" in kwargs]
        return labels, labels

    def named(self, name):
        return [(args, kwargs) for called, args, kwargs in self.calls if called == name]

    def only(self, name):
        ((args, _),) = self.named(name)
        return args[0] if len(args) == 1 else args

    def lines(self):
        return {kwargs.get("label"): args for args, kwargs in self.named("plot")}


class Plotting:
    """In the place of pyplot; `axes` and `saved` are those of each picture, in order."""

    def __init__(self):
        self.figures, self.axes, self.saved = [], [], []

    def subplots(self, rows=1, columns=1, **options):
        axes = [Axes() for _ in range(rows * columns)]
        self.axes.append(axes)
        self.figures.append(Axes())
        return self.figures[-1], axes if len(axes) > 1 else axes[0]


@pytest.fixture
def plotting(monkeypatch):
    made = Plotting()
    monkeypatch.setattr(pictures, "pyplot", lambda: made)
    monkeypatch.setattr(
        pictures, "save", lambda figure, path, dpi=110: made.saved.append(path.name)
    )
    return made


# --- flights --------------------------------------------------------------------------------------


def flight(events=(), notices=(), phases=(), tracks=None):
    t_s = np.array((0.1, 0.2, 0.6, 1.2))
    own = ErrorTrack(
        t_s, np.array((3.0, 4.0, 0.001, 5.0)), np.array((-1.0, -1.0, -2.0, 3.0)),
        np.array((0.5, 0.5, 0.5, 0.5)), np.full(4, 2.0), None,
    )  # fmt: skip
    runs = {"h2nav": SimpleNamespace(notices=list(notices))}
    return PlayedFlight(
        "f", "SIMSTATE", 95.0, {"h2nav": own} if tracks is None else tracks, None, tuple(phases),
        tuple(events), runs, 1_000_000, (),
    )  # fmt: skip


def test_errors_of_a_flight_are_the_rms_of_each_half_second(plotting):
    of_flights.draw(flight(), Path("f.png"))
    (axes,) = plotting.axes
    t_s, total = axes[0].lines()["h2nav"]
    assert t_s[:3] == pytest.approx((0.25, 0.75, 1.25))
    assert total[:3] == pytest.approx((math.sqrt(12.5), 0.01, 5.0))  # 0.01 deg at the least
    assert np.isnan(total[3:]).all()
    assert axes[1].lines()["h2nav"][1][:3] == pytest.approx((0.5, 0.5, 0.5))
    assert axes[2].lines()["h2nav"][1][:3] == pytest.approx((1.0, 2.0, 3.0))
    assert [axis.only("set_ylabel") for axis in axes] == [
        "total error, deg", "tilt error, deg", "heading error, deg", "events",
    ]  # fmt: skip
    assert axes[0].only("set_xlim") == (0.0, 95.0)
    # three deviations of the tilt; of the heading none are predicted
    ((_, low, high), band) = axes[1].named("fill_between")[0]
    assert (low, high[0], band["label"]) == (0.01, pytest.approx(6.0), "h2nav, 3 sigma")
    assert not axes[0].named("fill_between")
    assert not axes[2].named("fill_between")
    assert plotting.saved == ["f.png"]
    assert plotting.figures[0].only("suptitle") == "f: rms of every 0.5 s against SIMSTATE"
    assert plotting.figures[0].only("legend")[1] == ["h2nav", "h2nav, 3 sigma"]
    assert axes[-1].only("set_xlabel") == "time since the start of the recording, s"


def labels(made):
    return [(args, kwargs["ha"]) for args, kwargs in made.axes[0][-1].named("text")]


def test_events_stand_below_each_other_and_within_the_picture(plotting):
    """A letter is as wide as half a second of this flight."""
    events = [
        Event(1.0, "a" * 50), Event(2.0, "TEXT (1, 1) sev3 b"), Event(60.0, "c"),
        Event(94.9, "end"), Event(5.0, "READY x"), Event(5.0, "PHASE x"), Event(5.0, "x sev6 y"),
    ]  # fmt: skip
    notices = [(3_500_000, Severity.WARNING, "d")]
    of_flights.draw(flight(events, notices), Path("f.png"))
    assert labels(plotting) == [
        ((1.0, 0.5, "|" + "a" * 44), "left"),
        ((2.0, 1.5, "|b"), "left"),
        ((2.5, 2.5, "|h2nav: d"), "left"),
        ((60.0, 0.5, "|c"), "left"),
        ((94.9, 0.5, "end|"), "right"),
    ]
    lines = [args[0] for args, _ in plotting.axes[0][0].named("axvline")]
    assert lines == [1.0, 2.0, 2.5, 60.0, 94.9]
    assert not plotting.axes[0][-1].named("axvline")
    assert plotting.axes[0][-1].only("set_ylim") == (6, 0)


def test_a_seventh_event_at_once_has_no_label(plotting):
    of_flights.draw(flight([Event(1.0, "x")] * 7), Path("f.png"))
    assert [args[1] for args, _ in labels(plotting)] == [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]
    assert len(plotting.axes[0][0].named("axvline")) == 7


def test_every_second_phase_is_grey_as_far_as_it_was_recorded(plotting):
    phases = [
        FlightPhase("before", -20.0, -5.0), FlightPhase("take-off", -5.0, 10.0),
        FlightPhase("calm", 10.0, 40.0), FlightPhase("wild", 40.0, 50.0),
        FlightPhase("landing", 50.0, math.inf), FlightPhase("after", 95.0, 99.0),
    ]  # fmt: skip
    of_flights.draw(flight(phases=phases), Path("f.png"))
    for axis in plotting.axes[0][:3]:
        spans = [args for args, _ in axis.named("axvspan")]
        assert spans == [(10.0, 40.0), (50.0, 95.0)]
    names = [(args[0], args[1][0]) for args, _ in plotting.axes[0][0].named("annotate")]
    assert names == [("take-off", 0.0), ("calm", 10.0), ("wild", 40.0), ("landing", 50.0)]
    of_flights.draw(flight(phases=[FlightPhase("long name", 1.0, 2.0)] * 4), Path("f.png"))
    offsets = [kwargs["xytext"] for _, kwargs in plotting.axes[1][0].named("annotate")]
    assert offsets == [(2, 2), (2, 13), (2, 24)]


# --- data sets ------------------------------------------------------------------------------------


def test_a_run_shows_its_scored_errors_its_bias_its_gains_and_its_gate(plotting):
    count = 300
    mask = np.arange(count) >= 100
    zeros = np.zeros((count, 3))
    trial = Trial(
        "t", 100.0, np.arange(count) * 10_000, zeros, zeros, zeros, None, mask, True, None
    )
    found = AttitudeErrors(*(np.full(count, size) for size in (5.0, -4.0, 3.0)))
    used = np.arange(count) < 150
    track = FilterTrack(
        np.zeros((count, 4)), 1.0, "native", np.full((count, 3), DEG), np.ones(count), used
    )
    of_dataset.draw(trial, track, found, Path("x/t.mine.png"))
    (axes,) = plotting.axes
    errors = axes[0].lines()
    assert np.isnan(errors["heading"][1][:100]).all()
    assert errors["heading"][1][100:] == pytest.approx(-4.0)
    assert errors["inclination"][1][100:] == pytest.approx(3.0)
    assert errors["heading"][0][-1] == pytest.approx(2.99)
    assert axes[1].lines()[None][1] == pytest.approx(1.0)
    assert axes[2].lines()[None][1] == pytest.approx(1.0)
    share = axes[3].lines()[None][1]
    assert share[[75, 149, 250]] == pytest.approx((1.0, 0.5, 0.0), abs=0.011)
    assert axes[3].only("set_ylim") == (-0.05, 1.05)
    assert axes[0].only("set_title") == "t: mine"
    names = [axis.only("set_ylabel") for axis in axes]
    assert names == ["error, deg", "gyro bias, deg/s", "gain set", "field believed"]
    plain = track._replace(bias=None, gain_set=None)
    of_dataset.draw(trial._replace(m_s=None), plain, found, Path("x/t.mine.png"))
    assert not any(axis.lines() for axis in plotting.axes[1][1:])


# --- campaigns ------------------------------------------------------------------------------------


def test_curves_are_shares_of_flights_beyond(plotting):
    axis = Axes()
    of_campaign._curve(axis, [3.0, None, 1.0, 0.0, 2.0], "name", "C0", "-")
    ((x, y), options) = axis.named("step")[0]
    assert x.tolist() == [1e-3, 1.0, 2.0, 3.0]
    assert y.tolist() == [1.0, 0.75, 0.5, 0.25]
    assert (options["where"], options["label"]) == ("pre", "name")
    of_campaign._curve(axis, [None], "none", "C0", "-")
    assert len(axis.named("step")[1][0][0]) == 0


def row(**changes):
    degs = {"p50": 1.0, "p95": 2.0, "p100": 3.0}
    return {
        "seed": 1, "length_s": 60.0, "calm_h": 0.1, "cpu_s": 1.0, "handler_errors": 0,
        "heading_deg": degs, "tilt_deg": degs, "heading_wrong_s": 4.0, "tilt_wrong_s": 5.0,
        "nees_heading": 0.7, "nees_tilt": 0.8, "false_accusations": [], "false_alarms": [],
        "faults": [],
    } | changes  # fmt: skip


def test_a_campaign_has_two_pictures(plotting, tmp_path):
    def fault(name, outcome):
        return {"fault": name, "outcome": outcome, "accused": [], "shows": True}

    faults = [fault("a", "right"), fault("a", "right"), fault("a", "missed"), fault("b", "late")]
    none = {"seed": 2, "length_s": 60.0, "handler_errors": 0, "cpu_s": 1.0}
    of_campaign.draw_pictures([row(faults=faults), none], tmp_path / "new")
    assert plotting.saved == ["survival.png", "faults.png"]
    assert (tmp_path / "new").is_dir()
    errors, wrong, nees = plotting.axes[0]
    shown = [(args[0][0], kwargs["label"]) for args, kwargs in errors.named("step")]
    assert shown == [
        (1.0, "heading, p50"), (2.0, "heading, p95"), (3.0, "heading, worst"),
        (1.0, "tilt, p50"), (2.0, "tilt, p95"), (3.0, "tilt, worst"),
    ]  # fmt: skip
    assert [args[0][0] for args, _ in wrong.named("step")] == [4.0, 5.0]
    assert [args[0][0] for args, _ in nees.named("step")] == [0.7, 0.8]
    assert (wrong.only("axvline"), nees.only("axvspan")) == (10.0, (0.3, 3.0))
    assert plotting.figures[0].only("suptitle") == "1 flights"
    bars = {
        kwargs["label"]: (args[0], args[1].tolist(), kwargs["left"])
        for args, kwargs in plotting.axes[1][0].named("barh")
    }
    assert list(bars) == ["right", "late", "undecided", "wrong", "missed"]
    assert bars["right"][:2] == (["a", "b"], [2.0, 0.0])
    assert bars["late"][1] == [0.0, 1.0]
    assert bars["missed"][1] == [1.0, 0.0]


# --- observer and paper ---------------------------------------------------------------------------


def test_the_observers_errors_are_drawn_by_exponent(plotting, tmp_path):
    t_s = np.arange(3.0)
    courses = {a1: SimpleNamespace(t_s=t_s, bias=a1 * t_s) for a1 in (1.0, 0.85)}
    assert of_observer.draw(tmp_path, courses) == tmp_path / "observer_convergence.png"
    ((axis,),) = plotting.axes
    drawn = {kwargs["label"]: args[1].tolist() for args, kwargs in axis.named("semilogy")}
    assert drawn == {"a1 = 1 (linear)": [0.0, 1.0, 2.0], "a1 = 0.85": [0.0, 0.85, 1.7]}
    assert (axis.only("set_xlim"), axis.only("set_ylim")) == ((0.0, 16.0), (1e-10, 30.0))
    assert axis.only("set_xlabel") == "time [s]"
    assert axis.only("set_ylabel") == "bias error [rad/s and m/s, six axes]"
    assert axis.named("grid")
    assert axis.named("legend")


def paper_trials():
    return of_paper.make_trials(
        of_paper.CASES[0]._replace(duration_s=0.1), of_paper.Assumptions(run_in_s=0.1), range(1)
    )


def test_a_case_shows_truth_and_sensors_from_where_it_is_scored(plotting):
    trials = paper_trials()
    of_paper._draw_motion(plotting, of_paper.CASES[0], trials, Path("m.png"))
    (rows,) = plotting.axes
    assert [axis.only("set_ylabel") for axis in rows] == [
        "true angle (deg)", "gyro (deg/s)", "force (m/s²)", "field (µT)",
    ]  # fmt: skip
    for axis, values, names in (
        (rows[0], trials.truth / DEG, ("roll", "pitch", "yaw")),
        (rows[1], trials.rate[0] / DEG, ("x", "y", "z")),
        (rows[2], trials.force[0], ("x", "y", "z")),
        (rows[3], trials.field[0], ("x", "y", "z")),
    ):
        for number, name in enumerate(names):
            t_s, drawn = axis.lines()[name]
            assert t_s == pytest.approx(0.01 * np.arange(11))
            assert drawn == pytest.approx(values[10:, number])
    assert plotting.figures[0].only("suptitle") == "Case I: truth and sensor data"


def test_a_case_shows_the_errors_of_both_filters(plotting, monkeypatch):
    trials = paper_trials()
    made = {
        name: lambda own, name=name, off=off: {name: np.tile(own.truth + off * DEG, (1, 1, 1))}
        for name, off in (("ekf_unit", 2.0), ("eh2_paper", -3.0))
    }
    monkeypatch.setattr(of_paper, "runners", lambda case: made)
    of_paper._draw_errors(plotting, of_paper.CASES[1], trials, Path("e.png"))
    (rows,) = plotting.axes
    for axis, angle in zip(rows, ("roll", "pitch", "yaw"), strict=True):
        assert axis.lines()["EKF, unit weights"][1] == pytest.approx(2.0)
        assert axis.lines()["extended H2"][1] == pytest.approx(-3.0)
        assert axis.only("set_ylabel") == f"{angle} error (deg)"
    assert plotting.figures[0].only("suptitle") == "Case II: estimation error"


def test_the_stable_region_is_drawn_over_two_angles_with_the_third_at_zero(plotting, monkeypatch):
    """Each point has the growth at its own attitude."""
    weights = np.array((1e-3, 1e-6, 1e-9))
    monkeypatch.setattr(
        of_paper, "spectral_abscissa", lambda L, vectors, angles: (angles / DEG + 200.0) @ weights
    )
    of_paper._draw_stable_region(plotting, of_paper.Assumptions(), Path("s.png"))
    order = {"roll": 0, "pitch": 1, "heading": 2}
    for axis in plotting.axes[0]:
        titles = axis.named("set")[0][1]
        across, up = (titles[f"{one}label"].removesuffix(" (deg)") for one in "xy")
        assert titles["title"] == f"{({*order} - {across, up}).pop()} 0"
        x, y, growth = axis.only("pcolormesh")
        for angle, values in ((across, x), (up, y)):
            end = 89.0 if angle == "pitch" else 180.0
            assert (values[0], values[-1]) == (-end, end)
        expected = (
            200.0 * weights.sum() + x[7] * weights[order[across]] + y[90] * weights[order[up]]
        )
        assert growth[90, 7] == pytest.approx(expected, rel=1e-12)
    assert plotting.saved == ["s.png"]
