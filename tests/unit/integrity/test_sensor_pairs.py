"""When the same sensors of two IMUs differ: just enough, and just too little."""

import math
import random

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.sensor_pairs import FailedComparison, ImuWindows, InertialSensor, SensorPair
from h2nav.maths.units import DEG

GYRO, ACCELEROMETER = InertialSensor
ZERO = (0.0, 0.0, 0.0)
DOWN = (0.0, 0.0, -9.80665)
WINDOW_US = 200_000
WINDOW_S = 0.2
PERIOD_US = 10_000
PER_WINDOW = WINDOW_US // PERIOD_US
SIGNS = (1.0, -1.0, -1.0, 1.0)  # a noise without mean that ends as it begins


def closed(samples):
    """The window of these samples; None if it cannot be compared."""
    windows = ImuWindows()
    windows.begin(0, samples[0])
    windows.samples.extend(samples[1:])
    return windows.closed if windows.begin(1, samples[0]) else None


def window(rate=ZERO, force=DOWN, *, slope=ZERO, noise=1e-6, shaken=0.0, late_us=0, still=False):
    """One window about values that change by `slope` (rad/s^2) and vibrate (m/s^2)."""
    samples = []
    for i in range(PER_WINDOW):
        t_us = i * PERIOD_US + late_us
        from_middle_s = 1e-6 * (t_us - PERIOD_US * (PER_WINDOW - 1) / 2)
        sign = 0.0 if still else SIGNS[i % 4]
        rates = tuple(
            w + a * from_middle_s + sign * noise for w, a in zip(rate, slope, strict=True)
        )
        forces = tuple(f + sign * (noise + shaken) for f in force)
        samples.append(ImuSample(t_us, rates, forces))
    return closed(samples)


class Pair:
    """Two sensors of a kind that are compared window by window."""

    def __init__(self, part=GYRO):
        self.pair, self.t_us = SensorPair(part), 0

    def compare(self, first, second, windows=1):
        for _ in range(windows):
            self.t_us += WINDOW_US
            self.pair.compare(self.t_us, first, second)
        return self.pair.ratio


def learnt(part=GYRO, **second):
    """Two that have shown the same, or this, for a minute."""
    both = Pair(part)
    both.compare(window(), window(**second), 300)
    assert both.pair.agrees(both.t_us)
    return both


# --- windows ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("samples", "enough"), [(3, False), (4, True)])
def test_a_mean_needs_four_samples(samples, enough):
    made = [ImuSample(i * PERIOD_US, ZERO, DOWN) for i in range(samples)]
    assert (closed(made) is not None) is enough


@pytest.mark.parametrize("place", [0, 2, 4])
def test_a_window_with_a_clipped_sample_is_not_compared(place):
    windows = ImuWindows()
    windows.begin(7, ImuSample(0, ZERO, DOWN))
    assert windows.closed is None
    windows.samples.extend(ImuSample(i * PERIOD_US, ZERO, DOWN) for i in range(1, 5))
    clipped = [
        ImuSample(WINDOW_US + i * PERIOD_US, ZERO, DOWN, clipped=i == place) for i in range(5)
    ]
    assert windows.begin(8, clipped[0])
    windows.samples.extend(clipped[1:])
    assert not windows.begin(9, ImuSample(2 * WINDOW_US, ZERO, DOWN))
    assert windows.closed.number == 7
    assert (windows.number, len(windows.samples)) == (9, 1)


def test_a_window_knows_mean_middle_and_change():
    made = window((0.1, -0.2, 0.3), (1.0, 2.0, -9.0), slope=(0.5, -1.0, 2.0), late_us=400)
    assert (made.number, made.samples) == (0, PER_WINDOW)
    assert made.centre_us == pytest.approx(95_000.0 + 400.0)
    rates, forces = made.means[GYRO], made.means[ACCELEROMETER]
    assert rates.value == pytest.approx((0.1002, -0.2004, 0.3008))
    assert rates.change == pytest.approx((0.095, -0.19, 0.38), abs=1e-9)
    assert forces.value == pytest.approx((1.0, 2.0, -9.0))
    assert forces.change == pytest.approx(ZERO, abs=1e-9)


