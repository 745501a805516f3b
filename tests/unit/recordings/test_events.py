"""Events of the service out of what a log recorded: their times, order, bounds and contents."""

import math

import numpy as np
import pytest
from made_rows import log_tables

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.autopilot_log import (
    AutopilotLog,
    Recorded,
    Setting,
    completed,
    has_enough_samples,
    imus_of,
    vehicle_name,
    what_sensors_lack,
)
from h2nav.recordings.context import (
    AttitudeTrack,
    Context,
    GpsTrack,
    ImuTrack,
    Said,
    Series,
    Span,
)
from h2nav.recordings.dataflash_rows import DataflashRows
from h2nav.recordings.imu_series import Fields, ImuRows, Readings, Samples
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.imu import Ages, ImuReading
from h2nav.wire.position import GnssLevels, GnssState, GnssTime, GpsFix, NoFix, Origin, Place
from h2nav.wire.vehicle import (
    Airspeed,
    Heartbeat,
    LandedState,
    ParameterValue,
    StatusText,
    SystemTime,
)

START_US = 5_000_000
START_UNIX_S = 1_700_000_000.0
NAN = math.nan


def events(tmp_path, context=None, **more):
    """Times since the start (s) and messages of a log of three seconds."""
    path = tmp_path / "log"
    path.write_bytes(bytes(300))

    class MadeLog(AutopilotLog):
        def _read(self):
            given = {"duration_s": 3.0, **(context or {})}
            return Recorded(Context(**given), 3, 2, START_US, **more)

    log = MadeLog(path)
    found = []
    for envelope, message in log.events():
        assert envelope.t_ns == envelope[1]
        assert (envelope[2], log.path) == ((1, 1), path)
        found.append((envelope.t_ns * 1e-9 - 5.0, message))
    assert log.progress == (300, 300)
    assert [t_s for t_s, _ in found] == sorted(t_s for t_s, _ in found)
    return found


def of(kind, found):
    return [(round(t_s, 6), message) for t_s, message in found if isinstance(message, kind)]


def test_a_heartbeat_a_second_says_when_it_is_armed(tmp_path):
    spans = (Span(1.0, 2.0, "armed"), Span(3.0, 9.0, "armed"))
    found = of(Heartbeat, events(tmp_path, {"armed": spans}))
    assert [(t_s, beat.is_armed) for t_s, beat in found] == [
        (0.0, False), (1.0, True), (2.0, False), (3.0, True),
    ]  # fmt: skip
    assert {(beat[0], beat[1]) for _, beat in found} == {(3, 2)}


@pytest.mark.parametrize(
    ("start_unix_s", "count"),
    [(None, 0), (START_UNIX_S, 4), (1_262_303_999.0, 3), (4_102_444_798.0, 2), (0.0, 0)],
)
def test_a_date_of_this_century_comes_every_second(tmp_path, start_unix_s, count):
    found = of(SystemTime, events(tmp_path, {"start_unix_s": start_unix_s}))
    assert len(found) == count
    for t_s, message in found:
        assert message.unix_s == pytest.approx(start_unix_s + t_s)


def test_a_landed_state_holds_until_the_next(tmp_path):
    airborne = Series(np.array([0.5, 1.5, 2.0]), np.array([0.0, 1.0, 0.0]))
    found = of(LandedState, events(tmp_path, {"airborne": airborne}))
    # Before the first one it is the first.
    assert [state.on_ground for _, state in found] == [True, True, True, True]
    airborne = Series(np.array([1.0]), np.array([0.5]))
    found = of(LandedState, events(tmp_path, {"airborne": airborne}))
    assert [state.on_ground for _, state in found] == [False] * 4


def test_parameters_texts_and_the_origin(tmp_path):
    settings = (Setting(START_US - 7, "A", 1.0), Setting(START_US + 2_500_000, "A", 2.0))
    said = (Said(0.25, 4, "x"), Said(2.75, 6, "y"))
    place = Place(47.0, 8.0, 500.0)
    found = events(tmp_path, {"said": said}, settings=settings, origin=place)
    assert of(ParameterValue, found) == [(0.0, ("A", 1.0)), (2.5, ("A", 2.0))]
    assert of(StatusText, found) == [(0.25, ("x",)), (2.75, ("y",))]
    assert of(Origin, found) == [(0.0, (place,))]
    # At one time the heartbeat comes first, to which the service binds.
    assert [type(message) for t_s, message in found if round(t_s, 6) == 0.0] == [
        Heartbeat, ParameterValue, Origin,
    ]  # fmt: skip


