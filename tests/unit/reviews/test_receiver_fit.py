"""Whether a receiver's velocity fits the IMU with another heading or a small tilt."""

from typing import NamedTuple

import numpy as np
import pytest
from needs import DEG
from scipy.spatial.transform import Rotation

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import ImuTrack
from h2nav.reviews.inertial import attitudes
from h2nav.reviews.receiver_fit import Moves, carried, fits, fitted, gained


def rows(rotations: Rotation) -> np.ndarray:
    """Scalar first."""
    return np.roll(rotations.as_quat(), 1, axis=1)


def imu(t_s, w_b, f_b) -> ImuTrack:
    stamps = np.round(t_s * 1e6).astype(np.int64)
    return ImuTrack(0, "IMU", t_s, stamps, w_b, f_b, np.full(f_b.shape, np.nan))


@pytest.mark.parametrize("count", [1, 2, 3, 17, 64])
def test_the_gyro_carries_an_attitude_through_all_samples(count):
    random = np.random.default_rng(count)
    w_b, bias_b = random.normal(0.0, 2.0, (count, 3)), np.array((0.1, -0.2, 0.3))
    dt_s = random.uniform(0.0, 0.1, count)
    track = imu(np.cumsum(dt_s), w_b, np.zeros((count, 3)))
    turn, expected = Rotation.identity(), []
    for w, dt in zip(w_b - bias_b, dt_s, strict=True):
        turn = turn * Rotation.from_rotvec(w * dt)
        expected.append(turn)
    found = carried(track, bias_b, dt_s)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(count))
    apart = Rotation.concatenate(expected).inv() * Rotation.from_quat(np.roll(found, -1, axis=1))
    assert apart.magnitude() == pytest.approx(np.zeros(count), abs=1e-7)


def test_what_force_and_receiver_gain_is_what_both_say():
    t_s = np.linspace(0.0, 6.0, 301)
    # It turns about the vertical at 0.5 rad/s and is pushed in its own direction.
    w_b = np.tile((0.0, 0.0, 0.5 + 0.1), (301, 1))
    f_b = np.tile((2.0, 0.0, -GRAVITY_M_S2), (301, 1))
    fixes_s = np.array((1.0, 2.0, 4.0))
    v_n = np.array(((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0)))
    moves = Moves(fixes_s, v_n.copy(), np.ones(3), np.ones(3, dtype=bool))
    q_sb, at_s, v_s, without_gravity = gained(moves, imu(t_s, w_b, f_b), np.array((0, 0, 0.1)), 0.2)
    assert at_s == pytest.approx(fixes_s - 0.2)
    assert q_sb == pytest.approx(rows(Rotation.from_rotvec(np.outer(t_s, (0, 0, 0.5)))))
    east, north = np.sin(0.5 * at_s), 1.0 - np.cos(0.5 * at_s)
    expected = np.column_stack((4.0 * east, 4.0 * north, -GRAVITY_M_S2 * at_s))
    assert v_s == pytest.approx(expected, abs=1e-3)
    expected = v_n - np.outer((0.0, 1.0, 3.0), (0.0, 0.0, GRAVITY_M_S2))
    assert without_gravity == pytest.approx(expected)
    assert moves.v_n.tolist() == v_n.tolist()  # of the receiver, as it was


@pytest.mark.parametrize("seed", range(4))
def test_the_rotation_of_the_least_residuals_is_scipys(seed):
    random = np.random.default_rng(seed)
    v_s = random.normal(0.0, 3.0, (12, 3))
    # A mirror image has no rotation: the nearest one must still be one.
    mirrored = v_s * (1.0, 1.0, -1.0) if seed == 3 else v_s
    turn = Rotation.from_rotvec(random.normal(0.0, 1.0, 3))
    v_n = turn.apply(mirrored) + random.normal(0.0, 0.2, (12, 3)) + (5.0, -7.0, 3.0)
    expected, rssd = Rotation.align_vectors(v_n - v_n.mean(axis=0), v_s - v_s.mean(axis=0))
    found, left = fitted(v_s, v_n)
    assert found == pytest.approx(expected.as_matrix(), abs=1e-6)
    assert np.sqrt((left**2).sum()) == pytest.approx(rssd)
    assert left.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)