def test_noise_is_measured_about_the_motion():
    drawn = random.Random(5)
    sigma, slope = 0.02, 0.3
    samples = []
    for i in range(4000):
        rate = tuple(slope * 0.01 * i + drawn.gauss(0.0, sigma) for _ in range(3))
        samples.append(ImuSample(i * PERIOD_US, rate, DOWN))
    found = closed(samples).means
    assert found[GYRO].variance == pytest.approx(3.0 * sigma**2, rel=0.05)
    assert not found[GYRO].is_still
    assert (found[ACCELEROMETER].variance, found[ACCELEROMETER].is_still) == (0.0, True)


@pytest.mark.parametrize("axis", range(3))
def test_a_sensor_that_changes_on_one_axis_alone_does_not_repeat_itself(axis):
    other = tuple(1e-6 * (i == axis) for i in range(3))
    made = closed([ImuSample(i * PERIOD_US, other if i == 2 else ZERO, DOWN) for i in range(5)])
    assert not made.means[GYRO].is_still


# --- what explains a difference ---------------------------------------------------------------


def failed(lefts, values, still=()):
    shape = FailedComparison()
    for left, value in zip(lefts, values, strict=True):
        mean = window(value).means[GYRO]
        shape.add(left, mean, mean)
    return shape


VALUES = ((0.3, 0.1, 0.0), (-0.2, 0.4, 0.1), (0.1, -0.3, 0.2))


def test_a_constant_error():
    shape = failed([(0.03, 0.0, -0.04)] * 3, VALUES)
    assert shape.windows == 3
    assert (shape.constant, shape.usual) == pytest.approx((0.05, 0.05))
    constant, scale = shape.unexplained()
    assert constant == pytest.approx(0.0, abs=1e-9)
    assert scale > 0.5


def test_errors_that_cancel_are_no_constant():
    shape = failed([(0.05, 0.0, 0.0), (-0.05, 0.0, 0.0)], VALUES[:2])
    assert shape.constant == 0.0
    assert shape.usual == pytest.approx(0.05)
    assert shape.unexplained()[0] == 1.0


@pytest.mark.parametrize("scale", [0.2, -0.2, 0.49, -0.49])
def test_an_error_of_scale(scale):
    shape = failed([tuple(scale * x for x in value) for value in VALUES], VALUES)
    assert shape.scale == pytest.approx(scale, rel=1e-4)
    assert shape.unexplained()[1] == pytest.approx(0.0, abs=1e-6)
    assert shape.unexplained()[0] > 0.5


@pytest.mark.parametrize("scale", [0.51, -0.51])
def test_a_scale_beyond_half_explains_nothing(scale):
    shape = failed([tuple(scale * x for x in value) for value in VALUES], VALUES)
    assert shape.unexplained()[1] == 1.0


def test_no_difference_needs_no_explanation():
    assert FailedComparison().unexplained() == (1.0, 1.0)
    assert (FailedComparison().constant, FailedComparison().usual) == (0.0, 0.0)
    assert failed([ZERO], [ZERO]).scale == 0.0


def test_a_sensor_is_frozen_from_the_second_window_on_until_it_changes():
    shape, moving, still = FailedComparison(), window().means[GYRO], window(still=True).means[GYRO]
    seen = []
    for second in (still, still, moving, still, still):
        shape.add(ZERO, moving, second)
        seen.append((shape.is_frozen(0), shape.is_frozen(1)))
    assert seen == [(False, frozen) for frozen in (False, True, False, False, True)]


def test_how_far_the_means_of_either_have_moved():
    shape, still = FailedComparison(), window(still=True).means[GYRO]
    for x in (0.2, -0.1, 0.1):
        shape.add(ZERO, window((x, 0.0, 0.1)).means[GYRO], still)
    assert shape.moved(0) == pytest.approx(0.3, abs=1e-5)
    assert shape.moved(1) == 0.0


# --- how much sound ones may differ -----------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "difference", "fails"),
    [
        # four deviations of what data sheets allow of two: 5 deg/s; 0.5 m/s^2 and 3 % of g
        (GYRO, 19.9 * DEG, False),
        (GYRO, 20.1 * DEG, True),
        (ACCELEROMETER, 2.3, False),
        (ACCELEROMETER, 2.4, True),
    ],
)
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_before_anything_is_known_they_may_differ_as_data_sheets_allow(
    part, difference, fails, axis, sign
):
    left = tuple(sign * difference * (i == axis) for i in range(3))
    both, about = Pair(part), ZERO if part is GYRO else DOWN
    name = "rate" if part is GYRO else "force"
    first = tuple(x + 0.5 * d for x, d in zip(about, left, strict=True))
    second = tuple(x - 0.5 * d for x, d in zip(about, left, strict=True))
    ratio = both.compare(window(**{name: first}), window(**{name: second}))
    assert (ratio > 1.0) is fails
    assert both.pair.shape.windows == fails
    assert both.pair.agrees(both.t_us) is not fails


