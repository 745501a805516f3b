"""Biases of known size, against data sheets and against other IMUs."""

from typing import NamedTuple

import numpy as np
import pytest
from known_evidence import imu_track
from reviewed_flights import flight, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product, select_rows
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import ImuTrack, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.inertial import attitudes, exponential
from h2nav.reviews.sensor_bias import _apart, detect_biases, measuring

BIAS_DEG_S = np.array([0.1, -0.1, 0.05])


@pytest.mark.parametrize("name", ["flight", "aggressive", "hover"])
def test_the_bias_is_that_of_the_gyro(name):
    bias = analyse(flight(name)).biases[0]
    mean = np.nanmedian(bias.gyro_b, axis=0) / DEG
    np.testing.assert_allclose(mean, BIAS_DEG_S, atol=0.05)


def test_a_bias_beyond_the_data_sheet_is_told():
    flown = flight()
    more = np.array([0.0, 4.0, 0.0])
    w_b = flown.context.imus[0].w_b + more * DEG
    (finding,) = analyse(with_imu(flown, w_b=w_b)).findings
    assert finding.kind == "gyro_bias"
    assert finding.size == pytest.approx(np.linalg.norm(BIAS_DEG_S + more), abs=0.1)


@pytest.mark.parametrize("step_deg_s", [1.2, -1.8])
def test_a_step_of_the_bias_has_its_time_and_size(step_deg_s):
    flown = flight()
    first = flown.context.imus[0]
    w_b = first.w_b.copy()
    w_b[first.t_s > 64.0, 0] += step_deg_s * DEG
    (finding,) = analyse(with_imu(flown, w_b=w_b)).findings
    assert finding.kind == "gyro_bias_step"
    assert finding.size == pytest.approx(abs(step_deg_s), abs=0.15)
    assert finding.from_s - 10.0 < 64.0 < finding.to_s + 10.0


@pytest.mark.parametrize("axis", [0, 2])
def test_a_step_on_the_ground_is_told_though_the_attitude_follows_the_gyro(axis):
    flown = flight("rest")
    first = flown.context.imus[0]
    w_b = first.w_b.copy()
    w_b[first.t_s > 64.0, axis] += 1.2 * DEG
    # An attitude that turns with the gyro, as that of a filter that believes it.
    turned = np.zeros((len(first.t_s), 3))
    turned[:, axis] = 1.2 * DEG * np.maximum(first.t_s - 64.0, 0.0)
    biased = flown.estimates._replace(q_nb=product(flown.estimates.q_nb, exponential(turned)))
    found = analyse(with_imu(flown._replace(estimates=biased), w_b=w_b)).findings
    (finding,) = [f for f in found if f.kind == "gyro_bias_step"]
    assert finding.size == pytest.approx(1.2, abs=0.15)
    assert finding.from_s - 10.0 < 64.0 < finding.to_s + 10.0


def test_a_compass_that_stands_still_by_itself_shows_no_bias():
    flown = flight("aggressive")
    first = flown.context.imus[0]
    frozen = Finding(
        Kind.COMPASS_FROZEN,
        Sensor(SensorKind.IMU, 1),
        Severity.WARNING,
        30.0,
        60.0,
        0.0,
        "",
        "frozen",
        "",
    )
    still = with_imu(flown, m_b_ut=np.tile(first.m_b_ut[0], (len(first.t_s), 1)))
    bias = analyse(still._replace(findings=(frozen,))).biases[0]
    np.testing.assert_allclose(np.nanmedian(bias.gyro_b, axis=0) / DEG, BIAS_DEG_S, atol=0.05)


def test_of_three_imus_the_odd_one_is_named():
    flown = flight(imus=3)
    tracks = list(flown.context.imus)
    tracks[1] = tracks[1]._replace(
        w_b=tracks[1].w_b + 3.0 * DEG * np.array([0.0, 0.0, 1.0]),
        f_b=tracks[1].f_b + np.array([1.2, 0.0, 0.0]),
    )
    flown = flown._replace(context=flown.context._replace(imus=tuple(tracks)))
    found = {f.kind: f for f in analyse(flown).findings}
    assert found["gyro_apart"].source == "IMU 2"
    assert found["gyro_apart"].size == pytest.approx(3.0, abs=0.2)
    assert found["accelerometer_apart"].source == "IMU 2"
    assert found["accelerometer_apart"].size == pytest.approx(1.2, abs=0.1)