def receiver(number=0, **more):
    t_s = np.array([0.5, 1.0, 1.5])
    values = {
        "has_fix": np.array([True, True, False]), "latitude_deg": np.full(3, 47.0),
        "longitude_deg": np.full(3, 8.0), "altitude_m": np.full(3, 500.0),
        "v_n": np.array([(1.0, 2.0, NAN), (NAN, 2.0, 3.0), (1.0, 2.0, 3.0)]),
        "sigma_m_s": np.full(3, 0.25), "satellites": np.array([9.0, NAN, 9.0]),
        "jamming": None, "spoofing": None, "power": None, "clock": None, **more,
    }  # fmt: skip
    return GpsTrack(number, t_s, *values.values())


def test_fixes_of_the_receiver_in_use(tmp_path):
    stamps = START_US + np.array([400_000, 900_000, 1_400_000])
    gps = {"gps": (receiver(0), receiver(1, altitude_m=np.full(3, 600.0)))}
    found = of((GpsFix, NoFix), events(tmp_path, gps, receiver=1, fix_us=stamps))
    assert [t_s for t_s, _ in found] == [0.5, 1.0, 1.5]
    first, second, third = (message for _, message in found)
    assert first[:2] == (START_US + 400_000, Place(47.0, 8.0, 600.0))
    # Without a vertical part it is a velocity; without a horizontal one it is none.
    assert first.v_n[:2] == (1.0, 2.0)
    assert math.isnan(first.v_n[2])
    assert (second.v_n, first.sigma_m_s) == (None, 0.25)
    assert (first[4], second[4], third) == (9, None, NoFix())


@pytest.mark.parametrize(
    ("jamming", "spoofing", "expected"),
    [
        (None, None, []),
        ([1, 2, 3], None, [(1, 0), (2, 0), (3, 0)]),
        (None, [1, 2, 3], [(0, 1), (0, 2), (0, 3)]),
        ([1, 1, 1], [3, 2, 1], [(1, 3), (1, 2), (1, 1)]),
    ],
)
def test_what_a_receiver_says_of_its_signals(tmp_path, jamming, spoofing, expected):
    told = {name: None if values is None else np.array(values)
            for name, values in (("jamming", jamming), ("spoofing", spoofing))}  # fmt: skip
    found = of(GnssState, events(tmp_path, {"gps": (receiver(1, **told),)}))
    assert [(each.jamming, each.spoofing) for _, each in found] == expected
    assert all(each[0] == 1 for _, each in found)


def test_what_a_receiver_measures_and_when_it_is(tmp_path):
    power = Series(np.array([0.25, 2.0]), np.array([(80.0, 60.0, 5.0), (81.0, 61.0, 6.0)]))
    clock = Series(np.array([0.75]), np.array([START_UNIX_S]))
    found = events(tmp_path, {"gps": (receiver(1, power=power, clock=clock),)})
    assert of(GnssLevels, found) == [(0.25, (1, 80.0, 60.0, 5.0)), (2.0, (1, 81.0, 61.0, 6.0))]
    assert of(GnssTime, found) == [(0.75, (1, START_US + 750_000, START_UNIX_S))]


@pytest.mark.parametrize("is_true", [False, True])
def test_an_airspeed_is_along_the_nose_or_unknown(tmp_path, is_true):
    speed = Series(np.array([0.5, 1.0, 1.5]), np.array([20.0, 0.0, -1.0]))
    found = of(Airspeed, events(tmp_path, airspeed_m_s=speed, airspeed_is_true=is_true))
    assert found == [(0.5, (20.0, is_true)), (1.0, (None, is_true)), (1.5, (None, is_true))]


def test_attitudes_come_twenty_times_a_second_at_most(tmp_path):
    t_s = np.arange(0.0, 0.2, 0.01)
    track = AttitudeTrack("EKF3", t_s, np.tile((1.0, 0.0, 0.0, 0.0), (len(t_s), 1)))
    found = of(ReportedAttitude, events(tmp_path, flown=track, second=track))
    own = [(t_s, each.time_ms) for t_s, each in found if each.time_ms is not None]
    assert own == [(0.0, 5000), (0.05, 5050), (0.1, 5100), (0.15, 5150)]
    second = [(t_s, each[0]) for t_s, each in found if each.time_ms is None]
    assert second == [(0.0, True), (0.05, True), (0.1, True), (0.15, True)]
    assert {each.q_nb for _, each in found} == {(1.0, 0.0, 0.0, 0.0)}