@pytest.mark.parametrize(
    ("part", "second", "least", "most"),
    [
        (GYRO, {"rate": (0.0, 3.0 * DEG, 0.0)}, 0.4 * DEG, 0.55 * DEG),
        (ACCELEROMETER, {"force": (0.0, 0.4, -9.80665)}, 0.25, 0.4),
    ],
)
def test_a_constant_difference_is_learnt_and_a_small_change_of_it_fails(part, second, least, most):
    for change, fails in ((least, False), (most, True)):
        both = learnt(part, **second)
        name = "rate" if part is GYRO else "force"
        first = ZERO if part is GYRO else DOWN
        changed = (first[0] + change, *first[1:])
        assert (both.compare(window(**{name: changed}), window(**second)) > 1.0) is fails


def test_a_turn_and_a_scale_of_one_against_the_other_are_learnt_from_motion():
    """a - b = c + D m with m the middle: of what has not been seen too."""
    constant = (1.0 * DEG, -2.0 * DEG, 0.5 * DEG)
    rows = ((0.02, 0.04, 0.0), (-0.04, 0.02, 0.01), (0.0, -0.01, 0.02))

    def two(middle):
        turned = [sum(d * m for d, m in zip(row, middle, strict=True)) for row in rows]
        left = [c + t for c, t in zip(constant, turned, strict=True)]
        return [
            window(tuple(m + sign * d for m, d in zip(middle, left, strict=True)))
            for sign in (0.5, -0.5)
        ]

    drawn, both = random.Random(3), Pair()
    for _ in range(400):
        both.compare(*two([drawn.uniform(-1.0, 1.0) for _ in range(3)]))
    for unseen in ((2.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 2.0), (1.5, 1.5, -1.5)):
        assert both.compare(*two(unseen)) < 0.05


@pytest.mark.parametrize("late_us", [4000, -4000])
def test_a_delay_of_one_against_the_other_is_learnt(late_us):
    """Both say the same of the same time, but the second says it of another one."""
    drawn, both, ratios = random.Random(4), Pair(), []
    for _ in range(600):
        slope = tuple(drawn.choice((-1.0, 1.0)) * 3.0 for _ in range(3))
        shifted = tuple(-a * 1e-6 * late_us for a in slope)
        ratios.append(both.compare(window(slope=slope), window(shifted, slope=slope)))
    assert max(ratios[:10]) < 1.0
    assert max(ratios[-50:]) < 0.5 * max(ratios[:10])
    assert both.compare(window(slope=(6.0, 6.0, 6.0)), window(slope=(6.0, 6.0, 6.0))) > max(
        ratios[-50:]
    )


def test_what_is_large_but_does_not_fail_is_learnt_at_once():
    both = Pair()
    large = window((15.0 * DEG, 0.0, 0.0))
    assert 0.7 < both.compare(large, window()) < 1.0
    assert both.compare(large, window()) < 0.1


def seen_last(seconds, after_s):
    """Two whose delay, turn and scale have shown in motion, and not for a time since."""
    drawn, both = random.Random(4), Pair()
    for _ in range(round(seconds / WINDOW_S)):
        slope, rate = ([drawn.uniform(-2.0, 2.0) for _ in range(3)] for _ in range(2))
        both.compare(window(rate, slope=slope), window(rate, slope=slope))
    both.compare(window(), window(), round(after_s / WINDOW_S))
    return both


@pytest.mark.parametrize(
    ("after_s", "apart_s"),
    # 1 ms, and 0.1 ms per root second since it was seen, of which four deviations fail
    [(1.0, 0.004), (900.0, 4.0 * math.hypot(0.001, 1e-4 * 30.0))],
)
def test_a_delay_that_was_learnt_may_change(after_s, apart_s):
    slope = (20.0, 0.0, 0.0)
    for share, fails in ((0.85, False), (1.2, True)):
        both = seen_last(60.0, after_s)
        late = (share * apart_s * slope[0], 0.0, 0.0)
        assert (both.compare(window(slope=slope), window(late, slope=slope)) > 1.0) is fails