def test_of_two_imus_the_one_with_a_bias_is_named():
    flown = flight(imus=2)
    one, other = flown.context.imus
    more = 3.0 * DEG * np.array([0.0, 0.0, 1.0])
    one = one._replace(w_b=one.w_b + more, f_b=one.f_b + np.array([1.2, 0.0, 0.0]))
    flown = flown._replace(context=flown.context._replace(imus=(one, other)))
    found = {f.kind: f for f in analyse(flown).findings}
    assert found["gyro_apart"].source == "IMU 1"
    assert "differs from IMU 2" in found["gyro_apart"].text
    assert found["accelerometer_apart"].source == "IMU 1 or IMU 2"
    assert "not known" in found["accelerometer_apart"].evidence


@pytest.mark.parametrize("began_s", [50.0, 52.0, 53.5])
def test_two_gyros_that_disagree_from_some_time_on_do_so_from_then(began_s):
    """To a second, in means of five: a cause begins no later than what it brings about."""
    still = np.arange(0.0, 120.0, 0.01)
    begins = still >= began_s
    tracks = []
    for imu, off in enumerate((30.0 * DEG, 0.0)):
        w_b = np.outer(begins * off, (0.0, 0.0, 1.0))
        tracks.append(imu_track(still, w_b)._replace(imu=imu))
    (found,) = _apart(tuple(tracks), ())
    assert found.kind is Kind.GYRO_APART
    assert found.from_s == pytest.approx(began_s, abs=0.1)
    assert found.size == pytest.approx(30.0)


def test_a_sensor_that_is_known_to_be_frozen_has_no_bias():
    flown = flight(imus=2)
    first = flown.context.imus[0]
    is_frozen = (first.t_s > 40.0) & (first.t_s < 80.0)
    w_b = np.where(is_frozen[:, None], 1.0, first.w_b)
    told = Finding(
        Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, 1), Severity.ERROR, 40.0, 80.0, 40.0, "s", "", ""
    )
    flown = with_imu(flown, w_b=w_b)._replace(findings=(told,))
    assert not [f for f in analyse(flown).findings if "gyro" in f.kind]


def test_an_accelerometer_that_does_not_show_gravity_at_rest_is_told():
    flown = flight("rest", armed=(), gps=())
    f_b = 1.12 * flown.context.imus[0].f_b
    (finding,) = analyse(with_imu(flown, f_b=f_b)).findings
    assert finding.kind == "accelerometer_scale"
    assert finding.size == pytest.approx(120.0, abs=10.0)
    assert not analyse(flight("rest", armed=())).findings


def test_what_shakes_on_the_ground_is_not_at_rest():
    track = flight("rest").context.imus[0]
    off = track._replace(f_b=1.12 * track.f_b)
    assert [one.kind for one in detect_biases((off,), None, (), ())[1]] == ["accelerometer_bias"]
    shaken = off._replace(f_b=off.f_b + np.sin(9.0 * off.t_s)[:, None])
    assert not detect_biases((shaken,), None, (), ())[1]


def slow_stream(seed, turned_deg_s, extra_deg_s):
    """Two IMUs that turn to and fro, of which some samples a second come, of other moments."""
    random, tracks = np.random.default_rng(seed), []
    for imu in range(2):
        t_s = np.sort(random.uniform(0.0, 100.0, 1200))
        along = turned_deg_s * np.sign(np.sin(0.6 * t_s)) + imu * extra_deg_s
        w_b = DEG * along[:, None] * np.array([0.0, 0.0, 1.0])
        f_b = np.tile([0.0, 0.0, -9.8], (len(t_s), 1))
        stamp_us = np.round(1e6 * t_s).astype(np.int64)
        tracks.append(ImuTrack(imu, "RAW_IMU", t_s, stamp_us, w_b, f_b, np.full_like(f_b, np.nan)))
    return {one.kind for one in _apart(tuple(tracks), ())}


def test_slow_samples_of_a_moving_vehicle_differ_by_chance():
    assert not any(slow_stream(seed, 60.0, 0.0) for seed in range(20))
    assert slow_stream(1, 0.0, 3.0) == {Kind.GYRO_APART}


@pytest.mark.parametrize("extra_deg_s", [0.0, 3.0])
@pytest.mark.parametrize("every_s", [4.5, 30.0])
def test_an_imu_that_pauses_has_missed_what_the_other_saw(every_s, extra_deg_s):
    """The vehicle turns in every pause."""
    t_s = np.arange(0.0, 100.0, 0.02)
    pauses = t_s % every_s < 0.8
    w_b = np.where(pauses[:, None], (0.0, 0.0, 60.0 * DEG), 0.0)
    off = w_b + extra_deg_s * DEG * np.array([1.0, 0.0, 0.0])
    one, other = imu_track(t_s, w_b), imu_track(t_s, off)._replace(imu=1)
    found = {found.kind for found in _apart((select_rows(one, ~pauses), other), ())}
    assert found == ({Kind.GYRO_APART} if extra_deg_s else set())


