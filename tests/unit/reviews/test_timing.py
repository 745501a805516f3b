"""Samples that are missing, twice, late, or stamped by a clock that drifts."""

import numpy as np
import pytest
from reviewed_flights import flight, with_imu

from h2nav.integrity.findings import Finding, Severity
from h2nav.recordings.context import ImuTrack
from h2nav.reviews.analysis import analyse
from h2nav.reviews.flight import Flight


def kept(track: ImuTrack, rows: np.ndarray) -> dict[str, np.ndarray]:
    names = ("t_s", "stamp_us", "w_b", "f_b", "m_b_ut")
    return {name: getattr(track, name)[rows] for name in names}


def only(flown: Flight) -> Finding:
    (finding,) = analyse(flown).findings
    return finding


def test_missing_samples_are_counted_and_measured():
    flown = flight()
    first = flown.context.imus[0]
    rows = (first.t_s < 50.0) | (first.t_s >= 50.4)
    rows &= (first.t_s < 70.0) | (first.t_s >= 70.2)
    finding = only(with_imu(flown, **kept(first, rows)))
    assert finding.kind == "imu_gaps"
    assert finding.size == pytest.approx(0.41, abs=0.02)
    assert finding.from_s == pytest.approx(50.0, abs=0.05)
    assert "2 gaps" in finding.text
    assert finding.severity is Severity.NOTICE


def test_a_second_without_samples_is_a_warning():
    flown = flight()
    first = flown.context.imus[0]
    finding = only(with_imu(flown, **kept(first, (first.t_s < 50.0) | (first.t_s > 51.2))))
    assert (finding.kind, finding.severity) == ("imu_gaps", Severity.WARNING)


def test_a_log_that_pauses_blames_no_sensor():
    flown = flight()._replace(kind="dataflash")
    context = flown.context

    def rest(t_s: np.ndarray) -> np.ndarray:
        return (t_s < 40.0) | (t_s > 60.0)

    paused = with_imu(flown, **kept(context.imus[0], rest(context.imus[0].t_s)))
    attitudes = tuple(
        track._replace(t_s=track.t_s[rest(track.t_s)], q_nb=track.q_nb[rest(track.t_s)])
        for track in context.attitudes
    )
    gps = tuple(track.part(rest(track.t_s)) for track in context.gps)
    found = paused._replace(context=paused.context._replace(attitudes=attitudes, gps=gps))
    finding = only(found)
    assert (finding.kind, finding.severity) == ("log_paused", Severity.INFO)
    assert finding.size == pytest.approx(20.0, abs=0.1)
    # What a ground station does not get was lost on its link.
    assert "imu_gaps" in {f.kind for f in analyse(found._replace(kind="tlog")).findings}


def test_samples_that_come_twice_are_told():
    flown = flight()
    first = flown.context.imus[0]
    rows = np.sort(np.concatenate((np.arange(len(first.t_s)), np.arange(0, len(first.t_s), 10))))
    finding = only(with_imu(flown, **kept(first, rows)))
    assert finding.kind == "imu_twice"
    assert finding.size == pytest.approx(9.1, abs=0.2)


@pytest.mark.parametrize("jump_s", [3.0, -0.6])
def test_a_clock_that_is_set_loses_no_samples(jump_s):
    flown = flight()
    first = flown.context.imus[0]
    stamps = first.stamp_us + np.where(first.t_s >= 50.0, round(jump_s * 1e6), 0)
    finding = only(with_imu(flown, stamp_us=stamps))
    assert (finding.kind, finding.severity) == ("clock_jump", Severity.WARNING)
    assert f"jumped by {jump_s:+.2f} s" in finding.text
    assert finding.from_s == pytest.approx(50.0, abs=0.05)


def test_a_link_that_held_samples_back_set_no_clock():
    flown = flight()
    first = flown.context.imus[0]
    held = (first.t_s > 50.0) & (first.t_s < 51.0)
    arrived = np.where(held, 51.0, first.t_s)
    # Some of them it lost.
    rows = ~((first.t_s > 50.3) & (first.t_s < 50.8))
    changed = {**kept(first, rows), "t_s": arrived[rows]}
    kinds = {f.kind for f in analyse(with_imu(flown, **changed)).findings}
    assert kinds == {"imu_gaps", "late_bursts"}


def test_a_stamp_clock_that_drifts_is_measured():
    flown = flight()
    first = flown.context.imus[0]
    stamps = np.round(first.stamp_us * (1.0 + 600e-6)).astype(np.int64)
    finding = only(with_imu(flown, stamp_us=stamps))
    assert finding.kind == "clock_drift"
    assert finding.size == pytest.approx(600.0, abs=5.0)
    assert "fast" in finding.text


def test_two_good_clocks_with_jitter_are_not_complained_of():
    flown = flight()
    first = flown.context.imus[0]
    late = np.random.default_rng(4).exponential(0.004, len(first.t_s))
    t_s = np.maximum.accumulate(first.t_s + late)
    stamps = np.round(first.stamp_us * (1.0 - 40e-6)).astype(np.int64)
    assert not analyse(with_imu(flown, t_s=t_s, stamp_us=stamps)).findings


def test_bursts_that_a_link_held_back_are_told_and_are_no_gaps():
    flown = flight()
    first = flown.context.imus[0]
    t_s = first.t_s.copy()
    for begin in (30.0, 60.0, 90.0):
        held = (t_s > begin) & (t_s < begin + 0.5)
        t_s[held] = begin + 0.5
    finding = only(with_imu(flown, t_s=t_s))
    assert finding.kind == "late_bursts"
    assert finding.size == pytest.approx(0.49, abs=0.02)
    assert "3 bursts" in finding.evidence


def test_slow_recordings_say_so():
    flown = flight()
    first = flown.context.imus[0]
    seldom = with_imu(flown, **kept(first, np.arange(0, len(first.t_s), 10)))
    kinds = {f.kind for f in analyse(seldom._replace(kind="tlog")).findings}
    assert "imu_slow" in kinds
    assert "imu_too_slow" not in kinds


def test_an_autopilots_own_log_that_aliases_names_the_setting():
    flown = flight(parameters={"LOG_BITMASK": 176126.0})
    first = flown.context.imus[0]
    seldom = with_imu(flown, **kept(first, np.arange(0, len(first.t_s), 4)))
    (found,) = [f for f in analyse(seldom).findings if f.kind == "imu_too_slow"]
    assert found.size == pytest.approx(25.0, abs=0.5)
    assert "LOG_BITMASK 700414 (now 176126)" in found.evidence


def test_the_picture_shows_rate_and_gap():
    flown = flight()
    first = flown.context.imus[0]
    rows = (first.t_s < 50.0) | (first.t_s >= 52.0)
    timing = analyse(with_imu(flown, **kept(first, rows))).timings[0]
    assert len(timing.t_s) <= 1000
    assert np.median(timing.rate_hz) == pytest.approx(100.0, abs=3.0)
    assert np.nanmax(timing.longest_s) == pytest.approx(2.01, abs=0.02)
    assert np.isnan(timing.longest_s[(timing.t_s > 50.6) & (timing.t_s < 51.4)]).all()
    assert np.isnan(timing.lateness_s).all()
