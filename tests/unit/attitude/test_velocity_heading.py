"""Whether velocities confirm, doubt or find a heading: by a filter that only notes it."""

import math

import pytest
from velocity_flights import GAINS

from h2nav.attitude.samples import SensorDoubt, SensorErrors
from h2nav.attitude.velocity_aided.heading_witness import Heading
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix
from h2nav.attitude.velocity_aided.velocity_heading import (
    HeadingState,
    RefusedField,
    VelocityHeading,
)
from h2nav.maths.units import DEG, GRAVITY_M_S2

FIX = TimedFix((1.0, 0.0), (0.0, 0.0), (0.0, 0.0), ((0.0, 0.0),) * 4, 0.04, 0.2)


class Witness:
    """Says what it is told to."""

    def __init__(self, seen):
        self.seen, self.asked, self.adopted, self.cleared_s = seen, [], [], []

    def take(self, *asked):
        self.asked.append(asked)
        return self.seen

    def adopt(self, turn_rad):
        self.adopted.append(turn_rad)

    def clear(self, *time_s):
        self.cleared_s += time_s


class Filter(VelocityHeading):
    """One of which all that an arithmetic gives is noted."""

    def __init__(self, seen=None, age_s=9.0, variance=0.0, refused=None, unknown=False, known=()):
        super().__init__(GAINS)
        self._witness = Witness(seen)
        self.state = HeadingState(age_s, 0.4, variance, 0.002)
        self.refused, self.unknown = refused, unknown
        self.done, self.witnessed = [], False
        self.errors = SensorErrors(*known) if known else SensorErrors((1e-6,) * 3)
        self.gained = (0.0, 0.0)

    def _heading(self):
        return self.state

    def _turn_heading(self, angle_rad):
        self.done.append(("turn", angle_rad))

    @property
    def _noise_densities(self):
        return 1e-6, 1e-3

    @property
    def _heading_is_unknown(self):
        return self.unknown

    @property
    def _is_witnessed(self):
        return self.witnessed

    def _set_witnessed(self, is_witnessed, off_rad):
        self.witnessed = is_witnessed
        self.done.append(("witnessed", is_witnessed, off_rad))

    def _confirm(self, shown_rad):
        self.done.append(("confirm", shown_rad))

    def _doubt_field(self):
        self.done.append(("doubt",))

    def _refused_field(self):
        return self.refused

    def _limit_heading(self, sigma_rad):
        self.done.append(("limit", sigma_rad))

    @property
    def sensor_errors(self):
        return self.errors

    @property
    def field_latency_s(self):
        return 0.0

    def _gained(self):
        return self.gained

    def _open_biases(self, rate, force):
        self.done.append(("open", rate, force))

    def _open_attitude(self, tilt_rad, heading_rad):
        self.done.append(("attitude", tilt_rad, heading_rad))

    def _set_gyro_variance(self, variance):
        self.done.append(("gyro", variance))

    def _set_aided_variances(self, force, lag):
        self.done.append(("aided", force, lag))


def deg(turn_deg, sigma_deg):
    return Heading(turn_deg * DEG, sigma_deg * DEG)


def told(filter_):
    """What the filter is told beyond whether its heading is witnessed, in degrees."""
    return [(what, *(round(x / DEG, 6) for x in more)) for what, *more in filter_.done[1:]]


