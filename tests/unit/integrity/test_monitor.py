"""The monitor beside the real filter: it is silent on honest sensors and names wrong ones."""

import itertools
import math
from random import Random

import pytest
from lanes import few_rows
from monitored_flights import flown
from needs import DEG
from synthetic_imu import FIELD, FIELD_N
from velocity_flights import (
    FLYING,
    PERIOD,
    accelerating,
    new_filter,
    turning,
    with_iron,
    with_noise,
    with_samples,
    with_turned_compass,
    with_turned_field,
)

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, SensorErrors, Trust, VelocityFix
from h2nav.integrity.causes import NOTHING, Cause, Explained
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.sensor_checks import Use
from h2nav.maths import quaternion

FAULT_S = 40.0
END_S = 70.0
REST = (0.0, 0.0, 0.0)


def flight(seed=7, end_s=END_S):
    return with_noise(accelerating(end_s, seed, law=turning), 0.2, seed)


def climbed(drive):
    """Altitude of each sample, m."""
    return [-height for height in itertools.accumulate(0.01 * down for _, _, down in drive.v_n)]


def tilt_error(q_nb, estimate):
    turn_n = quaternion.multiply(estimate.q_nb, quaternion.conjugate(q_nb))
    return quaternion.tilt_and_heading(turn_n)[0]


def watched(drive, velocity_at=lambda t_s, v_n: v_n, gps=True):
    """(time, alarms, tilt error, opened deviation) five times a second."""
    rows = []
    for i, (t_s, use, estimate, monitor) in enumerate(flown(drive, velocity_at, gps)):
        t_us = drive.flight.samples[i].t_us
        if use is Use.NONE:
            rows.append((t_s, monitor.alarms(t_us), 0.0, math.pi))
        elif estimate is not None and i % PERIOD == 0:
            tilt_rad = tilt_error(drive.flight.q_nb[i], estimate)
            opened_rad = monitor.opened(estimate).sigma_tilt_rad
            rows.append((t_s, monitor.alarms(t_us), tilt_rad, opened_rad))
    return rows


def sent(drive):
    """(time, tilt error, estimate with its opened deviations) of each sample that is used."""
    for q_nb, (t_s, _, estimate, monitor) in zip(drive.flight.q_nb, flown(drive), strict=True):
        if estimate is not None:
            yield t_s, tilt_error(q_nb, estimate), monitor.opened(estimate)


def first_alarm(rows, kind):
    """Seconds from the fault to the first alarm of a kind; None without one."""
    times = [t_s for t_s, alarms, _, _ in rows if any(a.kind == kind for a in alarms)]
    return times[0] - FAULT_S if times else None


def with_turning_field(drive):
    """The same flight in a field that turns by 10 deg/s about the vertical from the fault on."""

    def turned(i, sample):
        angle = 10.0 * DEG * max(sample.t_us * 1e-6 - FAULT_S, 0.0)
        field_n = quaternion.rotate(quaternion.from_euler(0.0, 0.0, angle), FIELD_N)
        return sample._replace(
            m_b_ut=quaternion.rotate(quaternion.conjugate(drive.flight.q_nb[i]), field_n)
        )

    return with_samples(drive, turned)


def from_fault(change):
    """A drive whose samples are changed from the fault on."""
    return with_samples(
        flight(), lambda i, sample: change(sample) if sample.t_us >= FAULT_S * 1e6 else sample
    )


def pushed(force):
    return lambda s: s._replace(f_b=(s.f_b[0] + force, *s.f_b[1:]))


def turned_by(rate_deg_s):
    return lambda s: s._replace(w_b=(s.w_b[0] + rate_deg_s * DEG, *s.w_b[1:]))


@pytest.mark.parametrize(
    ("change", "kind", "named_s", "most_deg"),
    [
        (pushed(3.0), Kind.ACCELEROMETER_BIAS_STEP, 6.0, 2.5),
        (pushed(-5.0), Kind.ACCELEROMETER_BIAS_STEP, 6.0, 2.5),
        # Velocities show within a second when a gyro failed, and by how much within a tenth of it.
        (turned_by(5.0), Kind.GYRO_BIAS_STEP, 6.0, 3.5),
    ],
)
def test_what_a_sensor_was_found_to_be_wrong_by_no_longer_bends_the_tilt(
    change, kind, named_s, most_deg
):
    rows = watched(from_fault(change))
    assert 0.0 < first_alarm(rows, kind) < named_s
    after = [(tilt, opened) for t_s, _, tilt, opened in rows if t_s > FAULT_S + named_s + 1.0]
    assert max(tilt for tilt, _ in after) < most_deg * DEG
    assert all(tilt < 2.0 * opened for tilt, opened in after)
    # The sensor is wrong as before, and is told to be.
    _, alarms, _, _ = rows[-1]
    assert any(alarm.kind == kind for alarm in alarms)


