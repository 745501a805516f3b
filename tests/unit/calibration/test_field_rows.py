"""Headings flown, the earth's field over time, levers; and what a recording says of its sensors."""

import math

import numpy as np
import pytest

from h2nav.calibration.evidence import series_at, with_velocity
from h2nav.calibration.field_fit import FieldRows
from h2nav.calibration.field_rows import (
    SECTORS,
    earth_at,
    field_rows,
    headings_flown,
    lever_of,
    widest_gap_deg,
)
from h2nav.calibration.settings import Lever, ardupilot_compass
from h2nav.maths.units import DEG
from h2nav.recordings.context import CompassTrack, Context, GpsTrack, Series, Span
from h2nav.reviews.flight import EarthFields, Estimates
from tests.unit.calibration.logs import evidence_of_log, imu_track

NOTHING = np.zeros(0)


def rows_of(heading_deg, **columns):
    count, nothing = len(heading_deg), np.zeros((len(heading_deg), 3))
    return FieldRows(
        np.zeros(count, np.int64), 0.2 * np.arange(count), nothing, nothing, nothing, nothing,
        np.radians(heading_deg), *np.full((3, count), np.nan),
    )._replace(**columns)  # fmt: skip


@pytest.mark.parametrize(
    ("heading_deg", "rows", "sector"),
    [(0.1, 5, 0), (0.1, 4, None), (22.4, 5, 0), (22.6, 5, 1), (-0.1, 5, 15), (359.9, 5, 15)],
)
def test_a_sector_is_flown_for_a_second_at_least(heading_deg, rows, sector):
    flown = headings_flown(rows_of([heading_deg] * rows))
    assert flown.shape == (16,)
    assert np.flatnonzero(flown).tolist() == ([] if sector is None else [sector])


@pytest.mark.parametrize(
    ("flown", "gap_deg"),
    [
        ((), 360.0),
        ((3,), 337.5),
        ((0, 8), 157.5),
        ((0, 1, 2, 3, 4, 5, 6, 7), 180.0),
        ((4, 12, 15), 157.5),
        (range(16), 0.0),
    ],
)
def test_the_widest_gap_goes_around_north_too(flown, gap_deg):
    mask = np.isin(np.arange(SECTORS), list(flown))
    assert widest_gap_deg(mask) == gap_deg


def test_the_earths_field_is_that_of_the_last_place_before():
    earth = EarthFields(
        np.array([10.0, 20.0]), np.array([50.0, 40.0]), np.array([60.0, -30.0]) * DEG,
        np.array([90.0, -45.0]) * DEG,
    )  # fmt: skip
    late = np.array((20.0 * math.sqrt(1.5), -20.0 * math.sqrt(1.5), -20.0))
    early = np.array((0.0, 25.0, 50.0 * math.sqrt(0.75)))
    found = earth_at(earth, np.array([0.0, 10.0, 19.99, 20.0, 99.0]))
    assert found == pytest.approx(np.array((early, early, early, late, late)))


def test_a_lever_that_is_unknown_is_none():
    rows = rows_of(
        [0.0] * 3, throttle=np.array([0.3, np.nan, 0.5]), current_a=np.array([np.nan, 8.0, 9.0])
    )
    assert lever_of(rows, Lever.NONE).tolist() == [0.0] * 3
    assert lever_of(rows, Lever.THROTTLE).tolist() == [0.3, 0.0, 0.5]
    assert lever_of(rows, Lever.CURRENT).tolist() == [0.0, 8.0, 9.0]


def test_a_series_is_interpolated_between_what_was_recorded_and_unknown_beyond():
    series = Series(np.array([0.0, 1.0, 2.0, 4.0]), np.array([1.0, np.nan, 3.0, 7.0]))
    found = series_at(series, np.array([-0.1, 0.0, 1.0, 3.0, 4.0, 4.1]))
    assert found == pytest.approx([np.nan, 1.0, 2.0, 5.0, 7.0, np.nan], nan_ok=True)
    assert np.isnan(series_at(None, np.zeros(2))).tolist() == [True, True]
    one = Series(np.array([0.0, 1.0]), np.array([1.0, np.nan]))
    assert np.isnan(series_at(one, np.zeros(2))).tolist() == [True, True]


def fixes(v_n, has_fix=True):
    v_n = np.array(v_n, dtype=float)
    zeros = np.zeros(len(v_n))
    return GpsTrack(0, zeros, zeros == (0.0 if has_fix else 1.0), *[zeros] * 3, v_n, zeros, zeros)


def test_a_receiver_counts_from_its_second_fix_with_a_level_velocity():
    still, unknown, level = (0.0, 0.0, 0.0), (0.0, np.nan, 0.0), (1.0, 2.0, np.nan)
    assert with_velocity(fixes([still, unknown, level])).tolist() == [True, False, True]
    assert not with_velocity(fixes([still], has_fix=False)).any()
    one, two = fixes([still, unknown]), fixes([still, level])
    both = evidence_of_log(Context(gps=(one, two)), {})
    assert both.gps is two
    assert evidence_of_log(Context(gps=(one,)), {}).gps is None


@pytest.mark.parametrize(
    ("kind", "firmware", "autopilot", "is_log"),
    [
        ("dataflash", "ArduCopter V4.5", "ArduPilot", True),
        ("ulog", "", "PX4", True),
        ("tlog", "PX4 v1.15", "PX4", False),
        ("tlog", "", "ArduPilot", False),
    ],
)
def test_the_make_of_an_autopilot_and_whether_it_wrote_the_log(kind, firmware, autopilot, is_log):
    evidence = evidence_of_log(Context(firmware=firmware), {}, kind=kind)
    assert (evidence.autopilot, evidence.is_log) == (autopilot, is_log)