@pytest.mark.parametrize(
    ("scattered_m_s2", "shaken_m_s2", "is_told"),
    [(0.35, 8.0, True), (0.6, 8.0, False), (0.6, 0.0, True), (0.6, 1.0, True)],
)
def test_differences_that_come_and_go_among_vibration_are_no_bias(
    scattered_m_s2, shaken_m_s2, is_told
):
    """What it leaves of quick samples; three windows of one sign, by 1.2 m/s^2."""
    apart_m_s2 = np.where(np.arange(20) % 2, 1.0, -1.0) * 0.5 * scattered_m_s2
    apart_m_s2[[4, 11, 13]] = -1.2
    t_s = np.arange(0.0, 100.0, 0.02)
    tracks = []
    for imu in range(2):
        f_b = np.zeros((len(t_s), 3))
        f_b[:, 2] = -GRAVITY_M_S2 + imu * np.repeat(apart_m_s2, 250)
        f_b[:, 2] += np.where(np.arange(len(t_s)) % 2, 1.0, -1.0) * shaken_m_s2
        nothing = np.full_like(f_b, np.nan)
        stamp_us = np.rint(1e6 * t_s)
        track = ImuTrack(imu, "RAW_IMU", t_s, stamp_us, np.zeros_like(f_b), f_b, nothing)
        tracks.append(track)
    found = {one.kind for one in _apart(tuple(tracks), ())}
    assert found == ({Kind.ACCELEROMETER_APART} if is_told else set())


# --- each bound, of sensors that stand or turn evenly ---------------------------------------------

ARMED = (Span(0.0, 1e3, "armed"),)


class Board(NamedTuple):
    """What one IMU reads, while it turns about its vertical axis."""

    gyro_deg_s: tuple[float, float, float] = (0.0, 0.0, 0.0)  # its bias
    step_deg_s: float = 0.0  # of the x axis
    step_s: float = 60.0
    until_s: float = 1e3
    force: float = GRAVITY_M_S2
    force_step: float = 0.0  # of the x axis, from `step_s` until `until_s`
    shaking_deg_s: float = 0.0  # of a rate that changes its sign with each sample
    shaking_m_s2: float = 0.0
    turn_deg_s: float = 0.0
    seconds: float = 120.0
    period_s: float = 0.05
    lost_s: tuple[float, float] = (0.0, 0.0)
    imu: int = 0

    def track(self) -> ImuTrack:
        t_s = np.arange(0.0, self.seconds, self.period_s)
        t_s = t_s[(t_s <= self.lost_s[0]) | (t_s >= self.lost_s[1])]
        sign = np.where(np.arange(len(t_s)) % 2, 1.0, -1.0)
        stepped = ((t_s > self.step_s) & (t_s <= self.until_s)) * 1.0
        w_b = np.tile(self.gyro_deg_s, (len(t_s), 1))
        w_b[:, 0] += self.step_deg_s * stepped + self.shaking_deg_s * sign
        w_b[:, 2] += self.turn_deg_s
        f_b = np.tile((0.0, 0.0, -self.force), (len(t_s), 1))
        f_b[:, 0] += self.force_step * stepped
        f_b[:, 2] += self.shaking_m_s2 * sign
        stamps = np.round(t_s * 1e6).astype(np.int64)
        nothing = np.full(f_b.shape, np.nan)
        return ImuTrack(self.imu, "IMU", t_s, stamps, w_b * DEG, f_b, nothing)


def found_on(*boards: Board, sigma_deg=0.3, armed=ARMED, in_flight=()) -> list[Finding]:
    t_s = boards[0].track().t_s
    q_nb = exponential(np.outer(t_s, (0.0, 0.0, boards[0].turn_deg_s * DEG)))
    best = attitudes(t_s, q_nb)._replace(
        sigma_tilt_rad=np.full(len(t_s), sigma_deg * DEG), sigma_heading_rad=np.zeros(len(t_s))
    )
    tracks = tuple(board.track() for board in boards)
    return detect_biases(tracks, best, armed, in_flight)[1]