def test_readings_from_before_the_log_are_left_out(tmp_path):
    t_us = START_US + np.array([-1, 0, 2_999_999])
    field = np.array([(1.0, 2.0, 3.0), (NAN,) * 3, (4.0, 5.0, 6.0)])
    w_b, f_b = np.arange(9.0).reshape(3, 3), np.arange(9.0).reshape(3, 3) + 10.0
    clipped = np.array([False, True, False])
    ages = Ages(0.01, None)
    made = Readings(1, t_us, w_b, f_b, field, clipped, ages)
    found = of(ImuReading, events(tmp_path, readings=(made,)))
    assert found == [
        (0.0, (START_US, (3.0, 4.0, 5.0), (13.0, 14.0, 15.0), None, True, 1, ages)),
        (2.999999, (START_US + 2_999_999, (6.0, 7.0, 8.0), (16.0, 17.0, 18.0),
                    (4.0, 5.0, 6.0), False, 1, ages)),
    ]  # fmt: skip


def test_the_date_of_a_log_sets_its_clock(tmp_path):
    path = tmp_path / "log"
    path.write_bytes(b"x")
    for unix_s, start_ns, offset_ns in (
        (START_UNIX_S, 1_700_000_000 * 10**9, 1_699_999_995 * 10**9), (None, 0, 0),
    ):  # fmt: skip

        class MadeLog(AutopilotLog):
            date = unix_s

            def _read(self):
                return Recorded(Context(start_unix_s=self.date), 3, 2, START_US)

        log = MadeLog(path)
        assert (log.unix_start_ns, log.unix_offset_ns) == (start_ns, offset_ns)


# --- what a log has and lacks -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("vehicle_type", "name"),
    [(2, "quadrotor"), (1, "fixed wing"), (10, "ground rover"), (0, ""), (9999, "")],
)
def test_a_vehicle_by_its_name(vehicle_type, name):
    assert vehicle_name(vehicle_type) == name


def imu(rate_hz, *, has_field=False, is_timed=True):
    stamps = np.round(np.arange(5) * 1e6 / rate_hz).astype(np.int64)
    values = np.full((5, 3), 1.0)
    field = values if has_field else np.full((5, 3), NAN)
    track = ImuTrack(0, "IMU", stamps * 1e-6, stamps, values, values, field)
    return track._replace(is_timed=is_timed)


@pytest.mark.parametrize(
    ("context", "missing"),
    [
        ({}, ("no IMU samples", "no compass", "no GPS fix", "no date")),
        ({"imus": (imu(20),), "start_unix_s": 1.0}, ("no compass", "no GPS fix")),
        ({"imus": (imu(19), imu(5)), "start_unix_s": 1.0},
         ("IMU samples only 19 times a second", "no compass", "no GPS fix")),
        ({"imus": (imu(50, has_field=True, is_timed=False),), "start_unix_s": 1.0},
         ("IMU samples without times of their own", "no GPS fix")),
        ({"imus": (imu(50, has_field=True),), "start_unix_s": 1.0, "gps": (receiver(),)}, ()),
        ({"imus": (imu(50, has_field=True),), "start_unix_s": 1.0,
          "gps": (receiver(v_n=np.full((3, 3), NAN)),)}, ("no GPS velocity",)),
        ({"imus": (imu(50, has_field=True),), "start_unix_s": 1.0,
          "gps": (receiver(has_fix=np.zeros(3, bool)),)}, ("no GPS fix",)),
    ],
)  # fmt: skip
def test_what_sensors_lack_in_words(context, missing):
    assert what_sensors_lack(Context(**context)) == missing


@pytest.mark.parametrize(
    ("imus", "is_enough"),
    [((), False), ((imu(20),), True), ((imu(19.9),), False), ((imu(5), imu(50)), True),
     ((imu(50, is_timed=False),), False)],
)  # fmt: skip
def test_twenty_samples_a_second_are_enough(imus, is_enough):
    assert has_enough_samples(Context(imus=imus)) is is_enough


TIMES = START_US + 10_000 * np.arange(100)


def rows(number=0, averaged_us=None, t_us=TIMES, is_timed=True, **changed):
    forces = np.tile((0.0, 0.0, -GRAVITY_M_S2), (len(t_us), 1))
    for place, force in changed.items():
        forces[int(place[1:])] = force
    samples = Samples(t_us, np.zeros((len(t_us), 3)), forces)
    return ImuRows(number, "IMU", samples, averaged_us, (7, 8), is_timed)


