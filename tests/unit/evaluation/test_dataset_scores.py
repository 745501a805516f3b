"""Scores of filters on made trials, what a trial takes from a recording, and what holds a gap."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.attitude.samples import EarthField, VehicleState, VelocityFix
from h2nav.errors import BadInput, TaskFailed
from h2nav.evaluation.dataset import filters, scores
from h2nav.evaluation.dataset.filters import Conditions, FilterTrack, held, to_true_north
from h2nav.evaluation.dataset.recorded import trial_of
from h2nav.evaluation.dataset.scores import TrialScore, TrialTask, score_task, summary
from h2nav.maths.attitude_errors import Rms
from h2nav.maths.units import DEG
from h2nav.recordings.reference import Pairs
from h2nav.recordings.trials import FilterInput, Trial

LEVEL = (1.0, 0.0, 0.0, 0.0)


def turned(deg):
    return (math.cos(0.5 * deg * DEG), 0.0, 0.0, math.sin(0.5 * deg * DEG))


def trial(truth=True, **changes):
    zeros = np.zeros((4, 3))
    own = Trial(
        name="t", rate_hz=100.0, t_us=np.arange(4) * 10_000, w_s=zeros, f_s=zeros, m_s=None,
        q_es=np.tile(LEVEL, (4, 1)) if truth else None, mask=np.array([False, True, True, True]),
        heading_fixed=True, gps=None, clipped=None, notes=("a note",),
    )  # fmt: skip
    return own._replace(**changes)


def scored(monkeypatch, run, own):
    monkeypatch.setattr(scores, "installed", lambda: {"mine": run})
    task = TrialTask(Path("t.npz"), lambda _: own, "t", "mine", Conditions("multirotor"))
    return score_task(task)


def test_a_score_is_of_the_masked_rows(monkeypatch):
    q_es = np.array([turned(90.0), turned(3.0), turned(-4.0), turned(0.0)])
    found = scored(monkeypatch, lambda *_: FilterTrack(q_es, 7.5, "native"), trial())
    expected = math.sqrt(25.0 / 3.0)
    assert found == TrialScore(
        "t", "mine", Rms(*map(pytest.approx, (expected, expected, 0.0))), 7.5, "native", "", False,
        ("a note",),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("own", "error", "remark", "is_bad_input"),
    [
        (trial(truth=False), None, "t.npz: no truth: key q of an .npz, or SIMSTATE or", True),
        (trial(mask=np.zeros(4, bool)), None, "t.npz: no truth: ", True),
        (trial(), BadInput("t.npz: gone"), "t.npz: gone", True),
        (trial(), TaskFailed("never aligned"), "never aligned", False),
        (trial(), None, "it gave attitudes that are not finite", False),
    ],
)
def test_what_cannot_be_scored_says_why(monkeypatch, own, error, remark, is_bad_input):
    def run(*_):
        if error is not None:
            raise error
        return FilterTrack(np.full((4, 4), np.nan), 1.0, "python")

    found = scored(monkeypatch, run, own)
    assert found.remark.startswith(remark)
    assert (found.is_bad_input, found.rms_deg, found.notes) == (is_bad_input, None, ())


def test_a_summary_is_of_the_trials_that_a_filter_did():
    every = [
        TrialScore("a", "mine", Rms(1.0, 2.0, 3.0), 10.0, "native"),
        TrialScore("b", "mine", Rms(2.0, 4.0, 9.0), 20.0, "python"),
        TrialScore("c", "mine", remark="no truth"),
        TrialScore("a", "other", Rms(9.0, 9.0, 9.0), 90.0, "native"),
    ]
    found = summary(every, "mine")
    assert list(found["trials"]) == ["a", "b"]
    assert found["mean"] == {"total": 1.5, "heading": 3.0, "inclination": 6.0}
    assert (found["us_per_sample"], found["backend"]) == (15.0, "native, python")
    nothing = {"trials": {}, "mean": {}, "us_per_sample": 0.0, "backend": ""}
    assert summary(every, "third") == nothing


@pytest.mark.parametrize(
    ("known", "rows"),
    [
        ([True, True], [0, 1]),
        ([False, True, False, False, True], [1, 1, 1, 1, 4]),
        ([True, False], [0, 0]),
    ],
)
def test_a_gap_is_filled_with_what_was_before_and_the_beginning_with_what_came_first(known, rows):
    assert filters._latest(np.array(known)).tolist() == rows


def test_a_field_is_held():
    field = np.array([(np.nan, 1.0, 2.0), (3.0, 4.0, 5.0), (6.0, np.inf, 7.0), (8.0, 9.0, 10.0)])
    first, last = [3.0, 4.0, 5.0], [8.0, 9.0, 10.0]
    assert held(field).tolist() == [first, first, first, last]
    assert not held(field[:1]).any()


def test_magnetic_east_north_up_is_turned_to_the_true_one():
    """By 10 deg to the east: who faces magnetic east faces 10 deg south of east."""
    facing = to_true_north(np.array([LEVEL]), 10.0 * DEG)[0]
    assert facing == pytest.approx(turned(-10.0))


def test_velocities_of_gps_rows_are_in_order_and_from_the_truths_north():
    gps = np.array([(0.02, 5.0, 90.0, 0.0), (0.005, 4.0, 20.0, 0.0), (0.03, np.nan, 0.0, 0.0)])
    own = trial(gps=gps, inputs=())
    conditions = Conditions("multirotor", use_gps=True, declination_deg=-10.0)
    first, second = filters._inputs(own, conditions)
    assert (first.row, first.what.t_us) == (1, 5_000)
    assert first.what.v_n[:2] == pytest.approx((4.0 * math.cos(30 * DEG), 2.0))
    assert math.isnan(first.what.v_n[2])
    assert (second.row, second.what.t_us) == (2, 20_000)
    assert second.what.v_n[:2] == pytest.approx((-5.0 * math.sin(10 * DEG), 5 * math.cos(10 * DEG)))
    fix = FilterInput(1, VelocityFix(7, (1.0, 2.0, 3.0), 0.5))
    state = FilterInput(0, VehicleState(on_ground=False))
    mine = trial(inputs=(state, fix))
    assert filters._inputs(mine, Conditions("multirotor")) == [state]
    assert filters._inputs(mine, Conditions("multirotor", use_gps=True)) == [state, fix]
    with pytest.raises(TaskFailed, match="t: no gps rows, but --gps was given"):
        filters._inputs(trial(inputs=(state,)), Conditions("multirotor", use_gps=True))


# --- recordings -----------------------------------------------------------------------------------


class Stretch(SimpleNamespace):
    def __len__(self):
        return len(self.arrived_us)


def stretch(count=3, inputs=(), clipped=False, field=True):
    ones = np.ones((count, 3))
    samples = SimpleNamespace(
        t_us=5_000_000 + 10_000 * np.arange(count),
        mag=ones if field else np.full((count, 3), np.nan),
        gyr=0.1 * ones, acc=9.8 * ones, clipped=np.full(count, clipped),
    )  # fmt: skip
    return Stretch(arrived_us=np.arange(count), samples=samples, inputs=inputs)


def recorded(*stretches, reference="SIMSTATE", rows=(0, 2)):
    def pairs(arrived_us, boot_us):
        angles = np.tile((0.0, 0.0, 90.0 * DEG), (len(rows), 1))
        return Pairs(reference, np.array(rows, dtype=int), angles)

    listener = SimpleNamespace(stretches=list(stretches))
    return trial_of(Path("a/flight.tlog"), listener, SimpleNamespace(pairs=pairs))


def test_a_trial_is_the_longest_stretch_on_its_own_clock():
    field = EarthField(50.0, 1.0, 0.05)
    inputs = (
        FilterInput(0, EarthField(50.0, 1.0, 0.01)),
        FilterInput(1, VelocityFix(5_004_000, (1.0, 0.0, 0.0), 0.3)),
        FilterInput(2, field),
    )
    found = recorded(stretch(2), stretch(3, inputs), stretch(0))
    assert (found.name, found.heading_fixed, found.gps) == ("flight", True, None)
    assert found.t_us.tolist() == [0, 10_000, 20_000]
    assert found.mask.tolist() == [True, False, True]
    # an upright sensor whose nose points east
    assert found.q_es[0] == pytest.approx((0.0, 1.0, 0.0, 0.0))
    assert found.declination_rad == 0.05
    assert [given.what for given in found.inputs] == [
        inputs[0].what, VelocityFix(4_000, (1.0, 0.0, 0.0), 0.3), field,
    ]  # fmt: skip
    assert found.clipped is None
    assert found.notes == (
        "against SIMSTATE",
        "the autopilot's clock began anew 1 times; the longest stretch, 3 of 5 samples, is scored",
    )


def test_a_trial_says_what_its_errors_mean():
    found = recorded(stretch(2, clipped=True, field=False), reference="ATTITUDE", rows=(1,))
    assert found.notes == (
        "against ATTITUDE, the autopilot's own estimate: no truth",
        "no position, so no declination: our headings are against magnetic north",
    )
    assert (found.m_s, found.declination_rad) == (None, 0.0)
    assert found.clipped.all()
    alone = recorded(
        stretch(2, (FilterInput(0, EarthField(50.0, 1.0, 0.0)),)), reference="", rows=()
    )
    assert alone.q_es is None
    assert not alone.mask.any()
    assert alone.notes == ()


def test_a_recording_without_two_samples_is_refused():
    with pytest.raises(BadInput, match=r"a/flight\.tlog: no IMU samples of a known"):
        recorded(stretch(1), rows=())


# --- the paper's filter on a trial ----------------------------------------------------------------


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_papers_filter_takes_sensors_whose_z_points_up_or_down(up):
    """It keeps what it starts from, and where it has lost itself it says level and north."""
    count = 4
    f_s = np.tile((0.0, 0.0, 9.8 * up), (count, 1))
    m_s = np.tile((20.0, 0.0, -43.0 * up), (count, 1))
    own = trial(f_s=f_s, m_s=m_s, w_s=np.zeros((count, 3)))
    track = filters.run_paper(own, Conditions("multirotor"))
    nose_east = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    right_down = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)
    expected = nose_east if up > 0.0 else right_down
    assert np.abs(track.q_es @ expected) == pytest.approx(1.0, abs=1e-6)
    assert (track.backend, len(track.q_es)) == ("python", count)
    lost = own._replace(w_s=np.full((count, 3), np.nan))
    found = filters.run_paper(lost, Conditions("multirotor"))
    assert np.abs(found.q_es[2:] @ expected) == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(TaskFailed, match="t: the paper's filter needs a magnetometer"):
        filters.run_paper(own._replace(m_s=None), Conditions("multirotor"))
