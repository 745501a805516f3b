"""Whole flights without a fault give no finding, whatever they lack."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, imu_track
from reviewed_flights import flight, ideal

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import DEG
from h2nav.recordings.context import Context
from h2nav.reviews import evidence as parts
from h2nav.reviews.analysis import _of_slow_samples, analyse
from h2nav.reviews.gathering import all_findings
from h2nav.reviews.inertial import exponential, turns


@pytest.mark.parametrize(
    ("name", "seed"),
    [("flight", 1), ("aggressive", 2), ("hover", 3), ("spin", 4), ("loop", 5), ("square", 6)],
)
def test_a_flight_without_a_fault_gives_no_finding(name, seed):
    assert not analyse(flight(name, imus=3, seed=seed)).findings


def test_samples_without_times_of_arrival_are_looked_at_by_their_stamps():
    flown = flight()._replace(kind="bytes")
    track = flown.context.imus[0]
    odd = track._replace(t_s=np.linspace(0.0, 10.0, len(track.t_s)))
    analysis = analyse(flown._replace(context=flown.context._replace(imus=(odd,))))
    assert not analysis.findings
    assert not analysis.receivers
    assert np.median(analysis.timings[0].rate_hz) == pytest.approx(100.0, abs=2.0)


def test_what_three_compasses_show_alike_is_told_once():
    flown = flight(imus=3)
    tracks = tuple(
        t._replace(m_b_ut=t.m_b_ut + np.array([10.0, -8.0, 5.0])) for t in flown.context.imus
    )
    flown = flown._replace(context=flown.context._replace(imus=tracks))
    (found,) = all_findings(flown, analyse(flown))
    assert (found.kind, found.source) == ("compass_hard_iron", "compass 1, compass 2, compass 3")
    assert (found.id, found.sensor.number) == ("compass_hard_iron.compass1_2_3.1", 1)
    assert all(f"; compass {number}" in found.evidence for number in (2, 3))


def test_an_empty_recording_gives_nothing():
    empty = flight()._replace(context=Context(), estimates=None)
    analysis = analyse(empty)
    assert not analysis.findings
    assert not analysis.spectra


def test_samples_that_are_no_numbers_are_left_out():
    flown = flight(imus=2)
    tracks = list(flown.context.imus)
    tracks[1].w_b[100:200] = np.nan
    tracks[0].f_b[5000:5002] = 0.0
    analysis = analyse(flown._replace(context=flown.context._replace(imus=tuple(tracks))))
    assert {f.kind for f in analysis.findings} <= {"imu_gaps"}
    assert np.isfinite(analysis.vibrations[1].level).all()


def test_an_imu_of_one_sample_is_looked_past():
    flown = flight(imus=2)
    second = flown.context.imus[1]
    short = second._replace(
        t_s=second.t_s[:1],
        stamp_us=second.stamp_us[:1],
        w_b=second.w_b[:1],
        f_b=second.f_b[:1],
        m_b_ut=second.m_b_ut[:1],
    )
    context = flown.context._replace(imus=(flown.context.imus[0], short))
    assert not analyse(flown._replace(context=context)).findings


@pytest.mark.parametrize("count", [0, 1, 2, 3, 30])
@pytest.mark.parametrize("place", [0, 5000])
def test_scraps_of_a_flight_are_looked_at_without_a_finding(count, place):
    flown = flight()
    part = slice(place, place + count)
    names = ("t_s", "stamp_us", "w_b", "f_b", "m_b_ut")
    first = flown.context.imus[0]
    scrap = first._replace(**{name: getattr(first, name)[part] for name in names})
    gps = flown.context.gps[0]
    few = gps.part(slice(count))
    assert flown.estimates is not None
    seen = type(flown.estimates)(*(values[part] for values in flown.estimates))
    context = flown.context._replace(imus=(scrap,), gps=(few,), attitudes=(), armed=())
    found = analyse(flown._replace(context=context, estimates=seen)).findings
    assert not found


def test_turns_are_the_product_of_the_samples_turns():
    truth = ideal("aggressive")
    t_s = truth.t_us * 1e-6
    edges = np.array([10.0, 10.003, 10.1, 11.37, 30.0])
    found = turns(t_s, truth.w_b, edges)
    place = np.searchsorted(t_s, edges, side="right")
    for number in range(len(edges) - 1):
        q = np.array([[1.0, 0.0, 0.0, 0.0]])
        for row in range(place[number], place[number + 1]):
            q = product(q, exponential(truth.w_b[row : row + 1] * 0.01))
        np.testing.assert_allclose(found[number], q[0], atol=1e-9)


@pytest.mark.parametrize(("kind", "unit"), [
    (Kind.GYRO_BIAS_STEP, DEG), (Kind.ACCELEROMETER_BIAS_STEP, 1.0),
])  # fmt: skip
@pytest.mark.parametrize(
    ("step", "size", "usual", "is_shown"),
    [
        # four times the usual change
        (4.1, 4.1, 1.0, True),
        (3.9, 3.9, 1.0, False),
        (-4.1, 4.1, 1.0, True),
        # half of what is said
        (4.1, 8.1, 0.0, True),
        (4.1, 8.3, 0.0, False),
        (0.0, 4.1, 0.0, False),
    ],
)
def test_a_step_that_another_imu_shows_is_no_error_of_ours_by_slow_samples(
    kind, unit, step, size, usual, is_shown
):
    """What they differ by changes by `usual` every 3.5 s, and in the end by the step alone."""
    t_s = np.arange(0.0, 100.0, 0.1)
    apart = usual * (np.floor(t_s / 3.5) % 2.0)
    apart[t_s >= 80.0] = 0.0
    apart[t_s >= 90.0] = step
    values = unit * np.outer(apart, (0.0, 1.0, 0.0))
    values = {"w_b": values} if kind is Kind.GYRO_BIAS_STEP else {"f_b": values}
    tracks = imu_track(t_s, **values), imu_track(t_s)._replace(imu=1)
    one = Finding(kind, Sensor(SensorKind.IMU, 1), Severity.WARNING, 90.0, 99.0, size, "", "", "")
    evidence = KnownEvidence({parts.rate_hz: 10.0, parts.sampled: tracks})
    evidence.flight = SimpleNamespace(findings=(one,))
    assert _of_slow_samples(evidence) == ([] if is_shown else [one])