@pytest.mark.parametrize("change", [pushed(3.0), turned_by(5.0)])
def test_nothing_is_taken_off_a_sensor_that_shows_what_another_imus_shows(change):
    told = set()
    for t_s, _, _, monitor in flown(from_fault(change)):
        monitor.use_agreed(gyro=True, accelerometer=True)
        told |= {alarm.kind for alarm in monitor.alarms(round(t_s * 1e6))}
    assert not told & {Kind.ACCELEROMETER_BIAS_STEP, Kind.GYRO_BIAS_STEP}
    assert told  # that something contradicts is said


@pytest.mark.thorough
def test_what_was_learnt_from_a_velocity_that_is_false_turns_the_attitude_no_further():
    def ramp(t_s, v_n):
        return (v_n[0] + 0.7 * max(t_s - FAULT_S, 0.0), *v_n[1:])

    rows = watched(flight(seed=8), ramp)
    refused_s = first_alarm(rows, Kind.GPS_VELOCITY)
    assert refused_s is not None
    before = [tilt for t_s, _, tilt, _ in rows if t_s < FAULT_S + refused_s]
    after = [tilt for t_s, _, tilt, _ in rows if t_s > FAULT_S + refused_s + 1.0]
    assert max(before) > 4.0 * DEG
    assert max(after) < 2.5 * DEG


@pytest.mark.parametrize(("share", "is_refused"), [(0.3, False), (0.6, True)])
def test_a_decision_counts_while_later_windows_share_it(monkeypatch, share, is_refused):
    decided = Explained(20.0, ((Cause.VELOCITY, 0.9999),))
    later = Explained(20.0, ((Cause.VELOCITY, share), (Cause.ACCELEROMETER, 0.99 - share)))

    def explain(rows, known, *_, **__):
        t_s = known.moment.t_us * 1e-6 - FAULT_S
        return decided if 0.0 < t_s < 1.5 else later if t_s > 0.0 else NOTHING

    monkeypatch.setattr("h2nav.integrity.cause_search.explain", explain)

    def jump(t_s, v_n):
        return (v_n[0] + (5.0 if t_s > FAULT_S else 0.0), *v_n[1:])

    refused = [monitor.velocity_is_false for *_, monitor in flown(flight(end_s=46.0), jump)]
    assert any(refused) is is_refused


def test_a_fault_that_ends_is_taken_back():
    drive = with_samples(
        flight(end_s=90.0),
        lambda i, s: pushed(3.0)(s) if FAULT_S * 1e6 <= s.t_us < 65e6 else s,
    )
    rows = watched(drive)
    assert max(tilt for t_s, _, tilt, _ in rows if 46.0 < t_s < 65.0 or t_s > 71.0) < 2.5 * DEG
    _, alarms, _, _ = rows[-1]
    assert not any(alarm.kind == Kind.ACCELEROMETER_BIAS_STEP for alarm in alarms)


@pytest.mark.parametrize("gps", [True, False])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_honest_sensors_raise_nothing(gps, seed):
    assert all(not alarms for _, alarms, _, _ in watched(flight(seed), gps=gps))


def test_a_zero_of_the_accelerometer_that_is_known_contradicts_nothing_and_opens_the_tilt():
    """50 mg, which the filter has learnt after half a minute of turns."""
    drive = with_samples(
        flight(), lambda _, s: s._replace(f_b=(s.f_b[0] + 0.5, s.f_b[1] - 0.5, s.f_b[2]))
    )
    later = [
        (monitor.ratios.of_velocity, monitor.opened(estimate).sigma_tilt_rad)
        for t_s, _, estimate, monitor in flown(drive)
        if t_s > FAULT_S
    ]
    assert max(ratio for ratio, _ in later) < 0.8
    assert min(sigma_rad for _, sigma_rad in later) > 1.5 * DEG