class Case(NamedTuple):
    """A vehicle that circles, and how the receiver and our attitude are wrong."""

    tilt_deg: float = 0.0  # of our attitude
    heading_deg: float = 0.0
    sigma_tilt_deg: float = 0.1
    sigma_heading_rad: float = 0.0
    runs_away_m_s: float = 0.0  # rms of a receiver's error from 15 to 25 s
    usual_m_s: float = 0.0  # rms of its error at other times
    size: float = 0.0  # of the finding
    unit: str = "m/s"
    fix_every_s: float = 0.4
    lag_s: float = 0.0
    from_s: float = 15.0

    def fits(self) -> bool:
        t_s = np.arange(0.0, 40.0, 0.05)
        f_b = np.column_stack((2.0 * np.sin(t_s), 2.0 * np.cos(t_s), 0.0 * t_s - GRAVITY_M_S2))
        track = imu(t_s, np.zeros((len(t_s), 3)), f_b)
        wrong = Rotation.from_euler("ZY", [(self.heading_deg, self.tilt_deg)], degrees=True)
        best = attitudes(t_s, np.tile(rows(wrong), (len(t_s), 1)))._replace(
            sigma_tilt_rad=np.full(len(t_s), self.sigma_tilt_deg * DEG),
            sigma_heading_rad=np.full(len(t_s), self.sigma_heading_rad),
        )
        fixes_s = np.arange(1.0, 39.0, self.fix_every_s)
        at_s = fixes_s - self.lag_s
        error = np.where((at_s > 15.0) & (at_s < 25.0), self.runs_away_m_s, self.usual_m_s)
        # From one fix to the next, so that no window of ten seconds explains it.
        error *= np.sqrt(2.0) * np.sin(np.arange(len(fixes_s)))
        v_n = np.column_stack((error - 2.0 * np.cos(at_s), 2.0 * np.sin(at_s), 0.0 * at_s))
        moves = Moves(fixes_s, v_n, np.full(len(fixes_s), 0.3), np.ones(3, dtype=bool))
        one = Finding(
            Kind.GPS_VELOCITY, Sensor(SensorKind.GPS), Severity.WARNING, self.from_s, 25.0,
            self.size, self.unit, "", "",
        )  # fmt: skip
        return fits(one, moves, track, best, np.zeros(3), self.lag_s)


@pytest.mark.parametrize(
    ("sound", "wrong"),
    [
        (Case(heading_deg=170.0, lag_s=0.4), Case(tilt_deg=170.0)),
        (Case(tilt_deg=4.8), Case(tilt_deg=5.2)),
        # Three sigma of our tilt, or a quarter of our heading's one, but of no more than 1 rad.
        (Case(tilt_deg=8.8, sigma_tilt_deg=3.0), Case(tilt_deg=9.2, sigma_tilt_deg=3.0)),
        (Case(tilt_deg=11.2, sigma_heading_rad=0.8), Case(tilt_deg=11.7, sigma_heading_rad=0.8)),
        (Case(tilt_deg=14.1, sigma_heading_rad=3.0), Case(tilt_deg=14.5, sigma_heading_rad=3.0)),
        # Of a good receiver, of a usual one, and of one that is bad all along.
        (Case(runs_away_m_s=0.28), Case(runs_away_m_s=0.32)),
        (Case(runs_away_m_s=1.5, usual_m_s=0.8), Case(runs_away_m_s=1.85, usual_m_s=0.8)),
        (Case(runs_away_m_s=1.9, usual_m_s=1.9), Case(runs_away_m_s=2.1, usual_m_s=2.1)),
        # A tenth of what is told of it, where that is a velocity.
        (Case(runs_away_m_s=0.95, size=10.0), Case(runs_away_m_s=1.05, size=10.0)),
        (Case(size=10.0, unit="m"), Case(runs_away_m_s=0.9, size=10.0, unit="m")),
        # Eight fixes in ten seconds, none of them after more than 1.5 s.
        (Case(fix_every_s=1.2), Case(fix_every_s=1.6)),
        (Case(from_s=24.0), Case(from_s=26.0)),
    ],
)
def test_what_a_sound_receiver_leaves(sound, wrong):
    assert sound.fits()
    assert not wrong.fits()
