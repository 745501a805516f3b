"""When a window in the air begins, what it is given, and what follows from it."""

import math

import pytest
from velocity_flights import GAINS

from h2nav.attitude.samples import ImuSample, SensorErrors, VelocityFix
from h2nav.attitude.velocity_aided.air_alignment import AirReference, Leveled
from h2nav.attitude.velocity_aided.velocity_attitude import VelocityAttitude
from h2nav.maths.quaternion import IDENTITY
from h2nav.maths.units import DEG, GRAVITY_M_S2

REST = (0.0, 0.0, -GRAVITY_M_S2)
STILL = (0.0, 0.0, 0.0)


class Window:
    """Notes what it is given."""

    def __init__(self, found=None):
        self.found, self.given = found, []

    def is_over(self, t_us):
        return t_us > 5_000_000

    def add(self, *given):
        self.given.append(given)

    def take(self, *given):
        self.given.append(given)

    def solve(self, *given):
        self.given.append(given)
        return self.found


class Filter(VelocityAttitude):
    """One that flies, and of which all that an arithmetic gives is noted."""

    def __init__(self, bias_rad_s=1e-3, flies=True, late_s=0.0):
        super().__init__(GAINS)
        self.errors = SensorErrors(((bias_rad_s / math.sqrt(3.0)) ** 2,) * 3, fix_latency_s=late_s)
        self.flies, self.found, self.cleared = flies, [], 0
        self._witness.clear = self._clear

    def _clear(self):
        self.cleared += 1

    @property
    def _flies(self):
        return self.flies

    def _attitude(self):
        return IDENTITY

    def _reference(self):
        return AirReference(50.0, 1.0, 0.1, 0.1, 0.2)

    def _without_biases(self, sample):
        return (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), sample.m_b_ut

    def _find_in_air(self, found):
        self.found.append(found)

    @property
    def sensor_errors(self):
        return self.errors

    @property
    def field_latency_s(self):
        return 0.03

    # --- not asked for ---------------------------------------------------------------------------

    def _gained(self):
        raise AssertionError

    def _open_biases(self, rate, force):
        raise AssertionError

    def _open_attitude(self, tilt_rad, heading_rad):
        raise AssertionError

    def _set_gyro_variance(self, variance):
        raise AssertionError

    def _set_aided_variances(self, force, lag):
        raise AssertionError


@pytest.mark.parametrize(
    ("bias_deg_s", "flies", "begins"),
    [(0.29, True, True), (0.31, True, False), (0.1, False, False)],
)
def test_a_window_begins_in_the_air_with_a_gyro_that_is_known(bias_deg_s, flies, begins):
    filter_ = Filter(bias_deg_s * DEG, flies)
    filter_._watch_in_air(7)
    assert (filter_._air is not None) is begins
    if begins:
        assert filter_._air.values()[0] == 7


@pytest.mark.parametrize(
    ("sample", "kept", "added"),
    [
        (ImuSample(5_000_000, STILL, REST, (1.0, 2.0, 3.0)), True, True),
        (ImuSample(5_000_001, STILL, REST), None, False),
        (ImuSample(1_000_000, STILL, REST, clipped=True), False, False),
        (ImuSample(1_000_000, STILL, STILL), False, False),
    ],
)
def test_a_window_is_given_samples_without_biases_and_begins_anew_where_one_hides_a_turn(
    sample, kept, added
):
    filter_, window = Filter(), Window()
    filter_._air = window
    filter_._follow_in_air(window, sample)
    given = (sample.t_us, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), sample.m_b_ut, 0.03)
    assert window.given == [given] * added
    if kept is None:
        assert filter_._air is None, "it has ended"
    else:
        assert (filter_._air is window) is kept
        assert kept or filter_._air.values()[0] == 1_000_000


LEVELED = Leveled(IDENTITY, 0.01, 0.1, 2.0)


@pytest.mark.parametrize(
    ("found", "clears"),
    [(None, 0), (LEVELED, 1), (LEVELED._replace(heading_sigma_rad=math.inf), 0)],
)
def test_an_attitude_that_is_found_is_continued_with(found, clears):
    filter_, window = Filter(late_s=0.2), Window(found)
    filter_._take_in_air(window, VelocityFix(1_000_000, (1.0, 2.0, 3.0), 0.01))
    assert window.given == [
        (800_000.0, (1.0, 2.0, 3.0)),
        (IDENTITY, filter_._reference(), 0.05),  # no receiver is better
    ]
    assert filter_.found == ([] if found is None else [found])
    assert filter_.cleared == clears
    filter_._take_in_air(window, VelocityFix(1_000_000, STILL, 0.3))
    assert window.given[-1][2] == 0.3
