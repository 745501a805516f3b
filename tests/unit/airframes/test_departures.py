"""Steps and drifts of figures without noise: just enough, just too little, and in words."""

import math
from itertools import combinations, pairwise, permutations

import numpy as np
import pytest

from h2nav.airframes.comparison import figure_pairs, parameter_pairs
from h2nav.airframes.features import FlightRow
from h2nav.airframes.odometer import ComponentChange, odometers
from h2nav.airframes.trend import (
    STEP_FACTORS,
    departures,
    deviation_of,
    kendall_probability,
    own_past,
)

DAY_S = 86_400.0
MOTOR, BIAS, THROTTLE = "motor_2_us", "imu_1_gyro_bias_x_deg_s", "hover_throttle"
WARMTH = "imu_1_temperature_degc"


def flights(*features, airframe="uid:1"):
    return [FlightRow(f"flight {i}", airframe, i * DAY_S, each) for i, each in enumerate(features)]


def last(values, name=MOTOR):
    *earlier, row = flights(*({name: float(value)} for value in values))
    return departures(earlier, row)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 9, 12, 31])
def test_the_deviation_is_a_quarter_of_all_differences(count):
    """Q_n, by its definition; for normal values it is their deviation."""
    values = np.random.default_rng(count).normal(size=count)
    apart = sorted(abs(a - b) for a, b in combinations(values.tolist(), 2))
    rank = math.comb(count // 2 + 1, 2)
    assert deviation_of(values) == pytest.approx(2.2219 * apart[rank - 1])


def test_the_deviation_of_many_normal_values_is_theirs():
    values = np.random.default_rng(1).normal(0.0, 3.0, 600)
    assert deviation_of(values) == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_kendalls_probability_is_that_of_all_orders(count):
    scores = [
        abs(sum(1 if a < b else -1 for a, b in combinations(order, 2)))
        for order in permutations(range(count))
    ]
    for score in range(1, count * (count - 1) // 2 + 1):
        share = sum(each >= score for each in scores) / len(scores)
        assert kendall_probability(count, score) == pytest.approx(share)


def test_more_flights_need_fewer_deviations():
    """Of an even and of an odd number each: Q_n is another for these."""
    for factors in (STEP_FACTORS[::2], STEP_FACTORS[1::2]):
        assert all(0.6 < later / former < 1.0 for former, later in pairwise(factors[1:]))
    assert STEP_FACTORS[:4] == (35.35, 9.32, 12.0, 6.22)
    # Of infinitely many it is the quantile of a normal value.
    assert 3.51 < STEP_FACTORS[-1] < STEP_FACTORS[-2] < 4.1


@pytest.mark.parametrize(
    ("name", "values", "is_step"),
    [
        # All alike: three times the least deviation of the figure.
        (MOTOR, [*[0.0] * 5, 15.0], False),
        (MOTOR, [*[0.0] * 5, 15.1], True),
        (MOTOR, [*[0.0] * 4, 15.1], False),
        (MOTOR, [*[0.0] * 5, -15.1], False),
        (BIAS, [*[0.0] * 5, 0.29], False),
        (BIAS, [*[0.0] * 5, 0.31], True),
        (BIAS, [*[0.0] * 5, -0.31], True),
        ("rotation_hz", [*[0.0] * 5, 1e6], False),
        ("of_a_later_program", [*[0.0] * 5, 1e6], False),
        # Five that differ: 35.35 of their deviations, 10 * 2.2219, from their median, 20.
        (MOTOR, [0.0, 10.0, 40.0, 30.0, 20.0, 805.0], False),
        (MOTOR, [0.0, 10.0, 40.0, 30.0, 20.0, 806.0], True),
        # Six, by 9.32 of 20 * 2.2219.
        (MOTOR, [50.0, 0.0, 10.0, 40.0, 30.0, 20.0, 439.0], False),
        (MOTOR, [50.0, 0.0, 10.0, 40.0, 30.0, 20.0, 440.0], True),
        # Within what was before it is none, however far from the rest.
        (MOTOR, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 100.0, 100.0], False),
        (MOTOR, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 100.0, 100.1], True),
    ],
)
def test_a_step_is_beyond_all_and_beyond_their_deviations(name, values, is_step):
    assert [one.is_drift for one in last(values, name)] == ([False] if is_step else [])