@pytest.mark.parametrize(
    ("kind", "source", "is_raw"),
    [
        ("ulog", "SCALED_IMU", True),
        ("ulog", "HIGHRES_IMU", False),
        ("dataflash", "SCALED_IMU", False),
    ],
)
def test_a_field_is_raw_in_scaled_messages_of_px4_alone(kind, source, is_raw):
    track = imu_track(np.zeros((4, 3)), np.zeros((4, 3)), source=source)
    m_b_ut = np.array([(1.0, 2.0, 3.0), (np.nan,) * 3, (4.0, 5.0, np.nan), (7.0, 8.0, 9.0)])
    evidence = evidence_of_log(Context(imus=(track._replace(m_b_ut=m_b_ut),)), {}, kind=kind)
    assert evidence.is_raw(0) is is_raw
    assert not evidence.is_raw(1)
    (compass,) = evidence.compasses()
    assert compass.t_s.tolist() == [0.0, 0.03]
    assert compass.m_b_ut.tolist() == [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]
    own = evidence._replace(
        flight=evidence.flight._replace(context=evidence.context._replace(compasses=(compass,)))
    )
    assert not own.is_raw(0)


# --- rows of a flight ---------------------------------------------------------------------------

RAW_UT = np.array((20.0, 5.0, 43.0))
EARTH = EarthFields(np.zeros(1), np.full(1, 50.0), np.full(1, 60.0 * DEG), np.zeros(1))


def flight(seconds=4.0, *, tilt_deg=1.0, rate_deg_s=0.0, armed=(), **parameters):
    """Level, to the east."""
    t_s = np.arange(0.0, seconds, 0.05)
    q_nb = np.tile((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), (len(t_s), 1))
    sigma = np.full(len(t_s), tilt_deg * DEG)
    free = Estimates(t_s, q_nb, np.zeros((len(t_s), 3)), sigma, np.full(len(t_s), np.nan))
    nothing = np.full((len(t_s), 3), np.nan)
    own = ardupilot_compass(parameters, 0)
    shown = RAW_UT if own is None else own.correction.corrected(RAW_UT[None], np.full(1, 0.4))
    track = CompassTrack(0, 0, t_s, np.tile(shown, (len(t_s), 1)), nothing, nothing)
    w_b = np.zeros((len(t_s), 3))
    w_b[:, 2] = rate_deg_s * DEG
    context = Context(
        imus=(imu_track(w_b, w_b, rate_hz=20.0),),
        compasses=(track,),
        armed=armed,
        throttle=Series(np.array([0.0, seconds]), np.array([0.4, 0.4])),
    )
    evidence = evidence_of_log(context, parameters, free=free)
    flown = evidence.flight._replace(earth=EARTH)
    return evidence._replace(flight=flown), track, own


IN_USE = {
    **{f"COMPASS_OFS_{axis}": v for axis, v in zip("XYZ", (30.0, -45.0, 12.0), strict=True)},
    **{f"COMPASS_DIA_{axis}": v for axis, v in zip("XYZ", (1.1, 0.9, 1.0), strict=True)},
    **{f"COMPASS_MOT_{axis}": v for axis, v in zip("XYZ", (90.0, 20.0, -30.0), strict=True)},
    "COMPASS_MOTCT": 1.0,
}


@pytest.mark.parametrize("parameters", [{}, IN_USE], ids=["unknown", "calibrated"])
def test_rows_have_the_raw_field_and_the_earths_in_the_axes_of_the_board(parameters):
    evidence, track, own = flight(**parameters)
    rows = field_rows(evidence, track, own, 3)
    assert rows.flight.tolist() == [3] * len(rows.t_s)
    assert np.diff(rows.t_s) == pytest.approx(0.2)
    assert rows.raw_ut == pytest.approx(np.tile(RAW_UT, (len(rows.t_s), 1)))
    # 25 uT to the north are to the left of a vehicle that heads east
    expected = (0.0, -25.0, 50.0 * math.sqrt(0.75))
    assert rows.earth_ut == pytest.approx(np.tile(expected, (len(rows.t_s), 1)), abs=1e-9)
    assert rows.down == pytest.approx(np.tile((0.0, 0.0, 1.0), (len(rows.t_s), 1)), abs=1e-9)
    assert rows.heading_rad == pytest.approx(0.5 * math.pi)
    assert np.isinf(rows.sigma_rad).all()  # unknown
    assert rows.throttle == pytest.approx(0.4)
    assert np.isnan(rows.current_a).all()


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({}, 20),
        ({"tilt_deg": 3.9}, 20),
        ({"tilt_deg": 4.1}, 0),
        ({"rate_deg_s": 59.0}, 20),
        ({"rate_deg_s": -61.0}, 0),
        ({"armed": (Span(1.0, 2.0, ""),)}, 5),
        ({"armed": (Span(9.0, 12.0, ""),)}, 0),
        ({"seconds": 0.4}, 2),
        ({"seconds": 0.2}, 0),
    ],
)
def test_rows_are_in_flight_without_quick_turns_and_where_the_vertical_is_known(options, count):
    evidence, track, own = flight(**options)
    rows = field_rows(evidence, track, own, 0)
    assert (0 if rows is None else len(rows.t_s)) == count


def test_without_a_field_model_or_two_samples_there_are_no_rows():
    evidence, track, own = flight()
    nowhere = evidence.flight._replace(earth=EarthFields(*[NOTHING] * 4))
    assert field_rows(evidence._replace(flight=nowhere), track, own, 0) is None
    one = CompassTrack(*(each[:1] if isinstance(each, np.ndarray) else each for each in track))
    assert field_rows(evidence, one, own, 0) is None
