"""A lane whose filter has the memory of another one keeps the bias of its own gyro."""

import pytest

from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorCorrection,
    SensorErrors,
    Trust,
)
from h2nav.maths.units import SECOND_NS
from h2nav.service.own_bias import BIAS_NS, OwnBias

SAMPLE = ImuSample(1_000, (0.5, -0.2, 0.1), (0.0, 0.0, -9.8))
BIAS = (0.01, -0.02, 0.03)


class FilterThatKnows:
    """A filter whose bias is known; it keeps the rates that it is given."""

    def __init__(self, bias_b=BIAS, is_aligned=True):
        self.bias_b, self.is_aligned = bias_b, is_aligned
        self.rates = []

    def update(self, sample):
        self.rates.append(sample.w_b)
        if not self.is_aligned:
            return None
        return AttitudeEstimate(
            sample.t_us,
            (1.0, 0.0, 0.0, 0.0),
            sample.w_b,
            self.bias_b,
            (0.0, 0.0, 0.0),
            0.1,
            Trust(0),
        )


def test_nothing_is_changed_as_long_as_the_filter_has_its_own_memory():
    chosen = FilterThatKnows()
    bias = OwnBias()
    bias.learn(0, (0.3, 0.2, 0.1))
    assert bias.update(chosen, SAMPLE).bias_b == BIAS
    assert chosen.rates == [SAMPLE.w_b]


def test_the_difference_of_the_biases_is_taken_out_of_the_rates_and_put_back():
    own, other = OwnBias(), OwnBias()
    own.learn(0, (0.11, -0.22, 0.33))
    own.take_over(other, BIAS)
    chosen = FilterThatKnows()
    found = own.update(chosen, SAMPLE)
    assert chosen.rates[0] == pytest.approx((0.5 - 0.1, -0.2 + 0.2, 0.1 - 0.3))
    assert found.bias_b == pytest.approx((0.11, -0.22, 0.33))


def test_a_lane_that_took_over_hands_on_what_it_has_itself():
    first, second, third = OwnBias(), OwnBias(), OwnBias()
    second.learn(0, (0.11, -0.22, 0.33))
    second.take_over(first, BIAS)
    third.learn(0, (0.5, 0.6, 0.7))
    # The bias of the second lane as its estimates say it, of which its filter knows `BIAS`.
    third.take_over(second, (0.11, -0.22, 0.33))
    assert third.update(FilterThatKnows(), SAMPLE).bias_b == pytest.approx((0.5, 0.6, 0.7))


def test_without_a_bias_of_its_own_the_others_holds():
    own = OwnBias()
    own.take_over(OwnBias(), BIAS)
    assert own.update(FilterThatKnows(), SAMPLE).bias_b == BIAS


def test_the_bias_of_five_seconds_ago_counts():
    own = OwnBias()
    for second in range(11):
        own.learn(second * SECOND_NS, (0.01 * second, 0.0, 0.0))
    assert BIAS_NS == 5 * SECOND_NS
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    assert own.update(FilterThatKnows((0.0, 0.0, 0.0)), SAMPLE).bias_b[0] == pytest.approx(0.05)


def test_a_filter_that_aligns_gives_nothing():
    own = OwnBias()
    own.learn(0, (0.1, 0.0, 0.0))
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    assert own.update(FilterThatKnows(is_aligned=False), SAMPLE) is None