def test_what_is_said_of_a_step():
    (found,) = last([0.0, 1.0, 2.0, 3.0, 4.0, 200.0])
    assert found[:5] == (MOTOR, 2, False, 200.0, 2.0)
    assert (found.deviation, found.earlier) == (5.0, 5)  # the least that means anything
    assert np.isnan([found.slope, found.limit, found.flights_left]).all()
    assert found.text == "motor 2 works 198 us harder than in the last 5 flights"
    (wide,) = last([0.0, 10.0, 40.0, 30.0, 20.0, 806.0])
    assert wide.deviation == pytest.approx(22.219)
    (less,) = last([*[0.0] * 5, -1.25], BIAS)
    assert less.text == (
        "the gyro of IMU 1 is biased along x by 1.2 deg/s less than in the last 5 flights"
    )
    (share,) = last([*[0.3] * 5, 0.4], THROTTLE)
    assert share.text == (
        "hovering takes a share of the throttle of 0.1 more than in the last 5 flights"
    )


def test_the_last_thirty_flights_count():
    old, new = [100.0] * 20, [0.0] * 30
    (found,) = last([*old, *new, 16.0])
    assert (found.earlier, found.usual) == (30, 0.0)
    assert last([*old, *new[1:], 16.0]) == ()


@pytest.mark.parametrize(
    ("values", "is_drift"),
    [
        # In a row by chance: 2 of 5,040 orders of seven, 2 of 720 of six.
        ([2.0 * i for i in range(7)], True),
        ([2.0 * i for i in range(6)], False),
        ([2.0 * i for i in (0, 1, 2, 3, 5, 4, 6)], False),
        # It adds up to a deviation, the least one.
        ([0.84 * i for i in range(7)], True),
        ([0.83 * i for i in range(7)], False),
        ([-2.0 * i for i in range(7)], False),  # better
        ([0.0] * 12, False),
    ],
)
def test_a_drift_is_in_order_and_adds_up(values, is_drift):
    assert [one.is_drift for one in last(values)] == ([True] if is_drift else [])


@pytest.mark.parametrize(
    ("name", "slope", "limit", "left", "text"),
    [
        (MOTOR, 4.0, 40.0, 4.0, "motor 2 works 4 us harder with each flight, over 7 flights; "
         "40 us in about 4 flights"),
        (MOTOR, 2.0, 40.0, 14.0, "motor 2 works 2 us harder with each flight, over 7 flights"),
        (MOTOR, 8.0, 40.0, 0.0, "motor 2 works 8 us harder with each flight, over 7 flights; "
         "40 us in about 0 flights"),
        (BIAS, -0.3, -2.0, 2 / 3, "the gyro of IMU 1 is biased along x by 0.3 deg/s less with "
         "each flight, over 7 flights; -2 deg/s in about 1 flights"),
        (THROTTLE, 0.1, 0.6875, 0.875, "hovering takes a share of the throttle of 0.1 more with "
         "each flight, over 7 flights; 0.69 in about 1 flights"),
        ("compass_1_residual_ut", 1.0, math.nan, math.nan, "the field of compass 1 is wrong by "
         "1 uT more with each flight, over 7 flights"),
    ],
)  # fmt: skip
def test_what_is_said_of_a_drift(name, slope, limit, left, text):
    (found,) = last([slope * i for i in range(7)], name)
    assert found.slope == pytest.approx(slope)
    np.testing.assert_allclose((found.limit, found.flights_left), (limit, left), atol=1e-9)
    assert (found.value, found.usual) == pytest.approx((6 * slope, 2.5 * slope))
    assert found.earlier == 6
    assert found.text == text


def test_steps_are_told_before_drifts():
    names = {MOTOR: lambda i: 2.0 * i, "motor_1_us": lambda i: 100.0 * (i == 6)}
    names["motor_3_us"] = names["motor_1_us"]
    *earlier, row = flights(*({name: f(i) for name, f in names.items()} for i in range(7)))
    assert [one.name for one in departures(earlier, row)] == ["motor_1_us", "motor_3_us", MOTOR]


