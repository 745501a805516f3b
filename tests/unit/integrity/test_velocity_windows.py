"""Velocities against an attitude, on motions whose velocities are known in closed form."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import SensorErrors, VelocityFix
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_windows import (
    ReceiverErrors,
    VelocityWindows,
    change_of_velocity,
    inertial_variance,
    swept,
)

G = 9.80665
DEG = math.pi / 180.0
S = 1_000_000
KNOWN = SensorErrors((0.0, 0.0, 0.0))
NOTHING = ReceiverErrors(0.0, (0.0, 0.0, 0.0))
TILTED = Rotation.from_euler("ZYX", [40.0, 10.0, -20.0], degrees=True)


def scalar_first(rotation):
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


class Motion:
    """An IMU with a constant acceleration and its change; it turns about its own vertical.

    Args:
        attitude: of its axes at the start, by which its force is measured.
        believed: the same by the filter.
        bias_b: by which the force is measured too large, m/s^2.
    """

    def __init__(self, accel_n=(0.0, 0.0, 0.0), jerk_n=(0.0, 0.0, 0.0), attitude=TILTED,
                 believed=None, sigmas_deg=(0.0, 1.0), path_rad_s=0.0, variances=(0.0, 0.0),
                 rate_rad_s=0.0, bias_b=(0.0, 0.0, 0.0), until_s=99.0):  # fmt: skip
        self.accel_n, self.jerk_n = np.array(accel_n), np.array(jerk_n)
        self.attitude, self.believed = attitude, believed or attitude
        self.sigmas_deg, self.path_rad_s, self.variances = sigmas_deg, path_rad_s, variances
        self.rate_rad_s, self.bias_b, self.until_s = rate_rad_s, np.array(bias_b), until_s

    def v_n(self, t_s):
        return self.accel_n * t_s + 0.5 * self.jerk_n * t_s**2

    def at(self, t_us):
        t_s = t_us / S
        if not 0.0 <= t_s <= self.until_s:
            return None
        felt_n = self.v_n(t_s) - np.array((0.0, 0.0, G)) * t_s
        rate = self.rate_rad_s or 1e-6
        angle = rate * t_s
        s, c = math.sin(angle) / rate, 2.0 * math.sin(0.5 * angle) ** 2 / rate
        x, y, z = self.bias_b
        biased = np.array((s * x - c * y, c * x + s * y, z * t_s))
        return Moment(
            t_us,
            tuple(self.attitude.inv().apply(felt_n) + biased),
            scalar_first(self.believed),
            self.sigmas_deg[0] * DEG,
            self.sigmas_deg[1] * DEG,
            self.path_rad_s * t_s,
            self.variances[0] * t_s,
            self.variances[1] * t_s,
            (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)),
            rate_b=(0.0, 0.0, self.rate_rad_s),
        )


def flown(motion, end_s=10.0, every_s=0.2, errors=None, sigma_m_s=0.15, false_n=(0.0, 0.0, 0.0),
          receiver=NOTHING):  # fmt: skip
    """Windows after fixes at a spacing; false ones have that velocity added from 0 on."""
    windows = VelocityWindows(motion)
    windows.use_receiver(receiver)
    for i in range(round(end_s / every_s) + 1):
        t_s = i * every_s
        v_n = motion.v_n(t_s) + np.array(false_n) * t_s
        fix = VelocityFix(round(t_s * S), tuple(v_n.tolist()), sigma_m_s)
        windows.take(fix, errors or KNOWN)
    return windows


ACCELERATING = {"accel_n": (1.5, -2.0, 0.5), "jerk_n": (-0.1, 0.2, 0.05)}


def test_a_true_attitude_predicts_the_change_of_velocity():
    motion = Motion(**ACCELERATING)
    first, last = motion.at(2 * S), motion.at(9 * S)
    assert change_of_velocity(first, last) == pytest.approx(motion.v_n(9.0) - motion.v_n(2.0))
    windows = flown(motion)
    for length_s in (1.0, 3.0, 10.0):
        found = windows.window(length_s)
        assert found.length_s == pytest.approx(length_s)
        assert found.residual_m_s == pytest.approx(0.0, abs=1e-6)
        change = motion.v_n(10.0) - motion.v_n(10.0 - length_s)
        assert found.change_m_s == pytest.approx(math.hypot(*change[:2]))
        assert found.shows_heading


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, -0.8, 0.0), (0.0, 0.0, 1.0)])
def test_a_wrong_attitude_shows_as_the_force_that_it_turns(axis):
    turn = Rotation.from_rotvec(np.array(axis) * 2.0 * DEG)
    motion = Motion(**ACCELERATING, believed=turn * TILTED)
    found = flown(motion).window(3.0)
    force = motion.v_n(10.0) - motion.v_n(7.0) - np.array((0.0, 0.0, 3.0 * G))
    apart = turn.apply(force) - force
    assert found.residual_m_s == pytest.approx(math.hypot(*apart[:2]))
    assert found.tilt_rad == pytest.approx(math.hypot(*apart[:2]) / (3.0 * G))
    assert found.ratio == pytest.approx(found.residual_m_s / (3.0 * found.sigma_m_s))


def test_without_a_heading_only_sizes_are_compared():
    turn = Rotation.from_rotvec([0.0, 0.0, 1.0])
    for sigma_rad, shows in ((0.99, True), (1.01, False)):
        motion = Motion((1.5, -2.0, 0.5), believed=turn * TILTED, sigmas_deg=(0, sigma_rad / DEG))
        found = flown(motion).window(3.0)
        assert found.shows_heading == shows
        chord = 2.0 * math.sin(0.5) * found.change_m_s
        assert found.residual_m_s == pytest.approx(chord if shows else 0.0, abs=1e-6)
    false = flown(motion, false_n=(0.3, -0.4, 0.0)).window(3.0)
    assert false.residual_m_s == pytest.approx(1.5)


LENGTH_S = 3.0
# of both velocities, and of 10 mg and 0.05 deg/s
SOUND_VARIANCE = (
    2.0 * 0.15**2 + (0.01 * G * LENGTH_S) ** 2 + (0.5 * G * 0.05 * DEG * LENGTH_S**2) ** 2
)
TURNED = Rotation.from_rotvec([0.0, 0.0, 90.0 * DEG])


@pytest.mark.parametrize(
    ("motion", "how", "more"),
    [
        ({}, {}, 0.0),
        ({}, {"sigma_m_s": 0.1}, 0.0),
        ({}, {"sigma_m_s": 0.4}, 2.0 * (0.4**2 - 0.15**2)),
        ({"sigmas_deg": (0.5, 0.0)}, {}, (G * LENGTH_S * 0.5 * DEG) ** 2),
        ({"accel_n": (0.6, -0.8, 3.0), "sigmas_deg": (0.0, 5.0)}, {}, (5.0 * DEG * LENGTH_S) ** 2),
        ({"path_rad_s": 0.7}, {}, (G * LENGTH_S * 0.005 * 0.7 * LENGTH_S) ** 2),
        ({"variances": (1e-4, 0.0)}, {}, (G * LENGTH_S) ** 2 * 1e-4 * LENGTH_S / 3.0),
        ({"variances": (0.0, 0.02)}, {}, 0.02 * LENGTH_S),
        # the accelerometer's bias, where it is known worse
        ({}, {"errors": KNOWN._replace(force_variance=(0.09, 0.04))},
         (0.3**2 - (0.01 * G) ** 2) * LENGTH_S**2),
        ({}, {"errors": KNOWN._replace(force_variance=(1e-4, 0.0))}, 0.0),
        # a delay, by how much the acceleration differs
        ({"jerk_n": (0.3, 0.4, 0.0), "sigmas_deg": (0.0, 0.0)},
         {"receiver": ReceiverErrors(0.2, (0.0, 0.0, 0.0))}, (0.2 * 0.5 * LENGTH_S) ** 2),
        # an antenna ahead, whose velocity turns with the vehicle
        ({"rate_rad_s": math.pi / 3.0, "attitude": Rotation.identity(), "sigmas_deg": (0.0, 0.0)},
         {"receiver": ReceiverErrors(0.0, (0.5, 0.0, 0.0))},
         0.5 * (0.5 * 2.0 * math.pi / 3.0) ** 2),
    ],
)  # fmt: skip
def test_the_deviation_of_a_window(motion, how, more):
    found = flown(Motion(**motion), **how).window(LENGTH_S)
    assert found.sigma_m_s**2 == pytest.approx(SOUND_VARIANCE + more)


def test_the_tilt_that_is_shown_is_beyond_what_is_expected():
    found = flown(Motion(), false_n=(0.3, 0.0, 0.0)).window(LENGTH_S)
    left = math.sqrt(0.9**2 - 2.0 * found.sigma_m_s**2)
    assert found.shown_tilt_rad == pytest.approx(left / (G * LENGTH_S))
    assert flown(Motion(), false_n=(0.05, 0.0, 0.0)).window(LENGTH_S).shown_tilt_rad == 0.0


def test_variance_grows_with_the_force_that_is_given():
    motion = Motion()
    first, last = motion.at(0), motion.at(2 * S)
    more = inertial_variance(first, last, 0.5) - inertial_variance(first, last, 0.0)
    assert more == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("end_s", "every_s", "lengths"),
    [
        (0.6, 0.2, {1.0: None, 3.0: None}),
        (0.81, 0.27, {1.0: 0.81, 3.0: None}),
        (1.0, 0.2, {1.0: 1.0}),
        (2.0, 0.2, {1.0: 1.0, 3.0: None}),
        (2.25, 0.25, {3.0: None}),
        (2.5, 0.25, {3.0: 2.5}),
        (7.8, 0.2, {3.0: 3.0, 10.0: None}),
        (8.0, 0.2, {10.0: 8.0}),
        (20.0, 0.2, {10.0: 10.4}),
        (4.2, 0.35, {1.0: 1.05}),
        (4.4, 0.55, {1.0: None}),
        (6.0, 3.0, {1.0: None, 3.0: 3.0}),
    ],
)
def test_a_window_reaches_back_by_about_its_length(end_s, every_s, lengths):
    windows = flown(Motion(), end_s, every_s)
    for length_s, reached_s in lengths.items():
        found = windows.window(length_s)
        assert (found and found.length_s) == (reached_s and pytest.approx(reached_s))


def test_marks_are_as_far_apart_and_as_old_as_they_may_be():
    windows = VelocityWindows(Motion(until_s=30.0))
    still = (0.0, 0.0, 0.0)
    taken = [
        t_us
        for t_us in (0, 179_999, 180_000, 300_000, 360_000)
        if windows.take(VelocityFix(t_us, still, 0.2), KNOWN)
    ]
    assert taken == [0, 180_000, 360_000]
    assert not windows.take(VelocityFix(31 * S, still, 0.2), KNOWN)
    assert windows.take(VelocityFix(11_180_000, still, 0.2), KNOWN)
    assert [mark.moment.t_us for mark in windows.marks] == [180_000, 360_000, 11_180_000]
    assert not windows.is_stale(14_180_000)
    assert windows.is_stale(14_180_001)
    windows.restart()
    assert windows.is_stale(0)
    assert windows.window(1.0) is None
    assert windows.biased_tilt_rad((1.0, 1.0, 0.0)) == 0.0


@pytest.mark.parametrize(
    ("every_s", "back_s"),
    [(0.2, (0.2, 0.4)), (0.36, (0.36, 0.72)), (0.4, (0.18, 0.36)), (1.0, (0.18, 0.36))],
)
def test_accelerations_are_of_the_last_moments(every_s, back_s):
    motion = Motion(**ACCELERATING)
    mark = flown(motion, 2.0 + 1e-9, every_s).marks[-1]
    t_s = mark.moment.t_us / S
    near, far = (t_s - back for back in back_s)
    accel = (motion.v_n(t_s) - motion.v_n(near)) / (t_s - near)
    before = (motion.v_n(near) - motion.v_n(far)) / (near - far)
    assert mark.accel_n == pytest.approx(accel[:2])
    assert mark.jerk_n == pytest.approx((accel - before)[:2] / (t_s - near))
    felt = motion.v_n(t_s) - motion.v_n(t_s - every_s)
    assert mark.felt_n == pytest.approx(felt[:2])
    first = flown(motion, 0.0).marks[0]
    assert (first.felt_n, first.accel_n, first.jerk_n) == ((0.0, 0.0),) * 3


@pytest.mark.parametrize("rate_rad_s", [0.0, 0.8, -1.6])
def test_a_known_bias_is_taken_off_the_force_as_the_body_turns(rate_rad_s):
    biased = {"rate_rad_s": rate_rad_s, "bias_b": (0.4, -0.3, 0.0)}
    errors = KNOWN._replace(force_bias_b=(0.4, -0.3, 0.0))
    found = flown(Motion(**ACCELERATING, **biased), 4.0, errors=errors).window(3.0)
    assert found.residual_m_s == pytest.approx(0.0, abs=6e-3)
    unknown = flown(Motion(**ACCELERATING, **biased), 4.0).window(3.0)
    assert unknown.residual_m_s > 0.3


def test_a_point_of_the_body_moves_as_it_turns():
    turn, attitude = Rotation.from_rotvec([0.3, 0.1, -0.5]), TILTED
    moment = Motion().at(0)._replace(q_sb=scalar_first(turn), rate_b=(0.4, -0.7, 1.1))
    for axis, found in zip(np.eye(3), swept(moment), strict=True):
        velocity_n = (attitude * turn).apply(np.cross((0.4, -0.7, 1.1), axis))
        assert found == pytest.approx(velocity_n[:2])


@pytest.mark.parametrize(
    ("bias_b", "found_b", "tilt_deg", "leaning"),
    [
        ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, math.sqrt(0.25 - 2.0 * (0.01 * G) ** 2) / G),
        ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), 50.0, 0.0),
        ((0.5, 0.2, 0.0), (0.5, 0.2, 0.0), 0.0, 0.0),
        ((0.5, 0.2, 0.0), (0.5, 0.2, 0.0), 30.0, 0.5 * math.hypot(0.5, 0.2) / G),
        ((0.0, 0.2, 0.0), (0.0, 0.2, 0.0), 30.0, 0.5 * 0.2 / G),
        ((0.5, 0.6, 0.0), (0.0, 0.2, 9.0), 0.0,
         math.sqrt(0.25 + 0.16 - 2.0 * (0.01 * G) ** 2) / G),
    ],
)  # fmt: skip
def test_a_bias_looks_like_a_tilt(bias_b, found_b, tilt_deg, leaning):
    attitude = Rotation.from_rotvec([0.0, tilt_deg * DEG, 0.0])
    windows = flown(Motion(attitude=attitude), 0.0, errors=KNOWN._replace(force_bias_b=bias_b))
    assert windows.biased_tilt_rad(found_b) == pytest.approx(leaning, abs=1e-9)