@pytest.mark.parametrize("gps", [True, False])
def test_swapped_axes_are_a_gyro_that_contradicts(gps):
    rows = watched(from_fault(lambda s: s._replace(w_b=(s.w_b[1], s.w_b[0], s.w_b[2]))), gps=gps)
    assert 0.0 <= first_alarm(rows, "gyro_field") < 12.0
    if gps:
        assert 0.0 <= first_alarm(rows, "attitude_velocity") < 5.0


@pytest.mark.parametrize(("hz", "within_s"), [(5.0, 3.5), (0.5, 11.0)])
def test_velocities_that_no_longer_come_are_told_and_do_not_degrade(hz, within_s):
    drive = flight()
    every = round(100.0 / hz)
    filter_, monitor = (
        new_filter(knows_field=True),
        Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0)),
    )
    told = []
    for i, sample in enumerate(drive.flight.samples):
        t_s = sample.t_us * 1e-6
        if i % every == 0 and not FAULT_S < t_s < FAULT_S + 15.0:
            monitor.fix(VelocityFix(sample.t_us, drive.v_n[i], 0.3), filter_.sensor_errors)
        monitor.check(sample)
        estimate = filter_.update(sample)
        if estimate is not None:
            monitor.add(sample, estimate)
        lost = [a for a in monitor.alarms(sample.t_us) if a.kind == "velocity_lost"]
        assert not any(alarm.degrades for alarm in lost)
        told += [t_s] if lost else []
    assert FAULT_S + 2.5 < told[0] < FAULT_S + within_s
    assert told[-1] < FAULT_S + 15.1 + 1.0 / hz


def test_a_wrong_yaw_rate_and_a_field_that_turns_are_not_told_apart():
    rows = watched(with_turning_field(flight()), gps=False)
    told = [a for _, alarms, _, _ in rows for a in alarms]
    either = [a for a in told if "a wrong yaw rate, or a field near" in a.evidence]
    assert {alarm.kind for alarm in either} == {"compass_field"}
    assert all(alarm.degrades for alarm in either)
    assert sum(a.kind == "gyro_field" for a in told) < 0.1 * len(either)
    swapped = from_fault(lambda s: s._replace(w_b=(s.w_b[1], s.w_b[0], s.w_b[2])))
    told = [a for _, alarms, _, _ in watched(swapped, gps=False) for a in alarms]
    both = ["both have turned" in a.evidence for a in told if a.kind == "gyro_field"]
    assert sum(both) > 0.5 * len(both) > 0.0


def test_iron_that_the_filter_knows_opens_no_tilt():
    """The field of a compass with iron turns in space as the vehicle turns."""
    rows = watched(with_iron(flight(), (0.05, -0.1, 0.04)))
    assert not any(alarms for _, alarms, _, _ in rows)
    assert max(opened for t_s, _, _, opened in rows if t_s > 30.0) < 4.0 * DEG


def test_swapped_axes_are_told_beside_iron_that_the_filter_knows():
    drive = from_fault(lambda s: s._replace(w_b=(s.w_b[1], s.w_b[0], s.w_b[2])))
    rows = watched(with_iron(drive, (0.05, -0.1, 0.04)))
    assert 0.0 <= first_alarm(rows, "attitude_velocity") < 5.0
    assert 0.0 <= first_alarm(rows, "gyro_field") < 12.0


@pytest.mark.parametrize("turn_deg", [60.0, 90.0, 180.0])
def test_a_compass_that_comes_loose_is_the_compass_and_not_the_gyro(turn_deg):
    rows = watched(with_turned_compass(flight(), turn_deg * DEG, FAULT_S))
    assert 0.0 <= first_alarm(rows, "compass_field") < 5.0
    assert first_alarm(rows, "gyro_field") is None


def test_a_gyro_step_is_told_and_the_deviation_opens():
    step = 10.0 * DEG
    rows = watched(from_fault(lambda s: s._replace(w_b=(s.w_b[0] + step, *s.w_b[1:]))))
    told_s = first_alarm(rows, "attitude_velocity")
    assert 0.0 <= told_s < 5.0
    beyond = [tilt > 3.0 * opened for t_s, _, tilt, opened in rows if t_s > FAULT_S]
    assert sum(beyond) < 0.1 * len(beyond)


