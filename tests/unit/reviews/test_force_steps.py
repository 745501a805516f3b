"""A jump of an accelerometer's bias is found where it is, and nowhere else."""

import numpy as np
import pytest
from needs import DEG
from reviewed_flights import flight, gps_track, ideal, with_gps, with_imu

from h2nav.maths.rows import product
from h2nav.reviews.analysis import analyse
from h2nav.reviews.inertial import exponential

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