@pytest.mark.parametrize(
    ("seen", "how", "is_another", "noted"),
    [
        (None, {}, False, []),
        # confirmed by what is known better than 12 deg, to two deviations of it
        (deg(1.0, 2.0), {}, False, [("confirm", 4.0)]),
        (deg(-3.9, 1.0), {}, False, [("confirm", 3.9)]),
        (deg(5.0, 11.99), {}, False, [("confirm", 23.98)]),
        (deg(5.0, 12.01), {}, False, []),
        # doubted beyond 4 deg, and beyond three deviations of both
        (deg(-4.1, 0.1), {}, False, [("doubt",)]),
        (deg(6.1, 1.0), {}, False, [("doubt",)]),
        (deg(5.9, 1.0), {}, False, [("confirm", 5.9)]),
        (deg(5.9, 0.0), {"variance": (2.0 * DEG) ** 2}, False, [("confirm", 5.9)]),
        (deg(6.1, 0.0), {"variance": (2.0 * DEG) ** 2}, False, [("doubt",)]),
        # contradicted beyond 12 deg, and beyond three deviations
        (deg(11.9, 1.0), {}, False, [("doubt",)]),
        (deg(12.1, 1.0), {}, True, [("doubt",), ("turn", 12.1), ("limit", 3.0)]),
        (deg(-14.9, 5.0), {"variance": 1.0}, False, [("confirm", 14.9)]),
        (deg(-15.1, 5.0), {"variance": 1.0}, True, [("turn", -15.1), ("limit", 15.0)]),
        # one that nothing has shown is brought near, and stays unknown
        (deg(26.1, 13.0), {"unknown": True}, True, [("turn", 26.1)]),
        (deg(25.9, 13.0), {"unknown": True}, False, []),
        (deg(26.1, 13.0), {}, False, []),
    ],
)
def test_what_velocities_show_of_a_heading(seen, how, is_another, noted):
    filter_ = Filter(seen, **how)
    assert filter_._ask_velocity(FIX, False) is is_another
    assert told(filter_) == noted
    turns = [x for what, *x in filter_.done if what == "turn"]
    assert [[x] for x in filter_._witness.adopted] == turns


@pytest.mark.parametrize(
    ("seen", "before", "is_witnessed", "off_deg"),
    [
        (None, True, False, 0.0),
        (deg(1.0, 11.9), False, True, 0.0),
        (deg(1.0, 12.1), False, False, 0.0),
        # one that has become less certain still is one
        (deg(1.0, 12.1), True, True, 0.0),
        (deg(-2.1, 1.0), False, True, 2.1),
        (deg(1.9, 1.0), False, True, 0.0),
    ],
)
def test_a_witness_keeps_a_heading(seen, before, is_witnessed, off_deg):
    filter_ = Filter(seen)
    filter_.witnessed = before
    filter_._ask_velocity(FIX, False)
    assert filter_.done[0] == ("witnessed", is_witnessed, pytest.approx(off_deg * DEG))


@pytest.mark.parametrize(
    ("age_s", "in_air", "asks"), [(3.99, False, 0), (4.0, False, 1), (9, True, 0)]
)
def test_velocities_are_asked_once_the_tilt_has_settled(age_s, in_air, asks):
    filter_ = Filter(age_s=age_s)
    assert not filter_._ask_velocity(FIX, in_air)
    assert len(filter_._witness.asked) == asks
    if asks:
        ((v_n, earlier, turned_rad, period_s, noise),) = filter_._witness.asked
        assert (v_n, earlier, turned_rad, period_s) == (FIX.v_n, FIX.earlier, 0.4, 0.2)
        walk = ((GRAVITY_M_S2 * 4.0) ** 2 * 1e-6 + 1e-3) * 4.0
        assert [*noise] == pytest.approx([0.2, walk, 0.002])


@pytest.mark.parametrize(
    ("turn_deg", "refused_s", "seen", "is_heard"),
    [
        (40.0, 10.1, deg(35.0, 13.0), True),
        (40.0, 9.9, deg(35.0, 13.0), False),
        (11.9, 10.1, deg(12.0, 13.0), False),
        (-12.1, 10.1, deg(-12.0, 13.0), True),
        # agrees with velocities within three of their deviations, also across the south
        (40.0, 10.1, deg(1.1, 13.0), True),
        (40.0, 10.1, deg(0.9, 13.0), False),
        (170.0, 10.1, deg(-160.0, 13.0), True),
        # ... and within 12 deg at least
        (40.0, 10.1, deg(28.1, 0.5), True),
        (40.0, 10.1, deg(27.9, 0.5), False),
    ],
)
def test_a_refused_field_is_heard_if_velocities_agree(turn_deg, refused_s, seen, is_heard):
    refused = RefusedField(turn_deg * DEG, refused_s)
    assert refused.is_heard_by(seen) is is_heard
    if seen.sigma_rad > 12.0 * DEG:
        filter_ = Filter(seen, refused=refused)
        assert filter_._ask_velocity(FIX, False) is is_heard
        assert told(filter_) == [("turn", turn_deg), ("limit", 39.0)] * is_heard