def correction(rate_b=(0.0, 0.0, 0.0), force_b=(0.0, 0.0, 0.0)):
    return SensorCorrection(rate_b, force_b, (0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 2, 0.0, 0.0)


def test_what_was_found_is_taken_off_the_samples_and_the_rate_reported_as_bias():
    own, chosen = OwnBias(), FilterThatKnows()
    own.correct(correction((0.1, 0.0, -0.2), (3.0, -1.0, 0.0)))
    assert own.felt(SAMPLE).f_b == pytest.approx((-3.0, 1.0, -9.8))
    found = own.update(chosen, SAMPLE)
    assert chosen.rates[0] == pytest.approx((0.4, -0.2, 0.3))
    assert found.bias_b == pytest.approx((0.11, -0.02, -0.17))


def test_a_fault_that_ends_is_found_with_the_opposite_sign_and_nothing_is_left():
    own = OwnBias()
    own.correct(correction((0.1, 0.0, 0.0), (3.0, 0.0, 0.0)))
    own.correct(correction((-0.1, 0.0, 0.0), (-3.0, 0.0, 0.0)))
    assert own.felt(SAMPLE) == SAMPLE
    assert own.update(FilterThatKnows(), SAMPLE).bias_b == pytest.approx(BIAS)


def test_the_bias_at_rest_is_replaced_and_outlasts_a_sensor_that_was_wrong():
    own = OwnBias()
    own.rest((0.0, 0.0, 0.5))
    own.rest((0.0, 0.0, 0.3))
    own.correct(correction(force_b=(2.0, 0.0, 0.0)))
    assert own.felt(SAMPLE).f_b == pytest.approx((-2.0, 0.0, -10.1))
    own.forget_found()
    assert own.felt(SAMPLE).f_b == pytest.approx((0.0, 0.0, -10.1))
    own.forget_force()
    assert own.felt(SAMPLE) == SAMPLE
    assert not own.pushes


def test_a_sample_without_a_force_stays_without():
    own = OwnBias()
    own.rest((0.0, 0.0, 0.5))
    missing = SAMPLE._replace(f_b=(0.0, 0.0, 0.0))
    assert own.felt(missing) == missing


@pytest.mark.parametrize(("known_b", "differs"), [(BIAS, False), ((0.01, -0.02, 0.04), True)])
def test_rates_are_corrected_only_where_the_biases_differ(known_b, differs):
    own = OwnBias()
    own.correct(correction((1.0, 0.0, 0.0)))
    own.learn(0, known_b)
    own.take_over(OwnBias(), BIAS)
    assert own.differs is differs


def test_a_zero_that_has_moved_is_that_of_the_bias_that_is_kept():
    own = OwnBias()
    own.learn(0, (0.1, 0.2, 0.3))
    own.learn(SECOND_NS, (0.1, 0.2, 0.3))
    own.shift((0.5, -0.5, 0.25))
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    found = own.update(FilterThatKnows((0.0, 0.0, 0.0)), SAMPLE)
    assert found.bias_b == pytest.approx((0.6, -0.3, 0.55))


@pytest.mark.parametrize(("is_outvoted", "kept"), [(False, 0.4), (True, 0.1)])
def test_a_rate_that_was_found_is_kept_unless_others_will_tell_when_it_ends(is_outvoted, kept):
    own = OwnBias()
    own.learn(0, (0.1, 0.0, 0.0))
    own.correct(correction((0.3, 0.0, 0.0)), is_outvoted=is_outvoted)
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    found = own.update(FilterThatKnows((0.0, 0.0, 0.0)), SAMPLE)
    assert found.bias_b[0] == pytest.approx(kept)


def test_a_correction_that_nobody_outvoted_moves_the_known_zero_of_the_gyro():
    own = OwnBias()
    own.learn(0, (0.1, 0.0, 0.0))
    own.correct(correction((0.3, 0.0, 0.0)))
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    found = own.update(FilterThatKnows((0.0, 0.0, 0.0)), SAMPLE)
    assert found.bias_b == pytest.approx((0.4, 0.0, 0.0))


def test_errors_are_those_of_the_filter_and_what_it_does_not_hold():
    own, of_filter = OwnBias(), SensorErrors((9.0,) * 3, (0.1, 0.2, 0.3))
    assert own.errors(of_filter) == of_filter
    own.rest((0.0, 0.0, 0.5))
    own.correct(correction(force_b=(2.0, -1.0, 0.0)))
    assert own.found_b == (2.0, -1.0, 0.0)
    assert own.pushes
    assert own.errors(of_filter).force_bias_b == pytest.approx((2.1, -0.8, 0.8))


@pytest.mark.parametrize(("last_s", "kept"), [(5.999, 0.1), (6.0, 0.2), (20.0, 0.2)])
def test_a_bias_is_used_once_it_is_five_seconds_old(last_s, kept):
    own = OwnBias()
    for at_s, bias in ((0.0, 0.1), (1.0, 0.2), (last_s, 0.3)):
        own.learn(round(at_s * SECOND_NS), (bias, 0.0, 0.0))
    own.take_over(OwnBias(), (0.0, 0.0, 0.0))
    found = own.update(FilterThatKnows((0.0, 0.0, 0.0)), SAMPLE)
    assert found.bias_b[0] == pytest.approx(kept)


def test_another_scale_multiplies_the_rates_before_the_bias_and_can_end():
    own, chosen = OwnBias(), FilterThatKnows()
    own.learn(0, BIAS)
    own.correct(
        SensorCorrection((0.1, 0.0, -0.1), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0, 0.0), 0.1, 0.1)
    )
    own.scale(0.8)
    assert own.differs
    own.update(chosen, SAMPLE)
    assert chosen.rates[-1] == pytest.approx((0.8 * 0.5 - 0.1, -0.8 * 0.2, 0.8 * 0.1 + 0.1))
    own.scale(1.0)
    assert own.differs  # by the bias
    alone = OwnBias()
    alone.scale(0.8)
    assert alone.differs
    alone.scale(1.0)
    assert not alone.differs
