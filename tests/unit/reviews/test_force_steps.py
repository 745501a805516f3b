"""A jump of an accelerometer's bias is found where it is, and nowhere else."""

from typing import NamedTuple

import numpy as np
import pytest
from needs import DEG
from reviewed_flights import flight, gps_track, ideal, with_gps, with_imu

from h2nav.integrity.findings import Severity
from h2nav.maths.rows import product
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import ImuTrack, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.force_steps import detect_force_steps
from h2nav.reviews.inertial import attitudes, exponential
from h2nav.reviews.receiver_fit import Moves
from h2nav.reviews.tracks import Bias

KIND = "accelerometer_bias_step"
STEP_S = 60.0
STEP_M_S2 = np.array((1.2, -0.9, 0.4))


def found(flown):
    return [finding for finding in analyse(flown).findings if finding.kind == KIND]


def with_step(flown, step=STEP_M_S2):
    track = flown.context.imus[0]
    return with_imu(flown, f_b=track.f_b + np.where(track.t_s > STEP_S, 1.0, 0.0)[:, None] * step)


def with_followed_tilt(flown):
    """The attitude has taken the step into its tilt within some seconds, as filters do."""
    estimates = flown.estimates
    share = np.clip((estimates.t_s - STEP_S) / 6.0, 0.0, 1.0)[:, None]
    error_b = share * np.cross(STEP_M_S2, (0.0, 0.0, -1.0)) / 9.81
    q_nb = product(estimates.q_nb, exponential(error_b))
    return flown._replace(estimates=estimates._replace(q_nb=q_nb))


@pytest.mark.parametrize("name", ["flight", "hover", "aggressive"])
@pytest.mark.parametrize("imus", [1, 2])
def test_a_sound_accelerometer_does_not_jump(name, imus):
    assert found(flight(name, imus)) == []


@pytest.mark.parametrize("imus", [1, 2])
@pytest.mark.parametrize("change", [lambda flown: flown, with_followed_tilt])
def test_a_jump_is_found_with_its_size_and_time(imus, change):
    found = analyse(change(with_step(flight("hover", imus)))).findings
    (finding,) = (one for one in found if "accelerometer bias jumped" in one.text + one.evidence)
    assert finding.from_s - 2.0 < STEP_S < finding.to_s + 2.0
    if imus == 1:  # nobody can tell the two apart
        assert (finding.kind, finding.source) == ("gps_velocity", "GPS")
        return
    assert (finding.kind, finding.source) == (KIND, "IMU 1")
    assert finding.size == pytest.approx(np.linalg.norm(STEP_M_S2), rel=0.3)
    if change is not with_followed_tilt:  # by a wrong attitude, every velocity contradicts
        assert not any(one.kind == "gps_velocity" for one in found)


def test_a_receiver_that_runs_away_is_no_accelerometer_where_two_say_so():
    gps = gps_track("hover")
    spoofed = gps.v_n + np.maximum(gps.t_s - STEP_S, 0.0)[:, None] * (1.5, 0.0, 0.0)
    assert found(with_gps(flight("hover", 2), v_n=spoofed)) == []


def test_a_heading_that_is_wrong_is_no_jump():
    flown = flight("aggressive")
    turned = flown.estimates._replace(
        q_nb=product(
            exponential(np.tile((0.0, 0.0, 12.0 * DEG), (len(ideal("aggressive").t_us), 1))),
            flown.estimates.q_nb,
        )
    )
    assert found(flown._replace(estimates=turned)) == []


def test_without_fixes_nothing_is_said():
    flown = with_step(flight("hover"))
    gps = flown.context.gps[0]
    lost = (gps.t_s > STEP_S - 3.0) & (gps.t_s < STEP_S + 30.0)
    assert found(with_gps(flown, has_fix=gps.has_fix & ~lost)) == []


# --- each bound, on two IMUs in a steady hover, of which the first one jumps ----------------------

PERIOD_S, END_S = 0.05, 37.0
T_S = np.arange(14.0, END_S, PERIOD_S)


class Hover(NamedTuple):
    """What the sensors say; body axes are those of north, east and down but for a turn about it."""

    step: float = 1.0  # of the first accelerometer's x axis, m/s^2
    axis: int = 0  # or of another
    at_s: float = 30.0
    other: float = 0.0  # the same of the second accelerometer
    other_s: float = 30.0
    sigma_m_s: float = 0.01  # stated by the receiver
    shaking: float = 0.0  # amplitude of a force that changes its sign with each sample
    turn_rad_s: float = 0.0
    moved: float = 0.0  # acceleration to the north, m/s^2
    sigma_heading_rad: float = 0.0
    gyro_bias: float = 0.0
    known_bias: float = 0.0
    fixes_from_s: float = 16.0
    lost_fixes_s: tuple[float, float] = (0.0, 0.0)
    lost_samples_s: tuple[float, float] = (0.0, 0.0)
    armed: tuple[Span, ...] = (Span(0.0, END_S, "armed"),)
    imus: int = 2
    lag_s: float = 0.0

    def track(self, imu: int) -> ImuTrack:
        f_b = np.tile((self.moved, 0.0, -GRAVITY_M_S2), (len(T_S), 1))
        f_b += self.shaking * np.where(np.arange(len(T_S)) % 2, 1.0, -1.0)[:, None] * (1, 0, 0)
        step, at_s = (self.step, self.at_s) if imu == 0 else (self.other, self.other_s)
        f_b[at_s < T_S, self.axis] += step
        w_b = np.tile((self.gyro_bias, 0.0, self.turn_rad_s), (len(T_S), 1))
        begin_s, end_s = self.lost_samples_s
        rows = (begin_s >= T_S) | (end_s <= T_S)
        stamps = np.round(T_S * 1e6).astype(np.int64)
        nothing = np.full(w_b.shape, np.nan)
        whole = (T_S, stamps, w_b, f_b, nothing)
        return ImuTrack(imu, "IMU", *(values[rows] for values in whole))

    def found(self):
        fixes_s = np.arange(self.fixes_from_s, END_S - 1.0, 0.2)
        lost = (fixes_s > self.lost_fixes_s[0]) & (fixes_s < self.lost_fixes_s[1])
        fixes_s = fixes_s[~lost]
        v_n = np.zeros((len(fixes_s), 3))
        v_n[:, 0] = self.moved * fixes_s
        sigmas = np.full(len(fixes_s), self.sigma_m_s)
        moves = Moves(fixes_s, v_n, sigmas, np.ones(3, dtype=bool))
        q_nb = exponential(np.outer(T_S, (0.0, 0.0, self.turn_rad_s)))
        unknown = np.full(len(T_S), self.sigma_heading_rad)
        best = attitudes(T_S, q_nb)._replace(sigma_heading_rad=unknown)
        gyro_b = np.array([[self.known_bias, 0.0, 0.0], [np.nan] * 3])
        nothing = np.zeros(0)
        biases = tuple(
            Bias(imu, np.zeros(2), gyro_b, 0.1, nothing, nothing) for imu in range(self.imus)
        )
        tracks = tuple(self.track(imu) for imu in range(self.imus))
        return detect_force_steps(tracks, biases, moves, self.lag_s, best, self.armed)


