"""Motors that change the field, and compasses that never measured: tables of just enough."""

import numpy as np
import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import CompassRows, Context, ImuTrack, Series
from h2nav.reviews.compass_motors import detect_strength, strength_by_throttle
from h2nav.reviews.dead_compass import dead_compasses, detect_dead

T_S = np.arange(0.0, 40.0, 0.2)
EARTH_UT = 50.0


def track(norm_ut):
    m_b_ut = np.outer(norm_ut, [0.6, 0.0, 0.8])
    rates = np.zeros((len(norm_ut), 3))
    t_s = T_S[: len(norm_ut)]
    return ImuTrack(1, "RAW_IMU", t_s, (1e6 * t_s).astype(np.int64), rates, rates, m_b_ut)


def flown(share, idle=60, loaded=80, load=0.5, idle_load=0.0, noise_ut=0.1):
    """A field that changes by a share at full throttle, with rows on the ground and in flight."""
    random = np.random.default_rng(1)
    throttle = np.repeat([idle_load, load], [idle, loaded])
    norm_ut = EARTH_UT * (1.0 + share * throttle) + random.normal(0.0, noise_ut, len(throttle))
    return track(norm_ut), Context(throttle=Series(T_S[: len(throttle)], throttle))


@pytest.mark.parametrize(
    ("share", "severity"),
    [
        (0.29, None),
        (0.31, Severity.NOTICE),
        (0.59, Severity.NOTICE),
        (0.61, Severity.WARNING),
        (-0.29, None),
        (-0.31, Severity.NOTICE),
        (-0.61, Severity.WARNING),
    ],
)
def test_what_is_usual_and_what_is_too_much(share, severity):
    found = detect_strength(*flown(share))
    assert [one.severity for one in found] == ([] if severity is None else [severity])
    for one in found:
        assert one.kind is Kind.COMPASS_MOTORS
        assert one.sensor.number == 2
        assert one.size == pytest.approx(10.0 * EARTH_UT * abs(share), rel=0.02)
        assert (one.from_s, one.to_s) == (0.0, pytest.approx(27.8))


@pytest.mark.parametrize(
    ("changes", "is_known"),
    [
        ({}, True),
        ({"idle": 30}, True),
        ({"idle": 29}, False),
        ({"loaded": 50}, True),
        ({"loaded": 49}, False),
        ({"load": 0.31}, True),
        ({"load": 0.29}, False),
        ({"idle_load": 0.049}, True),
        ({"idle_load": 0.051}, False),
        ({"noise_ut": 8.0}, False),  # the throttle does not show in it
        ({"share": 0.0}, False),
    ],
)
def test_it_takes_rows_without_and_with_load(changes, is_known):
    found = strength_by_throttle(*flown(**({"share": 0.4} | changes)))
    assert (found is not None) == is_known
    if found:
        assert found.idle_ut == pytest.approx(EARTH_UT, rel=0.05)
        assert found.share == pytest.approx(0.4, rel=0.12)
        assert found.loaded_ut > found.idle_ut


def test_the_change_is_beyond_the_scatter_on_the_ground():
    norm_ut = np.concatenate((np.tile([49.0, 51.0], 30), np.full(80, 54.0)))
    _, context = flown(0.4)
    assert strength_by_throttle(track(norm_ut), context) is None
    norm_ut[60:] = 55.0
    assert strength_by_throttle(track(norm_ut), context) is not None


def test_without_a_throttle_or_a_field_nothing_is_known():
    known, context = flown(0.4)
    one = Series(T_S[:1], T_S[:1])
    for throttle in (None, one):
        assert strength_by_throttle(known, Context(throttle=throttle)) is None
    unknown = known._replace(m_b_ut=np.full_like(known.m_b_ut, np.nan))
    assert strength_by_throttle(unknown, context) is None
    assert detect_strength(unknown, context) == []
    assert detect_strength(track(np.full(140, EARTH_UT)), context) == []


FROZEN = CompassRows(0, 1.0, 6.0, 50, 0, is_zero=False, is_used=True)


@pytest.mark.parametrize(
    ("changes", "is_dead"),
    [
        ({}, True),
        ({"rows": 49}, False),
        ({"changes": 1}, False),
        ({"to_s": 5.9}, False),
    ],
)
def test_a_value_that_stays_for_so_many_rows_is_no_measurement(changes, is_dead):
    context = Context(compass_rows=(FROZEN._replace(**changes),))
    assert bool(dead_compasses(context)) == is_dead


@pytest.mark.parametrize(
    ("turned_deg", "is_zero", "is_dead"),
    [(4.0, False, False), (6.0, False, True), (-6.0, False, True), (0.0, True, True)],
)
def test_a_field_stays_the_same_while_nothing_turns(turned_deg, is_zero, is_dead):
    """A gyro with a constant bias; it turns about one axis, for a third of the time."""
    t_s = 0.02 * np.arange(300)
    w_b = np.zeros((300, 3)) + 3.0 * DEG
    w_b[100:200, 1] += turned_deg * DEG / 2.0
    stamp_us = (1e6 * t_s).astype(np.int64)
    imu = ImuTrack(0, "IMU", t_s, stamp_us, w_b, np.zeros((300, 3)), np.zeros((300, 3)))
    one = FROZEN._replace(from_s=0.0, to_s=6.0, is_zero=is_zero)
    assert bool(dead_compasses(Context(compass_rows=(one,), imus=(imu,)))) == is_dead


@pytest.mark.parametrize(
    ("is_zero", "is_used", "text", "use", "severity"),
    [
        (True, True, "nothing but zeros", "is set to use it", Severity.ERROR),
        (False, False, "one and the same field", "does not use it", Severity.NOTICE),
    ],
)
def test_what_a_dead_compass_showed(is_zero, is_used, text, use, severity):
    (found,) = detect_dead([FROZEN._replace(is_zero=is_zero, is_used=is_used)])
    assert found.text == f"the compass showed {text}"
    assert found.evidence == (
        f"50 rows without a change, from the first to the last; the autopilot {use}"
    )
    assert (found.severity, found.sensor.number) == (severity, 1)
    assert (found.from_s, found.to_s, found.size, found.unit) == (1.0, 6.0, 5.0, "s")