@pytest.mark.parametrize(
    ("then", "now", "is_told"),
    [(20.0, 27.0, True), (20.0, 27.1, False), (27.1, 20.0, False), (None, 20.0, False),
     (20.0, None, True)],
)  # fmt: skip
def test_a_bias_is_compared_within_seven_kelvin(then, now, is_told):
    past, own = ({} if t is None else {WARMTH: t} for t in (then, now))
    *earlier, row = flights(*[{BIAS: 0.0, **past}] * 5, {BIAS: 1.0, **own})
    assert bool(departures(earlier, row)) == is_told


def test_the_past_is_the_same_airframes_in_the_order_of_dates():
    rows = flights(*[{}] * 320)
    found = own_past(rows[::-1], rows[310])
    assert found == tuple(rows[10:310])
    assert own_past(rows, rows[0]) == ()
    assert own_past(rows, rows[3]._replace(airframe="uid:2")) == ()
    assert own_past(rows, rows[3]._replace(start_unix_s=math.nan)) == ()
    unknown = flights({}, {}, airframe="")
    assert own_past(unknown, unknown[1]) == ()


# --- two flights side by side, and sums of all ------------------------------------------------


def document(features, airframe="uid:1", parameters=None):
    return {"airframe": {"id": airframe}, "features": features, "parameters": parameters}


@pytest.mark.parametrize(
    ("count", "airframe", "deviation"),
    [(5, "uid:1", 22.219), (4, "uid:1", 5.0), (5, "uid:2", 5.0), (0, "uid:1", 5.0)],
)
def test_figures_are_apart_by_deviations_of_a_difference(count, airframe, deviation):
    values = (0.0, 10.0, 40.0, 30.0, 20.0)[:count]
    earlier = flights(*({MOTOR: value} for value in values), airframe=airframe)
    (found,) = figure_pairs(document({MOTOR: 10.0}), document({MOTOR: 60.0}), earlier)
    assert found[:4] == (MOTOR, "us", 10.0, 60.0)
    assert found.deviation == pytest.approx(deviation)
    assert found.apart == pytest.approx(50.0 / math.sqrt(2.0) / deviation)


def test_the_figures_furthest_apart_come_first():
    one = {MOTOR: 0.0, BIAS: 0.0, "touchdown_m_s": 1.0, "rotation_hz": 1.0, "later": 1.0}
    other = {MOTOR: 5.0, BIAS: -1.0, "rotation_hz": 99.0, "later": 9.0}
    found = figure_pairs(document(one), document(other))
    assert [pair.name for pair in found] == [BIAS, MOTOR, "later", "rotation_hz", "touchdown_m_s"]
    assert [pair.apart is None for pair in found] == [False, False, True, True, True]
    assert [pair.deviation for pair in found] == [0.1, 5.0, None, None, 0.2]
    assert (found[2].unit, found[3].unit) == ("", "Hz")
    assert figure_pairs({}, {}) == ()


@pytest.mark.parametrize(
    ("first", "second", "differs"),
    [(1.0, 1.0, False), (1.0, 1.0 + 1e-9, False), (1.0, 1.0001, True), (0.0, None, True),
     (None, 0.0, True), (None, None, False)],
)  # fmt: skip
def test_parameters_differ_as_float32(first, second, differs):
    pairs = parameter_pairs({"parameters": {"A": first}}, {"parameters": {"A": second}})
    assert pairs == ((("A", first, second),) if differs else ())


@pytest.mark.parametrize("order", [1, -1])
def test_a_component_counts_from_its_last_change_on(order):
    rows = [FlightRow("", "uid:1", day * DAY_S, {}, 600.0, 1000.0, 2, 1) for day in (1, 2, 3)]
    changes = [ComponentChange("uid:1", name, day * DAY_S)
               for name, day in (("motor 2", 1), ("motor 2", 2), ("battery A", 4))]  # fmt: skip
    whole, battery, motor = odometers(rows, changes[::order])
    assert (whole.since_unix_s, whole.flights) == (DAY_S, 3)
    assert battery == ("uid:1", "battery A", 4 * DAY_S, 0, 0.0, 0.0, 0, 0)
    assert motor == ("uid:1", "motor 2", 2 * DAY_S, 2, 1200.0, 2000.0, 4, 2)
