"""The size of the force against the acceleration of a receiver's velocities and altitudes."""

import math
from types import SimpleNamespace

import pytest

from h2nav.integrity.force_size import ForceSize
from h2nav.integrity.strapdown import Moment
from h2nav.maths.units import GRAVITY_M_S2

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
INVERTED = (0.0, 1.0, 0.0, 0.0)
LEANING = (0.5, 0.0, math.sqrt(0.75), 0.0)  # by 120 deg
BEGUN_S, ENDED_S = 40.0, 60.0
STEP_S = 0.2


def since(t_s, begun_s=BEGUN_S):
    return max(t_s - begun_s, 0.0)


def fails(t_s):
    return BEGUN_S <= t_s < ENDED_S


def climbing(t_s):
    """Vertical acceleration of a vehicle that climbs and descends, m/s^2."""
    return 0.8 * math.sin(0.9 * t_s)


def flown(
    scale=lambda t_s: 1.0,
    zero=lambda t_s: 0.0,
    altitude_error=lambda t_s: 0.0,
    north=lambda t_s: 0.0,
    q_sb=lambda t_s: UPRIGHT,
    q_ns=lambda t_s: UPRIGHT,
    turn_rad_s=0.1,
    vibration=lambda t_s: 3.0,
    may_judge=True,
    differs=False,
    end_s=ENDED_S + 20.0,
):
    """When it found an error and when that ended, s, and the error; of fixes five times a second.

    Args:
        scale: of the accelerometer.
        zero: error along z of the body, m/s^2.
        altitude_error: of the receiver, m.
        north: velocity that the receiver adds, m/s.
        q_sb: attitude of the body.
        q_ns: attitude by the filter.
        turn_rad_s: that the gyro shows.
        vibration: rms, m/s^2.
    """
    size = ForceSize()
    size.begin()
    found, down, climb, altitude, begun_s, ended_s = None, 0.0, 0.0, 0.0, None, None
    for i in range(round(end_s / STEP_S)):
        t_s = i * STEP_S
        if i:
            side = 1.0 if q_sb(t_s) is UPRIGHT else -1.0
            push = scale(t_s) * (-GRAVITY_M_S2 - climbing(t_s)) + side * zero(t_s)
            down += STEP_S * push
            altitude += STEP_S * (climb + 0.5 * STEP_S * climbing(t_s))
            climb += STEP_S * climbing(t_s)
        moment = Moment(
            round(1e6 * t_s),
            (0.0, 0.0, down),
            q_ns(t_s),
            0.01,
            0.02,
            turn_rad_s * t_s,
            0.0,
            0.0,
            q_sb(t_s),
        )
        seen_m = altitude + altitude_error(t_s)
        said = {"may_judge": may_judge, "differs": differs}
        size.take(moment, (north(t_s), 0.0), seen_m, vibration(t_s), **said)
        if size.found is not None:
            found, ended_s = size.found, None
            begun_s = t_s if begun_s is None else begun_s
        elif found is not None and ended_s is None:
            ended_s = t_s
    return SimpleNamespace(error=found, begun_s=begun_s, ended_s=ended_s, size=size)


@pytest.mark.parametrize("scale", [0.85, 1.1, 1.3])
def test_a_wrong_scale_is_found_within_8_s_and_ends_with_it(scale):
    seen = flown(scale=lambda t_s: scale if fails(t_s) else 1.0)
    assert seen.error.is_scale
    assert seen.error.share == pytest.approx(scale - 1.0, abs=0.03)
    assert seen.error.size_m_s2 == pytest.approx(GRAVITY_M_S2 * abs(scale - 1.0), rel=0.2)
    assert BEGUN_S + 3.0 < seen.begun_s < BEGUN_S + 8.0
    assert ENDED_S < seen.ended_s < ENDED_S + 10.0


def test_what_data_sheets_allow_is_no_error():
    assert flown(scale=lambda t_s: 1.05 if fails(t_s) else 1.0).error is None