def test_a_ramp_of_the_velocity_is_told():
    def ramp(t_s, v_n):
        return (v_n[0] + 3.0 * max(t_s - FAULT_S, 0.0), *v_n[1:])

    rows = watched(flight(), ramp)
    assert 0.0 <= first_alarm(rows, "attitude_velocity") < 4.0
    assert max(tilt for t_s, _, tilt, _ in rows if t_s > FAULT_S) < 4.0 * DEG


@pytest.mark.parametrize("drift_m_s2", [0.7, 0.0])
def test_vibration_that_does_not_last_hides_no_drift_of_the_velocity(drift_m_s2):
    """Of 37 Hz and 4 m/s^2 rms, in samples at 100 Hz, as earlier velocities have shown."""
    drifts_s = 75.0

    def shaken(i, sample):
        if i < PERIOD:
            return sample  # it begins with a known tilt
        phase = 2.0 * math.pi * 37.3 * 0.01 * i
        x, y, z = (part + 6.0 * math.sin(phase + k) for k, part in enumerate(sample.f_b))
        return sample._replace(f_b=(x, y, z))

    def ramp(t_s, v_n):
        return (v_n[0] + drift_m_s2 * max(t_s - drifts_s, 0.0), *v_n[1:])

    rows = watched(with_samples(flight(end_s=drifts_s + 15.0), shaken), ramp)
    told = {alarm.kind: t_s for t_s, alarms, _, _ in reversed(rows) for alarm in alarms}
    if drift_m_s2 == 0.0:
        assert not told
        return
    assert told[Kind.ATTITUDE_VELOCITY] < drifts_s + 6.0
    assert told[Kind.GPS_VELOCITY] < drifts_s + 12.0


def test_a_velocity_that_comes_back_from_a_false_one_is_not_called_false():
    back_s = FAULT_S + 15.0

    def spoofed(t_s, v_n):
        return (v_n[0] + (5.0 if FAULT_S <= t_s < back_s else 0.0), *v_n[1:])

    told = {
        t_s
        for t_s, alarms, _, _ in watched(flight(), spoofed)
        if any(alarm.kind is Kind.GPS_VELOCITY for alarm in alarms)
    }
    assert FAULT_S < min(told) < FAULT_S + 4.0
    assert max(told) < back_s + 0.5


@pytest.mark.parametrize("false_s", [8.0, 15.0])
def test_a_way_back_excuses_one_jump_and_not_the_next_falsehood(false_s):
    again_s = FAULT_S + false_s + 25.0
    back_s = again_s + 15.0

    def spoofed(t_s, v_n):
        is_false = FAULT_S <= t_s < FAULT_S + false_s or again_s <= t_s < back_s
        return (v_n[0] + (5.0 if is_false else 0.0), *v_n[1:])

    told = [
        t_s
        for t_s, alarms, _, _ in watched(flight(end_s=back_s + 10.0), spoofed)
        if t_s > again_s and any(alarm.kind is Kind.GPS_VELOCITY for alarm in alarms)
    ]
    assert told[0] < again_s + 2.0
    assert back_s - 0.5 < told[-1] < back_s + 0.5


@pytest.mark.parametrize(
    ("drift_m_s2", "force_m_s2", "may_be_bent"),
    [(0.0, 0.0, False), (0.7, 0.0, True), (0.0, 2.0, True)],
)
def test_an_attitude_that_may_be_bent_is_known(drift_m_s2, force_m_s2, may_be_bent):
    """By a velocity that drifts, or by an accelerometer that is decided to be wrong."""

    def ramp(t_s, v_n):
        return (v_n[0] + drift_m_s2 * max(t_s - FAULT_S, 0.0), *v_n[1:])

    pushed = from_fault(lambda s: s._replace(f_b=(s.f_b[0] + force_m_s2, *s.f_b[1:])))
    *_, (_, _, _, monitor) = flown(pushed, ramp)
    assert monitor.may_be_bent is may_be_bent


def test_velocities_that_contradicted_an_attitude_do_not_speak_for_it_soon_after():
    """Nobody was named, as a window without a heading shows no cause, and it was bent meanwhile."""

    def jumps(t_s, v_n):
        return (v_n[0] + (6.0 if FAULT_S <= t_s < FAULT_S + 10.0 else 0.0), *v_n[1:])

    drive = flight(end_s=FAULT_S + 15.0)
    drive = with_samples(drive, lambda _, s: s._replace(m_b_ut=None))
    rows = [(t_s, monitor.may_be_bent) for t_s, _, _, monitor in flown(drive, jumps)]
    assert not any(is_bent for t_s, is_bent in rows if t_s < FAULT_S)
    assert all(is_bent for t_s, is_bent in rows if t_s > FAULT_S + 3.0)


