"""Drawn motions: derivatives against differences, and the sizes that a draw asks for."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.evaluation.campaign import effects
from h2nav.evaluation.campaign.draw import VEHICLES, Draw, FlightDraw
from h2nav.evaluation.campaign.effects import without
from h2nav.evaluation.campaign.motion import DrawnMotion, _Plan, attitude_rows
from h2nav.evaluation.campaign.splines import UniformSpline, smoothed
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.faults import parse_fault

CALM_AIR = {"wind_m_s": 0.0, "gust_m_s": 0.0}


def motion(vehicle, seed=7, **flight):
    own = {"length_min": 2.0, "rest_s": 20.0} | flight
    return DrawnMotion(Draw(seed, flight=FlightDraw(vehicle=vehicle, **own)))


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_velocity_attitude_rates_and_force_belong_together(vehicle):
    """By central differences, in wind and gusts."""
    own = motion(vehicle, manoeuvre_m_s2=4.0, brisk_share=1.0)
    t_s, h = np.arange(30.0, 105.0, 0.37), 1e-4
    now, before, after = own.at(t_s), own.at(t_s - h), own.at(t_s + h)
    assert (after.v_n - before.v_n) / (2.0 * h) == pytest.approx(now.a_n, abs=1e-3)
    turn = np.einsum("nji,njk->nik", now.to_ned, (after.to_ned - before.to_ned) / (2.0 * h))
    rates = np.stack((turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]), axis=1)
    assert rates == pytest.approx(now.w_b, abs=1e-3)
    assert np.abs(now.w_b).max() > 0.1
    force = np.einsum("nij,nj->ni", now.to_ned, now.f_b)
    assert force == pytest.approx(now.a_n - (0.0, 0.0, GRAVITY_M_S2))
    turns = Rotation.from_quat(np.roll(now.q_nb, -1, axis=1))
    assert turns.as_matrix() == pytest.approx(now.to_ned)
    assert now.throttle == pytest.approx(0.35 * np.abs(now.f_b[:, 2]) / GRAVITY_M_S2)
    moved = own.position(t_s + 0.5) - own.position(t_s - 0.5)
    assert moved == pytest.approx(own.at(t_s).v_n, abs=0.5)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_flight_rests_before_and_for_its_last_ten_seconds(vehicle):
    own = motion(vehicle)
    assert (own.from_s, own.to_s) == (20.0, 110.0)
    assert own.moves(np.array((19.99, 20.0, 109.99, 110.0))).tolist() == [False, True, True, False]
    for t_s in (np.arange(0.0, 19.0, 0.5), np.arange(114.0, 120.0, 0.5)):
        found = own.at(t_s)
        assert np.abs(found.v_n).max() < 1e-9
        assert not found.throttle.any()
    short = motion(vehicle, length_min=1.0, rest_s=600.0)
    assert (short.from_s, short.to_s) == (600.0, 608.0)


def test_a_copter_leans_as_its_path_and_the_air_demand():
    """The force lies along its own vertical, but for drag: 0.2 /s of the speed through the air."""
    own = motion("copter", **CALM_AIR)
    found = own.at(np.arange(40.0, 98.0, 0.5))
    push = found.a_n + 0.2 * found.v_n - (0.0, 0.0, GRAVITY_M_S2)
    axis = push / np.linalg.norm(push, axis=1, keepdims=True)
    lean = np.arccos(np.clip(-np.einsum("ni,ni->n", axis, found.to_ned[:, :, 2]), -1.0, 1.0))
    assert np.sqrt(np.mean(lean**2)) < 1.0 * DEG  # sway of half a degree in roll and pitch
    assert np.abs(found.v_n[:, :2]).max() <= 2.0


def test_a_plane_flies_at_eighteen_metres_a_second_and_banks_into_turns():
    own = motion("plane", brisk_share=1.0, manoeuvre_m_s2=6.0, **CALM_AIR)
    found = own.at(np.arange(50.0, 95.0, 0.5))
    speed = np.linalg.norm(found.v_n, axis=1)
    assert 16.1 < speed.min() < speed.max() < 19.9
    course = np.unwrap(np.arctan2(found.v_n[:, 1], found.v_n[:, 0]))
    rate = np.gradient(course, 0.5)
    bank = np.arctan(speed * rate / GRAVITY_M_S2)
    right = Rotation.from_quat(np.roll(found.q_nb, -1, axis=1)).as_euler("ZYX")[:, 2]
    assert np.corrcoef(bank, right)[0, 1] > 0.9
    assert np.abs(bank).max() > 5.0 * DEG
    pitch = np.arcsin(-found.to_ned[:, 2, 0]) - np.arcsin(-found.v_n[:, 2] / speed)
    assert np.mean(pitch) == pytest.approx(3.0 * DEG, abs=0.7 * DEG)


def test_a_rover_drives_along_its_nose_at_three_metres_a_second_at_most():
    own = motion("rover")
    found = own.at(np.arange(30.0, 105.0, 0.5))
    yaw = Rotation.from_quat(np.roll(found.q_nb, -1, axis=1)).as_euler("ZYX")[:, 0]
    speed = np.hypot(*found.v_n[:, :2].T)
    assert 2.0 < speed.max() <= 3.0
    off = (np.arctan2(found.v_n[:, 1], found.v_n[:, 0]) - yaw + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(off[speed > 0.5]).max() < 0.01
    assert not found.v_n[:, 2].any()


@pytest.mark.parametrize(("share", "size"), [(1.0, 1.0), (0.0, 0.1)])
def test_a_calm_part_has_a_tenth_of_the_acceleration_of_a_brisk_one(share, size):
    def sizes(**flight):
        found = motion("copter", **CALM_AIR, **flight).at(np.arange(40.0, 98.0, 0.5))
        return np.abs(found.a_n[:, :2]).mean()

    whole = sizes(brisk_share=1.0, manoeuvre_m_s2=3.0)
    assert sizes(brisk_share=share, manoeuvre_m_s2=3.0) == pytest.approx(size * whole, rel=1e-6)


def test_the_wind_carries_a_plane_and_gusts_are_as_strong_as_drawn():
    still = motion("plane", **CALM_AIR)
    t_s = np.arange(50.0, 95.0, 0.5)
    carried = motion("plane", wind_m_s=5.0, gust_m_s=0.0).at(t_s).v_n - still.at(t_s).v_n
    assert np.linalg.norm(carried, axis=1) == pytest.approx(5.0)
    assert carried[:, 2] == pytest.approx(0.0)
    gusts = [
        motion("plane", seed, wind_m_s=0.0, gust_m_s=2.0).at(t_s).v_n
        - motion("plane", seed, **CALM_AIR).at(t_s).v_n
        for seed in range(4)
    ]
    assert np.std(gusts) == pytest.approx(1.7, abs=0.3)  # less what means over 4 s take away


def test_attitudes_of_angles():
    roll, pitch, yaw = np.random.default_rng(1).uniform(-1.5, 1.5, (3, 20))
    expected = Rotation.from_euler("ZYX", np.stack((yaw, pitch, roll), axis=1)).as_quat()
    assert attitude_rows(roll, pitch, yaw) == pytest.approx(np.roll(expected, 1, axis=1))


# --- splines --------------------------------------------------------------------------------------


def test_a_spline_of_a_line_is_the_line_and_of_a_constant_the_constant():
    points = np.stack((np.arange(20.0), np.full(20, 3.0)), axis=1)
    spline = UniformSpline(points, 0.5)
    jet = spline.jet(np.array((2.5, 5.25)))
    assert jet[0] == pytest.approx(np.array([(5.0, 3.0), (10.5, 3.0)]))
    assert jet[1] == pytest.approx(np.array([(2.0, 0.0)] * 2))
    assert jet[2:] == pytest.approx(np.zeros((2, 2, 2)), abs=1e-9)
    # before its beginning and behind its end it stays
    ends = spline.jet(np.array((-5.0, 0.0, 99.0)))[0]
    assert ends[0] == pytest.approx(ends[1])
    assert ends[2] == pytest.approx((19.0, 3.0), abs=0.01)


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        (1, [0.0, 0.0, 6.0, 0.0, 0.0]),
        (2, [0.0, 0.0, 3.0, 3.0, 0.0]),
        (3, [0.0, 2.0, 2.0, 2.0, 0.0]),
    ],
)
def test_moving_means_keep_their_place_and_their_ends(width, expected):
    found = smoothed(np.array([[0.0], [0.0], [6.0], [0.0], [0.0]]), width)
    assert found[:, 0] == pytest.approx(expected)
    assert smoothed(np.full((4, 1), 5.0), width)[:, 0] == pytest.approx([5.0] * 4)


# --- effects --------------------------------------------------------------------------------------


def test_the_effect_of_a_fault_is_the_largest_rms_over_ten_seconds_of_it():
    t_s = np.arange(0.0, 100.0, 0.5)
    fault = parse_fault("gyro-bias=5@20+30")
    apart = np.zeros((200, 3))
    apart[(t_s >= 25.0) & (t_s < 30.0)] = (3.0, 0.0, 4.0)
    apart[t_s >= 60.0] = 99.0  # when it is over
    assert effects._most(fault, t_s, apart) == pytest.approx(5.0 * np.sqrt(0.5))
    short = fault._replace(length_s=8.0)
    assert effects._most(short, t_s, apart) == pytest.approx(5.0 * np.sqrt(6.0 / 16.0))
    late = parse_fault("gyro-bias=5@200+30")
    assert effects._most(late, t_s, apart) == 0.0


def test_a_draw_without_a_fault_has_the_others():
    faults = ("gyro-bias=5@20+30", "gps-lost@50+10", "gyro-bias=5@20+31")
    found = without(Draw(1, faults=faults), parse_fault("gyro-bias=5@20+30"))
    assert found == Draw(1, faults=faults[1:])


@pytest.mark.parametrize("seed", range(3))
def test_parts_of_a_flight_last_from_twenty_to_ninety_seconds(seed):
    """Control points are half a second apart; two parts in a row may be alike."""
    flight = FlightDraw(length_min=60.0, brisk_share=0.5, manoeuvre_m_s2=3.0)
    plan = _Plan(Draw(seed, flight=flight), 20.0, 3590.0, np.random.default_rng(seed))
    changes = np.flatnonzero(np.diff(plan._parts))
    assert np.diff(changes).min() >= 40
    assert np.diff(changes).min() < 180
    assert set(np.round(plan._parts, 9)) == {3.0, 0.3}
    share = np.mean(plan._parts == 3.0)
    assert share == pytest.approx(0.5, abs=0.25)


@pytest.mark.parametrize("correlated_s", [1.0, 4.0])
def test_gusts_have_the_deviation_of_one_and_forget_themselves(correlated_s):
    flight = FlightDraw(length_min=120.0)
    plan = _Plan(Draw(1, flight=flight), 20.0, 7190.0, np.random.default_rng(1))
    values = plan._wandering(3, correlated_s)
    assert values.std() == pytest.approx(1.0, abs=0.05)
    kept = np.mean(values[1:] * values[:-1])
    assert kept == pytest.approx(np.exp(-0.5 / correlated_s), abs=0.05)
    held = plan._held(5.0, 20.0)
    assert np.abs(held).max() <= 1.0
    lengths = np.diff(np.flatnonzero(np.diff(held)))
    assert (lengths.min(), lengths.max()) == (10, 39)