@pytest.mark.parametrize(
    ("too_little", "enough"),
    [
        # What is not thermal.
        (Hover(0.49), Hover(0.51)),
        (Hover(-0.49, axis=1), Hover(-0.51, axis=1)),
        # 3 sigma of a difference of velocities of so uncertain fixes over 4 s.
        (Hover(0.73, sigma_m_s=0.5), Hover(0.77, sigma_m_s=0.5)),
        # Samples that change by 2 are noise of variance 2, which leaves 2 * 0.05 s / 4 s in the
        # mean over a window, and twice as much in the difference of two.
        (Hover(0.65, shaking=1.0), Hover(0.69, shaking=1.0)),
        # A gyro of 1 % that turns by 4.5 rad over the windows takes gravity for 0.44 m/s^2.
        (Hover(1.29, 2, turn_rad_s=0.5), Hover(1.36, 2, turn_rad_s=0.5)),
        # A quarter of its own acceleration, or what 3 sigma of our heading make of it.
        (Hover(0.98, moved=4.0), Hover(1.02, moved=4.0)),
        (
            Hover(2.33, moved=4.0, sigma_heading_rad=0.2),
            Hover(2.40, moved=4.0, sigma_heading_rad=0.2),
        ),
        (
            Hover(7.9, moved=4.0, sigma_heading_rad=9.0),
            Hover(8.1, moved=4.0, sigma_heading_rad=9.0),
        ),
        # Windows whose halves are mixed would show less of it: most of them is armed.
        (Hover(armed=(Span(27.2, 40.0, "armed"),)), Hover(armed=(Span(25.2, 40.0, "armed"),))),
        (Hover(armed=(Span(0.0, 32.8, "armed"),)), Hover(armed=(Span(0.0, 34.8, "armed"),))),
        # Steady over two windows before it.
        (Hover(fixes_from_s=19.2), Hover(fixes_from_s=17.4)),
        # More than one fix missing, or samples.
        (Hover(lost_fixes_s=(31.1, 32.5)), Hover(lost_fixes_s=(31.1, 32.3))),
        (Hover(lost_samples_s=(32.01, 32.22)), Hover(lost_samples_s=(32.01, 32.07))),
        # Another one that jumped with it, whatever its direction, or within the windows.
        (Hover(other=-0.52), Hover(other=-0.4)),
        (Hover(other=0.6), Hover(other=0.4)),
        (Hover(other=-0.9, other_s=32.0), Hover(other=-0.9, other_s=36.0)),
        # A gyro's bias that turns the frame.
        (Hover(gyro_bias=0.05), Hover(gyro_bias=0.05, known_bias=0.05)),
    ],
)
def test_how_large_and_how_well_seen_a_jump_has_to_be(too_little, enough):
    assert [one for one in too_little.found() if one.source == "IMU 1"] == []
    (one,) = (one for one in enough.found() if one.source == "IMU 1")
    assert one.size == pytest.approx(abs(enough.step), rel=0.02)
    assert one.from_s + 0.5 == pytest.approx(30.0, abs=0.5)


def test_a_jump_is_told_with_its_direction():
    (one,) = Hover(-1.26, axis=1, lag_s=np.nan).found()
    assert one.text == "accelerometer bias jumped by 1.3 m/s^2"
    assert one.evidence.replace("-0.0", "+0.0") == (
        "(+0.0, -1.3, +0.0) m/s^2 in x, y, z, by the receiver's velocity over 4 s before and after"
    )
    assert (one.severity, one.unit, one.to_s - one.from_s) == (Severity.WARNING, "m/s^2", 1.0)
    (alone,) = Hover(imus=1).found()
    assert alone.evidence.endswith(" and after, unless the receiver's velocity runs away")
    (second,) = Hover(step=0.0, other=1.0).found()
    assert second.source == "IMU 2"


def test_a_receivers_delay_is_taken_off():
    moving = Hover(moved=4.0, step=1.1, lag_s=0.2)
    (one,) = moving.found()
    assert one.size == pytest.approx(1.1, rel=0.02)