def test_a_turned_field_is_the_compass_and_not_the_gyro():
    rows = watched(with_turned_field(flight(), 50.0 * DEG, FAULT_S, END_S))
    assert 0.0 <= first_alarm(rows, "compass_field") < 5.0
    assert first_alarm(rows, "attitude_velocity") is None


def test_a_reversed_field_does_not_degrade_a_heading_that_was_confirmed():
    rows = watched(from_fault(lambda s: s._replace(m_b_ut=tuple(-m for m in s.m_b_ut))))
    assert 0.0 <= first_alarm(rows, "compass_field") < 3.0
    compass = [a for _, alarms, _, _ in rows for a in alarms if a.kind == "compass_field"]
    assert not any(alarm.degrades for alarm in compass)


def test_an_accelerometer_of_twice_the_scale_is_found_without_velocities():
    rows = watched(from_fault(lambda s: s._replace(f_b=tuple(2.0 * f for f in s.f_b))), gps=False)
    assert 0.0 <= first_alarm(rows, "attitude_gravity") < 12.0


def test_a_vehicle_that_has_braked_and_landed_without_a_receiver_is_upright():
    """Within the 10 s before it was in the air, where it may change its speed by more."""
    landed_s = 30.0

    def brakes(t_s):
        return (-1.0 if landed_s - 12.0 <= t_s < landed_s else 0.0, 0.0, 0.0)

    def stands(_):
        return (0.0, 0.0, 0.0)

    drive = accelerating(landed_s + 15.0, 7, force=brakes, law=stands)
    ratios = []
    for t_s, _, _, monitor in flown(drive, gps=False):
        monitor.use_vehicle(FLYING._replace(on_ground=t_s >= landed_s))
        ratios.append(monitor.ratios.force_10s)
    assert max(ratio for ratio in ratios if not math.isnan(ratio)) < 1.0


def too_large(i, sample):
    """A force of 1.2 times its size from the fault on."""
    if i < 100 * FAULT_S:
        return sample
    x, y, z = sample.f_b
    return sample._replace(f_b=(1.2 * x, 1.2 * y, 1.2 * z))


@pytest.mark.parametrize(
    ("other_m_s2", "on_ground", "is_told"),
    few_rows(2, [(0.1, False, True), (1.9, False, False), (-1.9, False, True), (0.1, True, False)]),
)
def test_a_force_that_became_too_large_for_velocity_and_altitude_is_its_scale(
    other_m_s2, on_ground, is_told
):
    """Unless that of another IMU did as well, or it stands on the ground."""
    drive = with_samples(with_noise(accelerating(50.0, 3), 0.1, 3), too_large)
    texts = set()
    for i, (t_s, _, _, monitor) in enumerate(flown(drive, altitudes=climbed(drive))):
        if i % PERIOD == 0:
            monitor.use_other_excesses((other_m_s2,))
            monitor.use_vehicle(FLYING._replace(on_ground=on_ground))
            texts |= {alarm.text for alarm in monitor.alarms(round(1e6 * t_s))}
    assert ("accelerometer's scale is off by 20%" in texts) == is_told
    assert monitor.may_be_bent or not is_told


def test_without_a_receiver_a_force_is_not_called_wrong_for_ever():
    lost_s = FAULT_S + 12.0
    drive = with_samples(with_noise(accelerating(lost_s + 40.0, 3), 0.1, 3), too_large)
    told = [
        t_s
        for t_s, _, _, monitor in flown(drive, altitudes=climbed(drive), gps_until_s=lost_s)
        if monitor.force_error is not None
    ]
    assert min(told) < lost_s
    assert max(told) < lost_s + 31.0


@pytest.mark.parametrize(
    ("scale", "turns_rad_s", "text"),
    [
        (0.8, 0.0, "force contradicts gravity"),
        (1.4, 0.0, "force contradicts gravity"),
        (1.0, 0.3, "attitude contradicts gravity"),
    ],
)
def test_a_wrong_accelerometer_and_a_wrong_attitude_are_told_apart(scale, turns_rad_s, text):
    drive = from_fault(
        lambda sample: sample._replace(
            w_b=(sample.w_b[0] + turns_rad_s, *sample.w_b[1:]),
            f_b=tuple(scale * value for value in sample.f_b),
        )
    )
    alarms = [a for _, found, _, _ in watched(drive, gps=False) for a in found]
    texts = [alarm.text for alarm in alarms if alarm.kind == "attitude_gravity"]
    assert texts
    assert texts.count(text) > 0.8 * len(texts)