def test_a_scale_that_was_always_wrong_is_none_that_has_failed():
    assert flown(scale=lambda t_s: 1.2).error is None


@pytest.mark.parametrize("height_m", [5.0, -15.0, 40.0])
def test_an_altitude_that_jumps_accuses_nobody(height_m):
    assert flown(altitude_error=lambda t_s: height_m if fails(t_s) else 0.0).error is None


@pytest.mark.parametrize("drift_m_s", [3.0, -6.0, 12.0])
def test_an_altitude_that_begins_to_drift_accuses_nobody(drift_m_s):
    assert flown(altitude_error=lambda t_s: drift_m_s * since(t_s)).error is None


def test_a_velocity_that_drifts_away_accuses_nobody():
    """It changes the size of the force that is due, but not its vertical part."""
    assert flown(north=lambda t_s: 3.0 * since(t_s)).error is None


def test_a_noisy_altitude_raises_the_limit():
    def noise(t_s):
        return 3.0 * math.sin(40.0 * t_s * t_s)

    assert flown(altitude_error=noise).error is None
    assert flown(scale=lambda t_s: 1.1 if fails(t_s) else 1.0, altitude_error=noise).error is None


def test_vibration_that_is_gone_while_a_constant_comes_has_only_moved_to_the_rate_of_the_samples():
    def zero(t_s):
        return -1.5 if fails(t_s) else 0.0

    def vibration(t_s):
        return math.sqrt(3.0**2 - 0.5 * 1.5**2) if fails(t_s) else 3.0

    assert flown(zero=zero).error is not None
    assert flown(zero=zero, vibration=vibration).error is None
    # Another IMU would show that line as well.
    assert flown(zero=zero, vibration=vibration, differs=True).error is not None


def test_the_vibration_of_a_wrong_scale_grows_with_it():
    def scale(t_s):
        return 1.2 if fails(t_s) else 1.0

    seen = flown(scale=scale, vibration=lambda t_s: 6.0 * scale(t_s))
    assert seen.error.is_scale


def test_a_zero_that_was_always_wrong_turns_with_the_body():
    seen = flown(zero=lambda t_s: 0.4, q_sb=lambda t_s: INVERTED if fails(t_s) else UPRIGHT)
    assert seen.error is None


def test_an_attitude_that_was_lost_before_hides_nothing():
    """Whatever it made of the vertical force then: the size of the force knows no attitude."""

    def q_ns(t_s):
        return LEANING if t_s < BEGUN_S - 10.0 and round(t_s) % 2 else UPRIGHT

    seen = flown(scale=lambda t_s: 1.1 if fails(t_s) else 1.0, q_ns=q_ns)
    assert seen.begun_s < BEGUN_S + 9.0
    lost = flown(scale=lambda t_s: 1.2 if fails(t_s) else 1.0, q_ns=lambda t_s: LEANING)
    assert lost.error is None


def test_while_the_gyro_turns_fast_nothing_is_known():
    def scale(t_s):
        return 0.8 if fails(t_s) else 1.0

    assert flown(scale=scale, turn_rad_s=1.5).error is None
    assert flown(scale=scale, may_judge=False).error is None


def test_without_altitudes_nothing_is_known():
    assert flown(scale=scale_from, altitude_error=lambda t_s: math.nan).error is None


def scale_from(t_s):
    return 1.2 if t_s >= BEGUN_S else 1.0


def test_it_lasts_while_the_window_begins_anew_and_not_for_ever_without_fixes():
    seen = flown(scale=scale_from)
    assert seen.error is not None
    assert seen.ended_s is None
    seen.size.restart()
    later = Moment(200_000_000, (0.0, 0.0, 0.0), UPRIGHT, 0.01, 0.02, 0.0, 0.0, 0.0)
    assert seen.size.found is not None
    seen.size.take(later, (0.0, 0.0), 0.0, 3.0, may_judge=True)
    assert seen.size.found is None
