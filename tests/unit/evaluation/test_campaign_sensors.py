"""Each error of a drawn sensor in closed form: where every draw is a one, it is its deviation."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.evaluation.campaign import sensors
from h2nav.evaluation.campaign.draw import (
    AccelerometerDraw,
    CompassDraw,
    Draw,
    FlightDraw,
    GyroDraw,
    ImuDraw,
    ReceiverDraw,
)
from h2nav.evaluation.campaign.receiver import fixes_of
from h2nav.evaluation.campaign.sensors import DrawnReadings, accelerometer, acts, compass, gyro
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.faults import FaultSchedule, parse_fault

T_S = np.array([0.0, 30.0, 60.0, 600.0])
RATE_RAD_S, FORCE_M_S2 = np.array((0.3, -0.2, 0.1)), np.array((1.0, 2.0, -GRAVITY_M_S2))
MILLI_G = 1e-3 * GRAVITY_M_S2


class Ones:
    """Draws that are all one deviation above the mean."""

    def standard_normal(self, size=()):
        return np.ones(size)


def truth(count, throttle=0.5):
    """Heading north, level."""
    return SimpleNamespace(
        w_b=np.tile(RATE_RAD_S, (count, 1)),
        f_b=np.tile(FORCE_M_S2, (count, 1)),
        v_n=np.tile((3.0, 4.0, 0.0), (count, 1)),
        to_ned=np.tile(np.eye(3), (count, 1, 1)),
        throttle=np.full(count, throttle),
    )


NO_GYRO = GyroDraw(
    noise_deg_s_rthz=0.0, bias_deg_s=0.0, walk_deg_s_rth=0.0, warm_up_deg_s_min=0.0,
    warm_up_min=5.0, scale_percent=0.0, misalignment_deg=0.0, g_sensitivity_deg_s_g=0.0,
    step_deg_s=0.0,
)  # fmt: skip
NO_FORCE = dict.fromkeys((field.name for field in dataclasses.fields(AccelerometerDraw)), 0.0)


@pytest.mark.parametrize(
    ("own", "error_deg_s"),
    [
        ({"bias_deg_s": 0.7}, np.full((4, 3), 0.7)),
        (
            {"warm_up_deg_s_min": 0.3, "warm_up_min": 0.5},
            0.3 * 0.5 * np.outer(1.0 - np.exp(-T_S / 30.0), np.ones(3)),
        ),
        ({"walk_deg_s_rth": 0.6}, np.outer((1, 2, 3, 4), np.full(3, 0.6 / 600.0))),
        ({"noise_deg_s_rthz": 0.01}, np.full((4, 3), 0.01 * math.sqrt(50.0))),
        (
            {"g_sensitivity_deg_s_g": 0.1},
            np.full((4, 3), 0.1 * (3.0 - GRAVITY_M_S2) / GRAVITY_M_S2),
        ),
        ({"scale_percent": 2.0}, np.tile(0.02 * RATE_RAD_S / DEG, (4, 1))),
        (
            {"misalignment_deg": 1.0},
            np.tile([(0.2 - rate) for rate in RATE_RAD_S], (4, 1)),
        ),
    ],
    ids=lambda each: next(iter(each)) if isinstance(each, dict) else "",
)
def test_errors_of_a_gyro(own, error_deg_s):
    """Its walk is per root hour; at 100 Hz a sample has the noise of 50 Hz."""
    found = gyro(dataclasses.replace(NO_GYRO, **own), truth(4), T_S, 100.0, Ones())
    assert (found - RATE_RAD_S) / DEG == pytest.approx(error_deg_s)


@pytest.mark.parametrize(
    ("own", "error_mg"),
    [
        ({"bias_mg": 5.0}, np.full((4, 3), 5.0)),
        ({"warm_up_mg": 8.0}, 8.0 * np.outer(1.0 - np.exp(-T_S / 300.0), np.ones(3))),
        ({"noise_ug_rthz": 100.0}, np.full((4, 3), 0.1 * math.sqrt(50.0))),
        ({"scale_percent": 2.0}, np.tile(0.02 * FORCE_M_S2 / MILLI_G, (4, 1))),
        (
            {"misalignment_deg": 1.0},
            np.tile(DEG * (3.0 - GRAVITY_M_S2 - FORCE_M_S2) / MILLI_G, (4, 1)),
        ),
    ],
)
def test_errors_of_an_accelerometer(own, error_mg):
    found = accelerometer(AccelerometerDraw(**NO_FORCE | own), truth(4), T_S, 100.0, Ones())
    assert (found - FORCE_M_S2) / MILLI_G == pytest.approx(error_mg)


def test_a_converter_gives_whole_steps():
    found = gyro(dataclasses.replace(NO_GYRO, step_deg_s=0.5), truth(1), T_S[:1], 100.0, Ones())
    assert found[0] / DEG == pytest.approx([17.0, -11.5, 5.5])
    found = accelerometer(
        AccelerometerDraw(**NO_FORCE | {"step_mg": 50.0}), truth(1), T_S[:1], 100.0, Ones()
    )
    assert found[0] / MILLI_G == pytest.approx([100.0, 200.0, -1000.0])


EARTH_N_UT = (20.0, 2.0, 43.0)
NO_COMPASS = {
    **dict.fromkeys(field.name for field in dataclasses.fields(CompassDraw)), "count": 1,
    "rate_hz": 10.0, "delay_ms": 0.0,
}  # fmt: skip


class Still:
    """A motion that stays where it is; it remembers when it was asked."""

    def __init__(self, away_m=0.0):
        self.away_m = away_m
        self.asked_s = None

    def at(self, t_s):
        self.asked_s = np.array(t_s)
        return truth(len(t_s))

    def position(self, t_s):
        return np.tile((0.0, self.away_m, 0.0), (len(t_s), 1))


def field_of(own, t_s=T_S, motion=None):
    values = {name: 0.0 if value is None else value for name, value in NO_COMPASS.items()}
    return compass(CompassDraw(**values | own), motion or Still(), EARTH_N_UT, t_s, Ones())


@pytest.mark.parametrize(
    ("own", "away_m", "field_ut"),
    [
        ({}, 0.0, (20.0, 2.0, 43.0)),
        ({"hard_iron_ut": 3.0}, 0.0, (23.0, 5.0, 46.0)),
        ({"noise_ut": 0.3}, 0.0, (20.3, 2.3, 43.3)),
        ({"motor_ut": 4.0}, 0.0, (22.0, 4.0, 45.0)),  # at half of the throttle
        ({"soft_iron_percent": 2.0}, 0.0, (21.3, 3.3, 44.3)),
        ({"steel_ut": 8.0}, 0.0, (28.0, 10.0, 51.0)),
        ({"steel_ut": 8.0}, 1.5 * math.sqrt(3.0), (21.0, 3.0, 44.0)),
        ({"turned_deg": 90.0}, 0.0, (2.0, -20.0, 43.0)),
        ({"step_ut": 3.0}, 0.0, (21.0, 3.0, 42.0)),
    ],
)
def test_errors_of_a_compass(own, away_m, field_ut):
    """Mounted to the right by an angle, it sees the field turned to the left."""
    found = field_of(own, np.array([0.0]), Still(away_m))
    assert found[0] == pytest.approx(field_ut)


def test_a_compass_is_read_at_its_own_rate_and_late():
    motion = Still()
    t_s = np.arange(1, 31) / 30.0
    found = field_of({"delay_ms": 50.0}, t_s, motion)
    new = np.flatnonzero(~np.isnan(found[:, 0]))
    assert new.tolist() == [0, *range(2, 30, 3)]
    assert motion.asked_s == pytest.approx(t_s[new] - 0.05)


def read(rows, fields=None):
    values = np.array(rows, dtype=float)
    nothing = np.zeros(len(values))
    own = np.full((len(values), 3), np.nan) if fields is None else np.array(fields, dtype=float)
    return DrawnReadings(
        nothing, nothing.astype(np.int64), values.copy(), values.copy(), own, nothing > 0.0
    )


def test_integers_are_cut_toward_zero_and_repeat_the_latest_field():
    found = read([(0.0019, -0.0019, 1.0), (0.0, 0.0, 0.0)], [(0.19, -0.29, 5.0), (np.nan,) * 3])
    sent = sensors._as_sent(found, Draw(1, imu=ImuDraw(form="integers")))
    assert sent.w_b[0] == pytest.approx((0.001, -0.001, 1.0))
    assert sent.f_b[0] / MILLI_G == pytest.approx((0.0, 0.0, 101.0))
    assert sent.m_b_ut == pytest.approx(np.tile((0.1, -0.2, 5.0), (2, 1)))
    plain = sensors._as_sent(found, Draw(1, imu=ImuDraw(form="floats")))
    assert plain.w_b[0].tolist() == [0.0019, -0.0019, 1.0]
    assert np.isnan(plain.m_b_ut[1]).all()


@pytest.mark.parametrize(("place", "value"), [(0, 1989.9 * DEG), (1, -1989.9 * DEG)])
def test_a_gyro_clips_ten_degrees_below_its_end(place, value):
    rows = np.zeros((3, 3))
    rows[0, place], rows[1, place] = value, 1.1 * value
    sent = sensors._as_sent(read(rows)._replace(f_b=np.zeros((3, 3))), Draw(1))
    assert sent.clipped.tolist() == [False, True, False]
    assert abs(sent.w_b[1, place]) == pytest.approx(1990.0 * DEG)


def test_faults_act_from_their_beginning_until_before_their_end():
    t_s = np.array([9.99, 10.0, 11.99, 12.0])
    assert acts(parse_fault("gyro-bias=5@10+2"), t_s).tolist() == [False, True, True, False]


# --- receiver -------------------------------------------------------------------------------------

FLIGHT = FlightDraw(length_min=1.0)


@pytest.mark.parametrize(
    ("own", "faults", "asked_s"),
    [
        ({"delay_s": 0.2}, (), 4.8),
        ({"delay_s": 0.2}, ("gps-lag=0.5@4+2",), 4.3),
        ({"delay_s": 2.0}, ("gps-lag=9@4+2",), 0.0),  # nothing was before the flight
    ],
)
def test_a_fix_is_of_the_motion_before(own, faults, asked_s):
    motion = Still()
    found = fixes_of(Draw(3, flight=FLIGHT, receiver=ReceiverDraw(**own), faults=faults), motion)
    assert found.t_s[:3] == pytest.approx([1.0, 1.2, 1.4])
    assert found.t_s[-1] < 80.0
    place = int(np.argmin(np.abs(found.t_s - 5.0)))
    assert motion.asked_s[place] == pytest.approx(asked_s)


def test_a_fix_has_noise_and_slow_errors_as_large_as_they_are_drawn():
    quiet = ReceiverDraw(noise_m_s=0.0, lever_arm_m=0.0)
    found = fixes_of(Draw(3, flight=FLIGHT, receiver=quiet), Still())
    assert found.v_n == pytest.approx(np.tile((3.0, 4.0, 0.0), (len(found.t_s), 1)))
    assert found.has_fix.all()
    noisy = dataclasses.replace(quiet, noise_m_s=0.3, noise_over_stated=2.0, rate_hz=25.0)
    found = fixes_of(Draw(3, flight=FLIGHT, receiver=noisy), Still())
    apart = found.v_n - (3.0, 4.0, 0.0)
    assert apart.std() == pytest.approx(0.3, rel=0.03)
    assert np.abs(np.corrcoef(apart[1:, 0], apart[:-1, 0])[0, 1]) < 0.1
    assert found.sigma_m_s == 0.15
    slow = dataclasses.replace(quiet, multipath_m_s=0.5)
    every = [fixes_of(Draw(k, flight=FLIGHT, receiver=slow), Still()).v_n for k in range(12)]
    apart = np.array(every) - (3.0, 4.0, 0.0)
    assert apart.std() == pytest.approx(0.5, rel=0.15)
    after_s = {lag: np.mean(apart[:, lag:] * apart[:, : -lag or None]) / 0.25 for lag in (50, 100)}
    assert after_s[50] == pytest.approx(math.exp(-0.5), abs=0.25)
    assert after_s[100] == pytest.approx(math.exp(-1.0), abs=0.25)


def test_an_antenna_off_the_centre_sees_the_turns():
    own = ReceiverDraw(noise_m_s=0.0, lever_arm_m=2.0)
    found = fixes_of(Draw(3, flight=FLIGHT, receiver=own), Still())
    apart = found.v_n - (3.0, 4.0, 0.0)
    assert np.ptp(apart, axis=0) == pytest.approx(0.0)
    assert apart @ RATE_RAD_S == pytest.approx(0.0)
    assert 0.0 < np.linalg.norm(apart[0]) <= 2.0 * np.linalg.norm(RATE_RAD_S)


def test_outages_last_as_long_as_they_are_drawn_and_come_after_the_rest():
    own = ReceiverDraw(outages_per_h=180.0, outage_s=4.0)
    shares = []
    for seed in range(15):
        found = fixes_of(Draw(seed, flight=FLIGHT, receiver=own), Still())
        assert found.has_fix[found.t_s < FLIGHT.rest_s].all()
        shares.append(1.0 - found.has_fix[found.t_s > FLIGHT.rest_s + 4.0].mean())
        lost = np.concatenate(([0], ~found.has_fix, [0])).astype(int)
        starts, ends = np.flatnonzero(np.diff(lost) > 0), np.flatnonzero(np.diff(lost) < 0)
        assert all(length >= 19 for length in (ends - starts)[ends < len(found.t_s)])
    expected = 1.0 - math.exp(-180.0 / 3600.0 * 4.0 * found.t_s[-1] / (found.t_s[-1] - 20.0))
    assert np.mean(shares) == pytest.approx(expected, rel=0.3)


def test_an_int16_of_milli_g_ends_at_32_g():
    found = read([(0.0, 0.0, 0.0)] * 2)._replace(f_b=MILLI_G * np.array([(4e4, -4e4, 3e4)] * 2))
    sent = sensors._as_sent(found, Draw(1, imu=ImuDraw(form="integers")))
    assert sent.f_b[0] / MILLI_G == pytest.approx((32_767.0, -32_767.0, 30_000.0))
    # without counts it ends at a hundred g
    far = found._replace(f_b=MILLI_G * np.array([(1.1e5, -1.1e5, 9e4)] * 2))
    sent = sensors._as_sent(far, Draw(1, imu=ImuDraw(form="floats")))
    assert sent.f_b[0] / MILLI_G == pytest.approx((1e5, -1e5, 9e4))
    assert sent.clipped.all()


def test_propellers_shake_a_vehicle_that_flies_alone():
    t_s = np.arange(0.0, 20.0, 0.001)
    moves = t_s >= 10.0
    found = sensors._vibration(t_s, moves, 3.0, np.random.default_rng(1))
    assert not found[~moves].any()
    assert np.abs(found).max(axis=0) == pytest.approx(3.0, rel=0.01)
    spectrum = np.abs(np.fft.rfft(found[moves], axis=0))
    lines_hz = np.fft.rfftfreq(int(moves.sum()), 0.001)[spectrum.argmax(axis=0)]
    assert lines_hz == pytest.approx((87.0, 113.0, 71.0), abs=0.2)


def test_a_fault_changes_the_rows_in_which_it_acts_and_a_field_only_where_it_is_new():
    rows = np.zeros((4, 3))
    fields = np.array([(20.0, 0.0, 40.0), (np.nan,) * 3, (21.0, 0.0, 40.0), (22.0, 0.0, 40.0)])
    t_s = np.array((0.0, 1.0, 2.0, 3.0))
    found = read(rows, fields)._replace(t_s=t_s)
    faults = [parse_fault("gyro-bias=5@1+2"), parse_fault("hard-iron=30@1+2")]
    sent = sensors._with_faults(found, FaultSchedule(faults))
    assert sent.w_b[:, 0] / DEG == pytest.approx((0.0, 5.0, 5.0, 0.0))
    assert np.isnan(sent.m_b_ut[1]).all()
    changed = np.linalg.norm(sent.m_b_ut - fields, axis=1)
    assert changed[[0, 3]] == pytest.approx((0.0, 0.0))
    assert changed[2] == pytest.approx(30.0, rel=0.01)