@pytest.mark.parametrize(
    ("after_s", "scale"),
    # 0.3 % of nonlinearity, and 0.01 % per root second since it was seen
    [(1.0, 0.012), (2500.0, 4.0 * math.hypot(0.003, 1e-4 * 50.0))],
)
def test_a_scale_that_was_learnt_may_change(after_s, scale):
    for share, fails in ((0.85, False), (1.2, True)):
        both = seen_last(60.0, after_s)
        first = ((1.0 + share * scale) * 4.0, 0.0, 0.0)
        assert (both.compare(window(first), window((4.0, 0.0, 0.0))) > 1.0) is fails


@pytest.mark.parametrize("late_us", [4000, -4000])
def test_samples_of_two_times_are_compared_at_one(late_us):
    both, slope = learnt(), (3.0, -2.0, 1.0)
    shown = tuple(a * 1e-6 * late_us for a in slope)
    assert both.compare(window(slope=slope), window(slope=slope, late_us=late_us)) < 0.1
    assert both.compare(window(slope=slope), window(shown, slope=slope, late_us=late_us)) < 1.0


@pytest.mark.parametrize(
    ("part", "difference", "shaken", "fails"),
    [
        (GYRO, 1.5 * DEG, 0.0, True),
        (GYRO, 1.5 * DEG, 20.0, False),
        (ACCELEROMETER, 1.5, 0.0, True),
        (ACCELEROMETER, 1.5, 20.0, False),
    ],
)
@pytest.mark.parametrize("place", [0, 1])
def test_vibration_of_either_may_make_them_differ(part, difference, shaken, fails, place):
    both = learnt(part)
    x = (difference, 0.0, 0.0)
    changed = {"rate": x} if part is GYRO else {"force": (difference, 0.0, DOWN[2])}
    vibrating = [{}, {}]
    vibrating[place] = {"shaken": shaken}
    ratio = both.compare(window(**changed, **vibrating[0]), window(**vibrating[1]))
    assert (ratio > 1.0) is fails


@pytest.mark.parametrize(
    ("rate", "slope", "fails"),
    [
        (ZERO, ZERO, True),
        ((3.0, 0.0, 0.0), ZERO, False),  # 3 cm of lever arm times 9 rad^2/s^2
        ((0.0, 0.0, 3.0), ZERO, False),
        (ZERO, (9.0, 0.0, 0.0), False),
    ],
)
def test_a_lever_arm_between_accelerometers_shows_in_turns(rate, slope, fails):
    both = learnt(ACCELEROMETER)
    turning = {"rate": rate, "slope": slope}
    moved = window(force=(0.7, 0.0, DOWN[2]), **turning)
    assert (both.compare(moved, window(**turning)) > 1.0) is fails


# --- how long, and what follows ---------------------------------------------------------------