def test_a_frozen_imu_is_told_at_once():
    held = flight().flight.samples[4000]
    rows = watched(from_fault(lambda s: s._replace(w_b=held.w_b, f_b=held.f_b)))
    assert 0.0 <= first_alarm(rows, "imu_frozen") < 0.2


@pytest.mark.parametrize(
    ("began_on_ground", "lands", "is_told"),
    [(False, True, False), (False, False, True), (True, True, True)],
)
def test_what_was_only_seen_in_the_air_accuses_no_sensor_on_the_ground(
    began_on_ground, lands, is_told
):
    """In whole mrad/s and mg, of which a resting sensor has hardly one of noise."""
    monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    monitor.use_vehicle(FLYING._replace(on_ground=began_on_ground))
    monitor.use_vehicle(FLYING)
    random = Random(5)
    for i in range(4000):
        monitor.check(coarse(i, lambda: random.gauss(0.0, 0.005)))
    monitor.use_vehicle(FLYING._replace(on_ground=lands))
    for i in range(4000, 4100):
        monitor.check(coarse(i, lambda: 0.0))
    assert monitor.sensor_is_bad == is_told


def coarse(i, noise):
    """A sample of a vehicle that hovers, in the units of RAW_IMU."""
    p, q, r, x, y, z = [1e-3 * round(1e3 * noise()) for _ in range(6)]
    return ImuSample(10_000 * i, (p, q, r), (9.8 * x, 9.8 * y, 9.8 * (z - 1.0)), None)


@pytest.mark.parametrize("lasts_s", [0.07, 10.0])
def test_the_deviations_open_before_it_is_certain_that_a_gyro_is_dead(lasts_s):
    """It turns fast, and then reads zero: for a moment, or for good."""

    def dead(_, sample):
        is_dead = 0.0 <= sample.t_us * 1e-6 - FAULT_S < lasts_s
        return sample._replace(w_b=(0.0, 0.0, 0.0)) if is_dead else sample

    drive = accelerating(FAULT_S + 1.0, 7, law=lambda t: turning(t) if t > 10.0 else REST)
    rows = [
        (t_s - FAULT_S, tilt, estimate.sigma_tilt_rad)
        for t_s, tilt, estimate in sent(with_samples(drive, dead))
    ]
    before = [sigma for since_s, _, sigma in rows if -1.0 < since_s < 0.0]
    wrong = [(tilt, sigma) for since_s, tilt, sigma in rows if since_s >= 0.0]
    assert max(before) < 1.1 * DEG
    assert max(tilt for tilt, _ in wrong) > 2.2 * max(before)
    assert all(tilt < 2.0 * sigma for tilt, sigma in wrong)


def test_a_field_that_turns_about_the_vertical_opens_the_heading_alone():
    drive = with_noise(accelerating(END_S, 7, force=lambda _: REST), 0.2, 7)
    opened = [one for t_s, _, one in sent(with_turning_field(drive)) if t_s > FAULT_S]
    assert max(one.sigma_heading_rad for one in opened) > 20.0 * DEG
    assert max(one.sigma_tilt_rad for one in opened) < 3.0 * DEG


def test_after_a_reboot_it_watches_as_before():
    """The samples' clock begins anew, far before the newest sample."""
    drive = flight()
    later = with_samples(drive, lambda i, s: s._replace(t_us=s.t_us + 3_600_000_000))
    monitor, filter_ = (
        Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0)),
        new_filter(knows_field=True),
    )
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    for sample in later.flight.samples[:2000]:
        monitor.check(sample)
        if (estimate := filter_.update(sample)) is not None:
            monitor.add(sample, estimate)
    monitor, filter_ = monitor.anew(), new_filter(knows_field=True)
    for sample in drive.flight.samples[:2000]:
        monitor.check(sample)
        if (estimate := filter_.update(sample)) is not None:
            monitor.add(sample, estimate)
    assert 0.0 < monitor.ratios.field_10s < 1.0
    held = drive.flight.samples[2000]
    for i in range(20):
        monitor.check(held._replace(t_us=held.t_us + 10_000 * i))
    assert [alarm.kind for alarm in monitor.alarms(held.t_us)] == ["imu_frozen"]