# --- sensors that are doubted -------------------------------------------------------------------


MAX_ACCEL_BIAS = 0.06  # g: the limit of data sheets
KERNEL = GAINS.kernel


def test_a_doubt_opens_biases_within_what_is_possible():
    filter_ = Filter()
    filter_.doubt(SensorDoubt((1e-3, 0.0, 9.0), (0.2, 99.0), 0.0, 0.5))
    ((what, rate, force),) = filter_.done
    assert what == "open"
    assert rate == pytest.approx((1e-6, 0.0, KERNEL.bias_variance))
    assert force == pytest.approx(((0.2 / GRAVITY_M_S2) ** 2, MAX_ACCEL_BIAS**2))


@pytest.mark.parametrize(("tilt_rad", "opens"), [(0.0, False), (0.1, True)])
def test_a_doubt_opens_an_attitude_that_is_bent(tilt_rad, opens):
    filter_ = Filter()
    filter_.doubt(SensorDoubt(tilt_rad=tilt_rad, heading_rad=0.3))
    assert filter_.done[1:] == [("attitude", 0.1, 0.3)] * opens


def test_without_velocities_no_force_is_estimated():
    filter_ = Filter()
    filter_.gained = None
    filter_.doubt(SensorDoubt((1e-3,) * 3, (0.2, 0.2)))
    assert filter_.done[0][2] is None


@pytest.mark.parametrize(("growth", "clears"), [(3.99, False), (4.01, True)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_gyro_that_is_doubted_anew_clears_the_witness(growth, clears, axis):
    filter_ = Filter()
    rate = [0.0, 0.0, 0.0]
    rate[axis] = math.sqrt(growth * 1e-6)
    filter_.doubt(SensorDoubt(tuple(rate)))
    assert filter_._witness.cleared_s == [4.0] * clears


def test_biases_are_known_with_deviations_of_sensors():
    filter_ = Filter(known=((1e-6,) * 3, (0.0,) * 3, (0.0, 0.0), 0.0, 0.0, 0.01))
    filter_._know_biases((1e-3, 2e-3, 9.0), (0.1, 99.0))
    assert filter_.done[0] == ("gyro", pytest.approx((1e-6, 4e-6, KERNEL.bias_variance)))
    what, force, lag = filter_.done[1]
    assert (what, lag) == ("aided", 0.01)
    assert force == pytest.approx(((0.1 / GRAVITY_M_S2) ** 2, MAX_ACCEL_BIAS**2))


def test_sensors_are_as_well_known_as_some_time_ago():
    errors = SensorErrors(
        (1e-10, 2e-10, 9.0), force_variance=(1e-4, 9e9), fix_latency_variance=1e-6
    )
    filter_ = Filter()
    filter_.know_sensors(errors, 100.0)
    walk = 100.0 * KERNEL.bias_walk
    rate = (1e-10 + walk, 2e-10 + walk, KERNEL.bias_variance)
    assert filter_.done[0] == ("gyro", pytest.approx(rate))
    what, force, lag = filter_.done[1]
    assert what == "aided"
    first = 1e-4 / GRAVITY_M_S2**2 + 100.0 * KERNEL.accel_walk
    assert force == pytest.approx((first, KERNEL.accel_variance))
    assert lag == pytest.approx(1e-6 + 100.0 * KERNEL.fix_lag_walk)
    filter_.know_sensors(errors._replace(fix_latency_variance=9.0), 0.0)
    assert filter_.done[-1][2] == KERNEL.fix_lag_variance
    unknown = Filter()
    unknown.know_sensors(errors._replace(force_variance=(0.0, 1e-4)), 0.0)
    assert [what for what, *_ in unknown.done] == ["gyro"]