@pytest.mark.parametrize(("later_us", "is_fresh"), [(999_999, True), (1_000_000, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_comparison_is_good_for_a_second(later_us, is_fresh, sign):
    both = learnt()
    assert both.pair.is_fresh(both.t_us + sign * later_us) is is_fresh
    assert both.pair.agrees(both.t_us + sign * later_us) is is_fresh


def test_what_was_never_compared_does_not_agree():
    assert not SensorPair(GYRO).is_fresh(0)
    assert not SensorPair(GYRO).agrees(0)


def raised(part=GYRO, first=None, second=None, most=100):
    """Compares until they have differed for long enough."""
    both = learnt(part)
    for _ in range(most):
        both.compare(window(**(first or {})), window(**(second or {})))
        if both.pair.is_raised:
            assert both.pair.raised_us == both.t_us
            return both
    raise AssertionError("never raised")


def test_a_large_difference_is_raised_and_cleared_where_its_reason_is_known():
    both = raised(first={"rate": (0.5, 0.0, 0.0)})
    assert not both.pair.agrees(both.t_us)
    assert both.pair.shape.constant == pytest.approx(0.5, rel=0.01)
    both.pair.clear()
    assert (both.pair.is_raised, both.pair.raised_us) == (False, None)
    assert both.pair.shape.windows == 0
    both.compare(window((0.5, 0.0, 0.0)), window())
    assert not both.pair.is_raised


def test_a_difference_that_ends_is_forgotten_before_it_is_raised():
    both = learnt()
    both.compare(window((0.05, 0.0, 0.0)), window())
    assert both.pair.shape.windows == 1
    both.compare(window(), window())
    assert both.pair.shape.windows == 0


def test_a_gyro_opens_the_tilt_by_what_it_has_turned_since_and_at_most_thirty_degrees():
    both = raised(first={"rate": (0.1, 0.0, 0.0)})
    assert both.pair.open_rad == pytest.approx(0.1 * WINDOW_S, rel=0.05)
    both.compare(window((0.1, 0.0, 0.0)), window())
    assert both.pair.open_rad == pytest.approx(0.2 * WINDOW_S, rel=0.05)
    both.compare(window((5.0, 0.0, 0.0)), window(), 2)
    assert both.pair.open_rad == pytest.approx(30.0 * DEG)


def test_an_accelerometer_opens_the_tilt_by_its_share_of_g():
    both = raised(ACCELEROMETER, {"force": (1.0, 0.0, DOWN[2])})
    assert both.pair.open_rad == pytest.approx(1.0 / 9.80665, rel=0.02)
    both.compare(window(force=(1.0, 0.0, DOWN[2])), window(), 3)
    assert both.pair.open_rad == pytest.approx(1.0 / 9.80665, rel=0.02)


def test_after_ten_seconds_without_a_name_the_tilt_closes_over_ten_seconds():
    both = raised(first={"rate": (1.0, 0.0, 0.0)})
    both.compare(window((1.0, 0.0, 0.0)), window(), 50)
    assert both.pair.open_rad == pytest.approx(30.0 * DEG)
    both.compare(window((1.0, 0.0, 0.0)), window(), 50)
    assert both.pair.open_rad == pytest.approx(30.0 * DEG / math.e)


@pytest.mark.parametrize(
    ("difference", "hears"),
    [(5.0 * DEG, True), (11.8 * DEG, True), (12.2 * DEG, False)],  # data sheets: 12 deg/s
)
def test_a_constant_within_data_sheets_is_heard_after_half_a_minute(difference, hears):
    first = {"rate": (0.0, -difference, 0.0)}
    both = raised(first=first)
    both.compare(window(**first), window(), 149)
    assert both.pair.heard == ZERO
    both.compare(window(**first), window(), 1)
    heard = -0.02 * difference if hears else 0.0
    assert both.pair.heard == pytest.approx((0.0, heard, 0.0), rel=0.02)
    both.compare(window(**first), window(), 49)
    share = 1.0 - math.exp(-1.0) if hears else 0.0
    assert both.pair.heard[1] == pytest.approx(-share * difference, rel=0.03)


@pytest.mark.parametrize("place", [0, 1])
def test_what_repeats_one_value_is_not_heard(place):
    frozen = [{}, {}]
    frozen[place] = {"still": True}
    both = raised(first={"rate": (0.05, 0.0, 0.0)} | frozen[0], second=frozen[1])
    both.compare(window((0.05, 0.0, 0.0), **frozen[0]), window(**frozen[1]), 200)
    assert both.pair.heard == ZERO


def test_the_mean_of_a_wrong_scale_is_not_heard():
    first, second = {"rate": (0.56, 0.0, 0.0)}, {"rate": (0.40, 0.0, 0.0)}
    other = {"rate": (-0.28, 0.0, 0.0)}, {"rate": (-0.20, 0.0, 0.0)}
    both = raised(first=first, second=second)
    for _ in range(120):
        both.compare(window(**first), window(**second))
        both.compare(window(**other[0]), window(**other[1]))
    assert both.pair.is_raised
    assert both.pair.heard == ZERO


def test_a_wrong_scale_stays_accused_while_nothing_turns():
    both = raised(first={"rate": (0.7, 0.0, 0.0)}, second={"rate": (0.5, 0.0, 0.0)})
    for x in (-0.5, 0.5, -0.3, 0.3):
        both.compare(window((1.4 * x, 0.0, 0.0)), window((x, 0.0, 0.0)))
    both.compare(window(), window(), 100)
    assert both.pair.is_raised


def test_a_constant_that_is_gone_is_no_longer_accused():
    both = raised(first={"rate": (0.2, 0.0, 0.0)})
    both.compare(window(), window(), 40)
    assert not both.pair.is_raised
    assert both.pair.raised_us is None