def test_a_filter_without_deviations_of_its_own_is_watched_as_well():
    """As `constant_gain`; its attitude is wrong by 30 deg from the fault on."""
    drive, monitor = flight(), Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    wrong = quaternion.from_euler(30.0 * DEG, 0.0, 0.0)
    raised = []
    for i, (sample, q_nb) in enumerate(zip(drive.flight.samples, drive.flight.q_nb, strict=True)):
        t_s = sample.t_us * 1e-6
        told = quaternion.multiply(wrong, q_nb) if t_s >= FAULT_S else q_nb
        rate = tuple(w - b for w, b in zip(sample.w_b, drive.flight.bias_b, strict=True))
        nothing = (0.0, 0.0, 0.0)
        estimate = AttitudeEstimate(
            sample.t_us, told, rate, drive.flight.bias_b, nothing, math.nan, Trust.ALIGNED
        )
        monitor.check(sample)
        monitor.add(sample, estimate)
        if i % PERIOD == 0:
            monitor.fix(VelocityFix(sample.t_us, drive.v_n[i], 0.3), SensorErrors((0.0, 0.0, 0.0)))
            kinds = [alarm.kind for alarm in monitor.alarms(sample.t_us)]
            raised += [t_s] if "attitude_velocity" in kinds else []
            assert math.isnan(monitor.opened(estimate).sigma_tilt_rad)
    assert 0.0 <= raised[0] - FAULT_S < 8.0


def test_a_velocity_is_not_lost_while_nothing_at_all_is_heard():
    """A link that is cut for 4 s; then samples come again, and the next fix a second later."""

    def kinds_after(*sample_s):
        monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
        monitor.fix(VelocityFix(0, (1.0, 0.0, 0.0), 0.3), SensorErrors((0.0, 0.0, 0.0)))
        for t_s in sample_s:
            shaken = 0.1 * math.sin(50.0 * t_s)
            force = (shaken, -shaken, -9.81 + shaken)
            monitor.check(ImuSample(round(t_s * 1e6), (shaken, shaken, -shaken), force))
        return {alarm.kind for alarm in monitor.alarms(round(sample_s[-1] * 1e6))}

    before = [0.02 * i for i in range(50)]
    after = [5.0 + 0.02 * i for i in range(150)]
    assert Kind.VELOCITY_LOST not in kinds_after(*before, *after[:50])
    assert Kind.VELOCITY_LOST in kinds_after(*before, *after)


def test_what_begins_as_an_attitude_that_is_doubted_is_doubted_as_much():
    monitor = Monitor(Sensor(SensorKind.IMU, 2), Speeds(10.0))
    taken = AttitudeEstimate(0, (1.0, 0.0, 0.0, 0.0), REST, REST, REST, 0.5, Trust.ALIGNED, 0.75)
    monitor.open(taken.sigma_tilt_rad, taken.sigma_heading_rad)
    own = monitor.opened(taken._replace(sigma_tilt_rad=0.02, sigma_heading_rad=0.1))
    assert own.sigma_tilt_rad == pytest.approx(math.hypot(0.5, 0.02))
    assert own.sigma_heading_rad == pytest.approx(math.hypot(0.75, 0.1))


def scaled_gyro(drive, factor):
    """The same flight with rates times a factor from the fault on."""

    def change(i, sample):
        if i < 100.0 * FAULT_S:
            return sample
        return sample._replace(w_b=tuple(factor * rate for rate in sample.w_b))

    return with_samples(drive, change)


@pytest.mark.parametrize("others_agree", [False, True])
def test_a_gyro_of_another_scale_is_named_and_no_receiver_refused(others_agree):
    told, bad = set(), False
    for t_s, _, _, monitor in flown(scaled_gyro(flight(), 1.5)):
        monitor.use_agreed(gyro=others_agree, accelerometer=False)
        alarms = monitor.alarms(round(1e6 * t_s))
        scale = [alarm for alarm in alarms if alarm.kind is Kind.GYRO_SCALE]
        told |= {(alarm.sensor, alarm.text) for alarm in scale}
        bad |= monitor.sensor_is_bad
        assert not (scale and monitor.velocity_is_false)
        assert monitor.rate_factor == 1.0 or not others_agree
    assert bool(told) == bad == (not others_agree)
