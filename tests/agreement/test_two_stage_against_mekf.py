"""The constant-gain filter against the optimum: a full-covariance Kalman filter, same samples."""

import pytest
from needs import DEG
from reference_mekf import ReferenceMekf
from synthetic_imu import (
    DENSITIES,
    FIELD,
    RateLaw,
    brisk,
    fly,
    pitch_swing,
    rms_deg,
    slow,
    still,
    wild,
)

from h2nav.attitude.alignment import triad
from h2nav.attitude.two_stage.filter import TwoStageFilter
from h2nav.attitude.two_stage.gains import design_two_stage
from h2nav.attitude.two_stage.trust import TrustLimits
from h2nav.maths import quaternion

RATE_HZ = 100.0
SETTLE_S = 5.0


@pytest.mark.parametrize("law", [still, slow, pitch_swing, brisk, wild])
def test_is_within_two_percent_of_a_full_covariance_filter(law: RateLaw) -> None:
    start = quaternion.from_euler(0.3, 0.2, 1.0)
    ours, optimal = [], []
    for seed in (21, 22):
        flight = fly(law, 25.0, seed, start=start)
        filter_ = TwoStageFilter(design_two_stage(DENSITIES, RATE_HZ, "test"))
        filter_.use_field(FIELD)
        first = flight.samples[0]
        filter_.update(first)
        sigma_bias = TrustLimits().bias_start_deg_s * DEG
        reference = ReferenceMekf(
            DENSITIES, RATE_HZ, triad(first.f_b, first.m_b_ut), 2.0 * DEG, sigma_bias
        )
        for sample, q in zip(flight.samples[1:], flight.q_nb[1:], strict=True):
            estimate = filter_.update(sample)
            reference.update(sample)
            if sample.t_us > SETTLE_S * 1e6:
                assert estimate is not None
                ours.append(quaternion.angle(estimate.q_nb, q))
                optimal.append(reference.error_rad(q))
    assert rms_deg(ours) < 1.02 * rms_deg(optimal)
    assert rms_deg(ours) < 0.06