@pytest.mark.parametrize(
    ("too_little", "enough", "kind"),
    [
        # Beyond any data sheet, in three windows.
        (Board((1.3, -1.0, 1.0)), Board((1.4, -1.1, 1.0)), "gyro_bias"),
        (Board(step_deg_s=3.0, until_s=69.5), Board(step_deg_s=3.0, until_s=75.5), "gyro_bias"),
        # 1 % of scale is as much.
        (Board((3.0, 0.0, 0.0), turn_deg_s=41.0), Board((3.0, 0.0, 0.0), turn_deg_s=38.0),
         "gyro_bias"),
        # A step within ten seconds, between three steady windows on either side.
        (Board(step_deg_s=0.69), Board(step_deg_s=0.71), "gyro_bias_step"),
        (Board(step_deg_s=1.5, step_s=109.0), Board(step_deg_s=1.5, step_s=99.0), "gyro_bias_step"),
        (Board(step_deg_s=1.5, until_s=69.0), Board(step_deg_s=1.5, until_s=76.0),
         "gyro_bias_step"),
        (Board(step_deg_s=1.5, lost_s=(56.0, 131.0), seconds=220.0, step_s=100.0),
         Board(step_deg_s=1.5, lost_s=(56.0, 114.0), seconds=220.0, step_s=80.0),
         "gyro_bias_step"),
        # A tenth of a second without a sample may hide a turn: in all windows, in one of three.
        (Board((3.0, 0.0, 0.0), period_s=0.101), Board((3.0, 0.0, 0.0), period_s=0.099),
         "gyro_bias"),
        (Board((3.0, 0.0, 0.0), seconds=15.5, period_s=0.048, lost_s=(7.0, 7.06)),
         Board((3.0, 0.0, 0.0), seconds=15.5, period_s=0.048, lost_s=(7.0, 7.03)), "gyro_bias"),
        # Slow samples of a vibration: 0.3 deg/s of the mean of 100 that change their sign.
        (Board((3.0, 0.0, 0.0), shaking_deg_s=2.2), Board((3.0, 0.0, 0.0), shaking_deg_s=2.0),
         "gyro_bias"),
    ],
)  # fmt: skip
def test_what_a_gyro_shows_against_an_attitude(too_little, enough, kind):
    assert kind not in {one.kind for one in found_on(too_little)}
    assert kind in {one.kind for one in found_on(enough)}


def test_a_bias_has_its_times_and_axes():
    (one,) = found_on(Board((0.0, 2.5, -1.0), imu=1))
    assert one.text == "gyro bias 2.7 deg/s"
    assert one.evidence == (
        "(+0.0, +2.5, -1.0) deg/s about x, y, z, by the attitude over windows of 5 s; data sheets "
        "admit 2"
    )
    assert (one.source, one.unit, one.severity) == ("IMU 2", "deg/s", Severity.WARNING)
    assert (one.from_s, one.to_s) == pytest.approx((0.0, 115.0), abs=0.1)
    (step,) = found_on(Board(step_deg_s=-1.5))
    assert step.text == "gyro bias jumped by 1.5 deg/s"
    assert "(-1.5, " in step.evidence
    assert (step.from_s, step.to_s) == pytest.approx((52.5, 62.5), abs=0.1)
    assert not found_on(Board((3.0, 0.0, 0.0)), sigma_deg=4.1)
    assert found_on(Board((3.0, 0.0, 0.0)), sigma_deg=3.9)
    assert not found_on(Board((3.0, 0.0, 0.0), seconds=9.9))
    t_s = Board().track().t_s
    turned = attitudes(t_s, exponential(np.outer(t_s, (0.0, 0.0, 30.0 * DEG))))
    track = Board((0.5, 0.2, -0.1), turn_deg_s=30.0).track()
    biases, _ = detect_biases((track,), turned, ARMED, ())
    expected = np.tile((0.5, 0.2, -0.1), (23, 1))
    assert biases[0].gyro_b / DEG == pytest.approx(expected, abs=0.03)
    assert biases[0].t_s == pytest.approx(2.5 + 5.0 * np.arange(23), abs=0.06)
    biases, _ = detect_biases((track,), None, ARMED, ())
    assert len(biases[0].gyro_b) == 0
    assert biases[0].gyro_limit == 2.0 * DEG