def found_imus(*found, compasses=None, **more):
    log = DataflashRows(log_tables("TimeUS", X={"TimeUS": TIMES}))
    return *imus_of(log, found, compasses or {}, **more), log.notes


def test_samples_that_cannot_be_are_left_out_and_counted():
    (track,), (readings,), notes = found_imus(rows(1, r5=(0, 0, 0), r6=(1e9, 0, 0)))
    assert (track.imu, track.device_ids, track.is_timed, len(track.t_s)) == (1, (7, 8), True, 98)
    assert (readings.imu, len(readings.t_us), readings.ages) == (1, 98, None)
    assert notes == {"values of IMU 2 that cannot be": 2}
    assert found_imus(rows(t_us=TIMES[:0])) == ((), (), {})


@pytest.mark.parametrize(
    ("made", "count"),
    [(rows(t_us=TIMES[::5]), 1), (rows(t_us=TIMES[::6]), 0), (rows(is_timed=False), 0)],
)
def test_samples_that_are_too_slow_are_shown_and_not_read(made, count):
    tracks, readings, _ = found_imus(made)
    assert (len(tracks), len(readings)) == (1, count)


def test_a_mean_is_as_old_as_half_of_its_time_and_vectors_are_turned():
    averaged = np.full(100, 5000.0)
    (track,), (readings,), _ = found_imus(rows(averaged_us=averaged), to_body=lambda v: -v)
    assert readings.ages == (0.0025, None)
    assert track.f_b[0, 2] == pytest.approx(GRAVITY_M_S2)


def test_an_imu_without_a_compass_carries_the_field_of_the_first():
    field = {0: Fields(TIMES[10:11], np.array([(20.0, 0.0, 40.0)]))}
    tracks, readings, _ = found_imus(rows(0), rows(1), compasses=field)
    shown = [int(np.isfinite(track.m_b_ut[:, 0]).sum()) for track in tracks]
    carried = [int(np.isfinite(each.m_b_ut[:, 0]).sum()) for each in readings]
    assert (shown, carried) == ([1, 0], [1, 1])


# --- what follows in every format -------------------------------------------------------------


ARMED = (Span(1.0, 2.0, "armed"),)


def whole(settings=(), armed=ARMED, lacks=None, **context):
    log = DataflashRows(log_tables("TimeUS", X={"TimeUS": TIMES}))
    return completed(Context(**context), log, tuple(settings), armed, lacks or {})


def test_the_rest_of_a_context_follows_from_it():
    found = whole(vehicle_type=2)
    assert (found.vehicle, found.duration_s) == ("quadrotor", pytest.approx(0.99))
    assert found.armed == ARMED
    # Where nothing tells it, nothing counts as at rest.
    assert whole(armed=None).armed == (Span(0.0, found.duration_s, "armed"),)


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({}, None),
        ({"armed": None}, "no word of when the motors were armed"),
        ({"lacks": {"no wings": True, "no tail": False}}, "no wings"),
        ({"attitudes": ()}, "no autopilot's attitude to compare with"),
    ],
)
def test_what_a_log_lacks_in_words(given, phrase):
    track = AttitudeTrack("EKF3", np.zeros(1), np.array([(1.0, 0.0, 0.0, 0.0)]))
    missing = whole(**{"attitudes": (track,), **given}).missing
    of_sensors = what_sensors_lack(Context())
    assert missing == (*of_sensors, *([phrase] if phrase else []))


def test_parameters_that_changed_and_those_that_count_by_themselves():
    values = [
        ("A", 1.0, 0.0), ("STAT_RUNTIME", 1.0, 0.0), ("A", 1.0, 0.25), ("A", 2.0, 0.5),
        ("STAT_RUNTIME", 2.0, 0.5), ("B", 7.0, 0.75), ("A", 1.0, 0.75),
    ]  # fmt: skip
    found = whole(Setting(START_US + round(1e6 * t_s), name, value) for name, value, t_s in values)
    assert found.parameters == {"A": 1.0, "STAT_RUNTIME": 2.0, "B": 7.0}
    assert [(round(t_s, 6), *rest) for t_s, *rest in found.changes] == [
        (0.5, "A", 1.0, 2.0), (0.75, "A", 2.0, 1.0),
    ]  # fmt: skip
