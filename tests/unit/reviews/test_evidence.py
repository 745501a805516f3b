"""What several subjects share of a flight, part by part: just enough, and just too little."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins, imu_track, receiver_track
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Context, Series, Span, VibrationTrack
from h2nav.reviews import evidence as of
from h2nav.reviews.impacts import BIN_S
from h2nav.reviews.standstill import NEVER
from h2nav.reviews.vertical import Contact

END_S = 100.0
ARMED = (Span(0.0, END_S, "armed"),)


class Evidence(KnownEvidence):
    """With the flight itself; parts that were not given are worked out."""

    def __init__(self, parts=None, context=None, **flight):
        super().__init__(parts or {})
        usual = {"kind": "dataflash", "autopilot": "ArduCopter V4.5.7", "findings": ()}
        context = context or Context(duration_s=END_S, armed=ARMED)
        self.flight = SimpleNamespace(**usual | {"context": context} | flight)

    def of(self, part):
        if part not in self._parts:
            self._parts[part] = part(self)
        return self._parts[part]


def height(t_s, values):
    return Series(np.asarray(t_s, float), np.asarray(values, float))


def finding(kind, imu=1, from_s=10.0, to_s=20.0, sensor=SensorKind.IMU):
    return Finding(kind, Sensor(sensor, imu), Severity.ERROR, from_s, to_s, 1.0, "", "", "")


# --- the recording ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "streamed", "timed", "own"),
    [
        ("dataflash", False, True, True),
        ("ulog", False, True, True),
        ("tlog", True, True, False),
        ("mcap", True, True, False),
        ("bytes", False, False, False),
    ],
)
def test_what_kind_of_recording_it_is(kind, streamed, timed, own):
    evidence = Evidence(kind=kind)
    assert of.is_streamed(evidence) is streamed
    assert of.has_times(evidence) is timed
    assert of.is_own_log(evidence) is own
    assert of.logged_armed(evidence) == (ARMED if timed else ())


def test_samples_of_one_instant_make_no_bins():
    assert of.bins(Evidence({of.soundest_as_recorded: imu_track(np.zeros(9))})) is None


def test_while_nothing_was_logged_it_counts_as_not_armed():
    evidence = Evidence({of.paused: (Span(40.0, 60.0, "paused"),)})
    assert [(one.from_s, one.to_s) for one in of.logged_armed(evidence)] == [(0, 40), (60, 100)]


@pytest.mark.parametrize(
    ("autopilot", "count"), [("ArduCopter V4.5.7", 1), ("PX4 v1.14", 0), ("", 1)]
)
def test_the_metric_of_px4_is_no_vibration(autopilot, count):
    t_s = np.arange(3.0)
    track = VibrationTrack(0, t_s, np.zeros((3, 3)), np.zeros(3))
    context = Context(vibrations=(track,))
    evidence = Evidence({of.recorded: context}, autopilot=autopilot)
    assert len(of.vibes(evidence)) == count


# --- samples ----------------------------------------------------------------------------------


def test_samples_are_in_order_and_have_numbers():
    track = imu_track(np.arange(8.0))
    track.t_s[3] = 1.5  # goes back
    track.w_b[4, 1], track.f_b[5, 2] = math.nan, math.inf
    track.f_b[6] = 0.0  # a compass without an IMU
    evidence = Evidence({of.dead_rows: ()}, Context(imus=(track,)))
    (found,) = of.sampled(evidence)
    assert found.t_s.tolist() == [0.0, 1.0, 2.0, 7.0]


def test_equal_times_are_in_order():
    track = imu_track(np.array([0.0, 1.0, 1.0, 2.0]))
    (found,) = of.field_tracks(Evidence({of.dead_rows: ()}, Context(imus=(track,))))
    assert len(found.t_s) == 4


@pytest.mark.parametrize(("samples", "count"), [(1, 0), (2, 1)])
def test_one_sample_is_no_track(samples, count):
    track = imu_track(np.arange(float(samples)))
    evidence = Evidence({of.dead_rows: ()}, Context(imus=(track,)))
    assert len(of.sampled(evidence)) == count


def test_without_times_of_arrival_the_stamps_are_the_times():
    track = imu_track(np.arange(4.0))
    track = track._replace(t_s=np.zeros(4), stamp_us=np.array([5, 6, 7, 8]) * 500_000)
    evidence = Evidence({of.dead_rows: ()}, Context(imus=(track,)), kind="bytes")
    (found,) = of.sampled(evidence)
    assert found.t_s.tolist() == [0.0, 0.5, 1.0, 1.5]


def test_stamps_go_on_where_the_autopilot_began_anew():
    track = imu_track(np.arange(6.0))
    track = track._replace(t_s=np.arange(6.0), stamp_us=np.array([7, 8, 9, 0, 1, 2]) * 1_000_000)
    evidence = Evidence({of.dead_rows: ()}, Context(imus=(track,)), kind="bytes")
    (found,) = of.sampled(evidence)
    assert found.t_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_what_goes_back_is_left_out_until_it_goes_on():
    track = imu_track(np.array([0.0, 1.0, 2.0, 1.0, 1.5, 2.5]))
    (found,) = of.field_tracks(Evidence({of.dead_rows: ()}, Context(imus=(track,))))
    assert found.t_s.tolist() == [0.0, 1.0, 2.0, 2.5]


def test_samples_at_one_time_show_no_blow():
    parts = {of.soundest_as_recorded: imu_track(np.zeros(9)), of.bins: flying_bins(0.0)}
    met = [Contact(50.0, 9.0, 99.0, ("the estimator", "the GPS"), ())]
    assert of.blows(Evidence(parts | {of.met: met, of.vertical: ()})) == ()


@pytest.mark.parametrize(("dead", "is_kept"), [(0, False), (1, True)])
def test_a_dead_compass_has_no_field(dead, is_kept):
    track = imu_track(np.arange(4.0))._replace(m_b_ut=np.ones((4, 3)))
    evidence = Evidence({of.dead_rows: (SimpleNamespace(compass=dead),)}, Context(imus=(track,)))
    (found,) = of.field_tracks(evidence)
    assert np.isfinite(found.m_b_ut).all() == is_kept


def test_the_soundest_imu_was_wrong_for_the_shortest_time():
    tracks = tuple(imu_track(np.arange(3.0))._replace(imu=number) for number in range(3))
    findings = (
        finding(Kind.GYRO_APART, 1, 0.0, 10.0),
        finding(Kind.GYRO_APART, 2, 0.0, 5.0),
        finding(Kind.ACCELEROMETER_APART, 2, 20.0, 24.0),
        finding(Kind.GYRO_APART, 3, 5.0, 14.5),
        finding(Kind.COMPASS_STEP, 2, 0.0, 90.0, SensorKind.COMPASS),
    )
    evidence = Evidence({of.motion_tracks: tracks}, findings=findings)
    assert of.soundest(evidence).imu == 1
    assert of.soundest(Evidence({of.motion_tracks: ()})) is None


def test_the_soundest_as_recorded_has_its_vibration_and_needs_times():
    slow, fast = imu_track(np.arange(3.0)), imu_track(np.arange(0.0, 3.0, 0.1))
    parts = {of.soundest: slow, of.sampled: (fast._replace(imu=1), fast)}
    assert of.soundest_as_recorded(Evidence(dict(parts))) is fast
    assert of.soundest_as_recorded(Evidence(dict(parts), kind="bytes")) is None
    assert of.soundest_as_recorded(Evidence(parts | {of.soundest: None})) is None
    assert of.at_rest(Evidence(), None) == NEVER


def test_the_rate_is_that_of_the_quickest_imu():
    tracks = tuple(imu_track(np.arange(0.0, 10.0, step_s)) for step_s in (0.1, 0.01, 0.05))
    assert of.rate_hz(Evidence({of.sampled: tracks})) == pytest.approx(100.0)
    assert of.rate_hz(Evidence({of.sampled: ()})) == 0.0


def test_fixes_of_a_receiver_have_increasing_times():
    track = receiver_track(np.array([0.0, 1.0, 1.0, 0.5, 2.0]), 0.0)
    evidence = Evidence({of.unharmed: Context(gps=(track,))})
    (found,) = of.receivers(evidence)
    # the second of two equal ones, and what goes back, are none
    assert found.t_s.tolist() == [0.0, 1.0, 2.0]
    assert of.moves(Evidence({of.receivers: ()})) is None


@pytest.mark.parametrize(
    ("kind", "imu", "sensor", "is_reported"),
    [
        (Kind.GYRO_APART, 2, SensorKind.IMU, True),
        (Kind.ACCELEROMETER_APART, 2, SensorKind.IMU, False),
        (Kind.GYRO_APART, 1, SensorKind.IMU, False),
        (Kind.GYRO_APART, 2, SensorKind.COMPASS, False),
    ],
)
def test_what_a_check_in_flight_has_said(kind, imu, sensor, is_reported):
    evidence = Evidence(findings=(finding(kind, imu, sensor=sensor),))
    assert of.is_reported(evidence, Kind.GYRO_APART, 1) is is_reported


@pytest.mark.parametrize(
    ("imus", "accused", "judge"),
    [
        ((0, 1), (), 0),
        ((0, 1), (1,), 1),
        ((0, 1), (2,), 0),
        ((0, 1), (1, 2), None),
        ((0,), (1,), 0),
    ],
)
def test_a_wrong_accelerometer_judges_no_receiver(imus, accused, judge):
    tracks = tuple(imu_track(np.arange(3.0))._replace(imu=number) for number in imus)
    steps = [finding(Kind.ACCELEROMETER_APART, number) for number in accused]
    parts = {of.soundest: tracks[0], of.alive: tracks, of.force_steps: steps}
    found = of.witness(Evidence(parts))
    assert (found.imu if found is not None else None) == judge


# --- whether it flew --------------------------------------------------------------------------


def hovering(seconds, uneven_m_s2=0.5, driven=0.5, end_s=END_S):
    """Bins of a vehicle that stands, and whose motors carry it for the last seconds."""
    found = flying_bins(end_s, driven)
    found.driven[found.t_s < end_s - seconds - 1e-9] = 0.0
    found.f_b[:, 2] += np.linspace(-0.5, 0.5, len(found.t_s)) % 0.1 * 10.0 * uneven_m_s2 / 0.9
    return found


def flew(found):
    return Evidence({of.bins: found, of.recorded: Context(duration_s=END_S, armed=ARMED)})


@pytest.mark.parametrize(("seconds", "has_flown"), [(1.9, False), (2.1, True), (50.0, True)])
def test_it_flew_if_motors_carried_it_for_two_seconds(seconds, has_flown):
    assert of.flown(flew(hovering(seconds))) is has_flown


@pytest.mark.parametrize(("uneven_m_s2", "has_flown"), [(0.09, False), (0.13, True)])
def test_on_a_bench_the_force_is_steady(uneven_m_s2, has_flown):
    found = hovering(50.0, 0.0)
    found.f_b[:, 2] -= uneven_m_s2 * (np.arange(len(found.t_s)) % 2)
    assert of.flown(flew(found)) is has_flown


def test_without_samples_nothing_flew():
    assert not of.flown(flew(None))
    assert not of.rose(flew(None))


@pytest.mark.parametrize(
    ("seconds", "metres", "vehicle_type", "has_risen"),
    [
        (2.1, 20.0, mavlink.MAV_TYPE_QUADROTOR, True),
        (1.8, 20.0, mavlink.MAV_TYPE_QUADROTOR, False),
        (30.0, 0.5, mavlink.MAV_TYPE_QUADROTOR, False),
        (30.0, 20.0, mavlink.MAV_TYPE_GROUND_ROVER, False),
    ],
)
def test_it_flew_if_two_heights_show_it_for_two_seconds(seconds, metres, vehicle_type, has_risen):
    found = flying_bins(END_S)
    values = metres * (found.t_s >= END_S - seconds)
    heights = height(found.t_s, values)
    both = {"baro_height_m": heights, "height_m": heights}
    for given in (both, {"height_m": heights}, {"baro_height_m": heights}):
        context = Context(vehicle_type=vehicle_type, **given)
        evidence = Evidence({of.bins: found, of.recorded: context})
        assert of.rose(evidence) is (has_risen and given is both)


# --- whether it left the ground ---------------------------------------------------------------


def lifted(values, t_s=None, context=None, found=None, armed=ARMED, paused=()):
    t_s = np.linspace(0.0, END_S, len(values)) if t_s is None else t_s
    context = context or Context(duration_s=END_S, armed=armed, baro_height_m=height(t_s, values))
    found = flying_bins(END_S, 0.0) if found is None else found
    return of.lifted(Evidence({of.recorded: context, of.bins: found, of.paused: paused}))


@pytest.mark.parametrize(("metres", "is_lifted"), [(1.45, False), (1.55, True), (-1.55, True)])
def test_a_barometer_that_varies_on_the_ground_has_not_left_it(metres, is_lifted):
    values = np.where(np.arange(1000) % 200 < 100, 0.0, metres)
    assert (lifted(values) == ARMED) is is_lifted


@pytest.mark.parametrize(("minutes", "is_lifted"), [(2.5, False), (0.8, True)])
def test_a_barometer_that_warms_up_drifts_slowly(minutes, is_lifted):
    """Two metres: more than 1.5 m within a minute is no drift."""
    seconds = 60.0 * minutes
    t_s = np.arange(0.0, 600.0)
    armed = (Span(0.0, 600.0, "armed"),)
    values = 2.0 * np.clip(t_s / seconds, 0.0, 1.0)
    assert (lifted(values, t_s, armed=armed) == armed) is is_lifted


@pytest.mark.parametrize("source", ["height_m", "baro_height_m"])
def test_a_height_of_the_autopilot_serves_where_there_is_no_barometer(source):
    given = {source: height(np.arange(100.0), 0.01 * (np.arange(100) % 2))}
    assert lifted((), context=Context(duration_s=END_S, armed=ARMED, **given)) == ()
    risen = {source: height(np.arange(100.0), 5.0 * (np.arange(100) > 50))}
    assert lifted((), context=Context(duration_s=END_S, armed=ARMED, **risen)) == ARMED


@pytest.mark.parametrize("values", [np.full(100, 3.0), np.full(100, math.nan), np.zeros(2)])
def test_a_height_that_is_none_takes_no_flight_away(values):
    assert lifted(values) == ARMED


def test_only_spans_that_stayed_on_the_ground_are_left_out():
    armed = (Span(5.0, 30.0, "armed"), Span(50.0, 90.0, "armed"))
    t_s = np.arange(0.0, END_S, 0.5)
    values = 10.0 * ((t_s > 60.0) & (t_s < 80.0)) + 0.01 * (t_s > 10.0)
    assert lifted(values, t_s, armed=armed) == armed[1:]


@pytest.mark.parametrize(
    ("begins_s", "driven", "is_kept"),
    [
        (0.0, 0.5, True),
        (1.9, 0.5, True),
        (2.1, 0.5, False),
        (0.0, 0.05, False),
        (0.0, math.nan, True),
    ],
)
def test_a_log_that_begins_aloft_shows_no_height_above_the_ground(begins_s, driven, is_kept):
    armed = (Span(begins_s, END_S, "armed"),)
    values = 0.01 * (np.arange(100) % 2)
    kept = lifted(values, armed=armed, found=flying_bins(END_S, driven))
    assert (kept == armed) is is_kept


@pytest.mark.parametrize(
    ("paused", "driven", "is_kept"),
    [
        ((Span(50.0, 51.2, ""),), 0.5, True),
        ((Span(50.0, 51.2, ""),), 0.05, False),
        ((Span(50.0, 51.2, ""),), math.nan, False),
        ((), 0.5, False),
    ],
)
def test_what_hovers_where_a_log_goes_on_has_not_landed(paused, driven, is_kept):
    armed = (Span(0.0, 50.0, "armed"), Span(51.2, END_S, "armed"))
    found = flying_bins(END_S)
    found.driven[found.t_s > 50.0] = driven
    values = np.minimum(np.arange(0.0, END_S), 20.0)
    assert lifted(values, armed=armed, found=found, paused=paused) == armed[: 1 + is_kept]


# --- how it ends ------------------------------------------------------------------------------


def ending(found, spans=ARMED, heights=None, duration_s=END_S):
    given = heights or {}
    context = Context(duration_s=duration_s, armed=ARMED, **given)
    parts = {of.bins: found, of.recorded: context, of.lifted: spans}
    return of.ending(Evidence(parts, context))


def test_a_log_may_end_aloft_and_moving():
    assert ending(flying_bins(END_S)) == of.Ending(is_aloft=True, is_moving=True)


def test_a_log_that_ends_on_the_ground_does_not_fly():
    on_ground = of.Ending(is_aloft=False, is_moving=False)
    assert ending(flying_bins(END_S, 0.05)) == on_ground  # motors carry nothing
    assert ending(flying_bins(END_S), ()) == on_ground
    assert ending(None) == on_ground
    # the last second has no samples
    assert ending(flying_bins(END_S), duration_s=END_S + 2.0) == on_ground


@pytest.mark.parametrize(("before_s", "is_aloft"), [(0.8, True), (1.2, False)])
def test_what_was_disarmed_before_the_end_has_landed(before_s, is_aloft):
    spans = (Span(0.0, END_S - BIN_S - before_s, "armed"),)
    assert ending(flying_bins(END_S), spans).is_aloft == is_aloft


@pytest.mark.parametrize(
    ("baro_m", "own_m", "is_aloft"),
    [(20.0, 20.0, True), (20.0, 0.1, False), (0.1, 20.0, False), (20.0, None, False)],
)
def test_in_calm_air_two_heights_say_that_it_flies(baro_m, own_m, is_aloft):
    found = flying_bins(END_S)
    found.w_b[:] = 0.0
    t_s = np.arange(0.0, END_S)
    heights = {
        name: height(t_s, value * (t_s > 20.0))
        for name, value in (("baro_height_m", baro_m), ("height_m", own_m))
        if value is not None
    }
    assert ending(found, heights=heights) == of.Ending(is_aloft=is_aloft, is_moving=False)


@pytest.mark.parametrize(("still_s", "is_moving"), [(0.1, True), (0.9, False)])
def test_it_moves_at_the_end_if_it_moves_throughout(still_s, is_moving):
    found = flying_bins(END_S)
    found.w_b[found.t_s > END_S - 0.5 - still_s] = 0.0
    end = ending(found)
    assert end.is_moving == is_moving


# --- what counts as the flight ----------------------------------------------------------------


def test_the_flight_ends_two_seconds_before_a_crash():
    crash = SimpleNamespace(t_s=60.0, to_s=62.0, is_crash=True)
    landing = SimpleNamespace(t_s=30.0, to_s=31.0, is_crash=False)
    parts = {of.recorded: Context(armed=ARMED), of.blows: (landing, crash)}
    evidence = Evidence(parts)
    assert of.crashes(evidence) == [crash]
    spans = [(one.from_s, one.to_s) for one in of.unharmed(evidence).armed]
    assert spans == [(0.0, 58.0), (62.0, END_S)]


@pytest.mark.parametrize(
    ("found", "armed"),
    [
        ([], [(0.0, END_S)]),
        ([finding(Kind.MOTOR_SATURATED, from_s=20.0)], [(0.0, END_S)]),
        (
            [
                finding(Kind.MOTOR_FAILED, from_s=60.0, to_s=70.0),
                finding(Kind.MOTOR_SATURATED, from_s=20.0),
                finding(Kind.MOTOR_FAILED, from_s=40.0, to_s=42.0),
            ],
            [(0.0, 40.0)],
        ),
        ([finding(Kind.MOTOR_FAILED, from_s=0.0)], []),
    ],
)
def test_nothing_counts_as_flown_in_order_once_the_first_motor_has_failed(
    monkeypatch, found, armed
):
    """Not even after that motor came back."""
    monkeypatch.setattr(of, "detect_motors", lambda *_: found)
    context = Context(armed=ARMED)
    parts = {of.recorded: context, of.unharmed: context, of.crashes: [], of.lifted: ARMED}
    flown = of.in_order(Evidence(parts | {of.bins: flying_bins(END_S)}))
    assert [(one.from_s, one.to_s) for one in flown.armed] == armed
    assert of.in_order(Evidence(parts | {of.bins: None})) is context