@pytest.mark.parametrize(
    ("board", "is_told"),
    [
        (Board(force=GRAVITY_M_S2 * 1.079, seconds=5.0), False),
        (Board(force=GRAVITY_M_S2 * 1.081, seconds=5.0), True),
        (Board(force=GRAVITY_M_S2 * 0.919, seconds=5.0), True),
        (Board(force=11.0, seconds=2.9), False),
        (Board(force=11.0, seconds=3.1), True),  # three windows of a second
        (Board(force=11.0, shaking_m_s2=0.16, seconds=5.0), False),  # it is not at rest
        (Board(force=11.0, shaking_m_s2=0.14, seconds=5.0), True),
        (Board(force=11.0, shaking_deg_s=0.55, seconds=5.0), False),
        (Board(force=11.0, shaking_deg_s=0.45, seconds=5.0), True),
        (Board((2.8, 0.0, 0.0), force=11.0, seconds=5.0), False),
        (Board((2.6, 0.0, 0.0), force=11.0, seconds=5.0), True),
    ],
)
def test_what_an_accelerometer_shows_at_rest(board, is_told):
    found = [one for one in found_on(board, armed=()) if one.kind == "accelerometer_bias"]
    assert len(found) == is_told
    assert not found_on(board, armed=ARMED)
    if is_told:
        (one,) = found
        apart = board.force - GRAVITY_M_S2
        assert one.text == f"accelerometer shows {board.force:.2f} m/s^2 at rest"
        assert one.evidence.startswith(
            f"gravity is 9.81: {abs(apart) / GRAVITY_M_S2 * 1e3:.0f} mg of bias, or "
            f"{apart / GRAVITY_M_S2:+.1%} of scale, over {int(board.seconds - 0.06)} s at rest; "
            "data sheets admit 80 mg"
        )
        assert one.size == pytest.approx(abs(apart))
        assert (one.from_s, one.to_s) == pytest.approx((0.5, int(board.seconds - 0.06) - 0.5))


SOUND = Board()


@pytest.mark.parametrize(
    ("boards", "told"),
    [
        ((SOUND, Board(step_deg_s=1.95)), []),
        ((SOUND, Board(step_deg_s=2.05)), ["gyro_apart"]),
        ((SOUND, Board(force_step=0.74)), []),
        ((SOUND, Board(force_step=0.76)), ["accelerometer_apart"]),
        ((SOUND, Board(force_step=2.0, until_s=70.0)), []),  # two windows
        ((SOUND, Board(force_step=2.0, until_s=75.0)), ["accelerometer_apart"]),
        ((SOUND, Board(force_step=2.0, period_s=0.11)), []),  # fewer than 50 samples in each
        ((Board(seconds=14.9), Board(force_step=2.0, step_s=-1.0)), []),
        ((Board(seconds=15.2), Board(force_step=2.0, step_s=-1.0)), ["accelerometer_apart"]),
        ((SOUND,), []),
        ((SOUND, Board(force_step=2.0, lost_s=(70.4, 99.9))), ["accelerometer_apart"]),
    ],
)
def test_how_far_two_sensors_may_differ(boards, told):
    boards = [board._replace(imu=imu) for imu, board in enumerate(boards)]
    found = [one.kind for one in found_on(*boards) if "apart" in one.kind]
    assert found == told


def test_sensors_that_differ_are_told_with_what_is_known():
    boards = [board._replace(imu=imu) for imu, board in enumerate((SOUND, Board(force_step=2.0)))]
    (one,) = found_on(*boards)
    assert one.text == "accelerometers differ by 2.0 m/s^2"
    assert one.evidence == (
        "means of 5 s, 11 of them beyond 0.75 m/s^2; which of the two is wrong is not known from "
        "this"
    )
    assert one.source == "IMU 1 or IMU 2"
    assert (one.from_s, one.to_s) == pytest.approx((60.0, 115.0), abs=0.2)
    third = SOUND._replace(imu=2)
    (odd,) = found_on(*boards, third)
    assert (odd.text, odd.source) == (
        "accelerometer differs from IMU 1 and IMU 3 by 2.0 m/s^2", "IMU 2",
    )  # fmt: skip
    shaken = Finding(
        Kind.VIBRATION, Sensor(SensorKind.IMU, 2), Severity.WARNING, 1.0, 2.0, 1.0, "", "", ""
    )
    (known,) = found_on(*boards, in_flight=(shaken,))
    assert known.text == "accelerometer differs from IMU 1 by 2.0 m/s^2"
    (elsewhere,) = found_on(*boards, in_flight=(shaken._replace(kind=Kind.GYRO_BIAS),))
    assert elsewhere.text == one.text


def test_what_a_sensor_does_not_measure_has_no_bias():
    frozen = Finding(
        Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, 1), Severity.ERROR, 50.0, 60.0, 1.0, "", "", ""
    )
    track = Board().track()
    kept = measuring(track, (frozen,)).t_s
    assert not ((kept >= 45.0) & (kept <= 65.0)).any()
    assert (kept[kept < 55.0][-1], kept[kept > 55.0][0]) == pytest.approx((44.95, 65.05))
    for other in (
        frozen._replace(sensor=Sensor(SensorKind.IMU, 2)), frozen._replace(kind=Kind.VIBRATION),
    ):  # fmt: skip
        assert len(measuring(track, (other,)).t_s) == len(track.t_s)
