"""Trends on simulated airframes: what is found, when, and how often something is found wrongly."""

import numpy as np
import pytest

from h2nav.airframes.features import FEATURES, FlightRow, airframe_id, named, row_of_document
from h2nav.airframes.trend import (
    MAX_EARLIER,
    MIN_EARLIER,
    STEP_FACTORS,
    departures,
    deviation_of,
    kendall_probability,
)

DAY_S = 86_400.0


def rows(values, name="motor_2_us", **more):
    return [
        FlightRow(f"flight {i}", "uid:1", i * DAY_S, {name: float(value), **more})
        for i, value in enumerate(values)
    ]


def last(values, name="motor_2_us"):
    flights = rows(values, name)
    return departures(flights[:-1], flights[-1])


def test_a_motor_that_works_harder_is_told_in_words():
    noise = np.random.default_rng(1).normal(0.0, 3.0, 12)
    (found,) = last([*noise, 40.0])
    assert not found.is_drift
    assert found.text == "motor 2 works 39 us harder than in the last 12 flights"
    assert found.number == 2
    assert found.earlier == 12


def test_fewer_than_five_earlier_flights_show_nothing():
    assert not last([0.0, 1.0, 2.0, 1.0, 500.0])
    assert last([0.0, 1.0, 2.0, 1.0, 0.0, 500.0])


def test_what_became_better_is_not_told():
    noise = np.random.default_rng(1).normal(0.0, 3.0, 12)
    assert not last([*noise, -40.0])
    assert last([*noise, -40.0], "imu_1_gyro_bias_x_deg_s")


def test_less_than_the_least_deviation_is_nothing():
    # All alike to a hundredth, as by a simulator: the deviation is that of the feature.
    assert not last([0.01, 0.02, 0.0, 0.01, 0.0, 0.02, 0.01, 9.0])
    assert last([0.01, 0.02, 0.0, 0.01, 0.0, 0.02, 0.01, 16.0])


def test_flights_of_other_airframes_and_later_ones_do_not_count():
    others = [row._replace(airframe="uid:2") for row in rows(range(20))]
    assert not departures(others, rows([100.0])[0])
    later = rows(np.zeros(20))
    assert not departures(later[1:], later[0]._replace(features={"motor_2_us": 100.0}))
    undated = later[0]._replace(start_unix_s=float("nan"), features={"motor_2_us": 100.0})
    assert not departures(later, undated)


def test_a_bias_is_compared_with_flights_as_warm():
    name = "imu_1_gyro_bias_x_deg_s"
    warm = [0.0, 0.01, 0.02, 0.0, 0.01, 0.02, 0.01]
    cold = [
        row._replace(features={name: value, "imu_1_temperature_degc": 20.0})
        for row, value in zip(rows(warm), warm, strict=True)
    ]
    now = rows(range(9))[8]._replace(features={name: 0.9, "imu_1_temperature_degc": 45.0})
    assert not departures(cold, now)
    now = now._replace(features={**now.features, "imu_1_temperature_degc": 24.0})
    assert departures(cold, now)


def test_a_drift_is_told_with_the_flights_left():
    rng = np.random.default_rng(3)
    vibration = 8.0 + 0.6 * np.arange(30) + rng.normal(0.0, 1.0, 30)
    (found,) = last(vibration, "imu_1_vibration_m_s2")
    assert found.is_drift
    assert found.slope == pytest.approx(0.6, abs=0.08)
    assert found.limit == 30.0
    assert found.flights_left == pytest.approx((30.0 - 8.0 - 0.6 * 29.0) / 0.6, abs=4.0)
    assert "30 m/s^2 in about" in found.text


def test_kendall_is_exact():
    from scipy.stats import kendalltau

    for order in ([1, 2, 3, 4, 5, 7, 6, 8], [2, 1, 3, 5, 4, 6, 8, 7, 9, 10]):
        values = np.array(order)
        first, second = np.triu_indices(len(values), 1)
        score = int(np.sign(values[second] - values[first]).sum())
        known = kendalltau(np.arange(len(values)), values, method="exact")
        assert kendall_probability(len(values), score) == pytest.approx(known.pvalue, rel=1e-9)


def test_the_slope_is_theil_and_sens():
    from scipy.stats import theilslopes

    values = 10.0 + 2.0 * np.arange(25) + np.random.default_rng(5).standard_t(3, 25)
    (found,) = last(values, "imu_1_vibration_m_s2")
    assert found.slope == pytest.approx(theilslopes(values).slope, rel=1e-12)


def test_half_wrong_values_do_not_move_the_deviation_far():
    values = np.random.default_rng(4).normal(0.0, 1.0, 31)
    values[:10] = 1e6
    assert deviation_of(values) < 4.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("tails", "least", "most_share"), [("normal", 40_000, 1e-3), ("student of 5", 20_000, 6e-3)]
)
def test_false_alarms_of_sound_series(tails, least, most_share):
    """At most 1 in 1,000 features and flights; more where single flights differ for real."""
    rng = np.random.default_rng(11)
    judged = wrong = 0
    while judged < least:
        shape = (30, 8)
        # 8 features per flight, whose deviations are far above the least one.
        draws = rng.normal(size=shape) if tails == "normal" else rng.standard_t(5, size=shape)
        flights = [
            FlightRow(
                "",
                "uid:1",
                i * DAY_S,
                {f"imu_{n + 1}_gyro_bias_x_deg_s": v for n, v in enumerate(row)},
            )
            for i, row in enumerate(100.0 * draws)
        ]
        for i in range(MIN_EARLIER, len(flights)):
            judged += len(flights[i].features)
            wrong += len(departures(flights[:i], flights[i]))
    share = wrong / judged
    print(f"{tails}: {wrong} false alarms in {judged} features and flights")
    assert share <= most_share


def found_by(slope, flight, rng):
    """Whether a drift, in deviations per flight, is told by a flight."""
    values = 100.0 * (slope * np.arange(30) + rng.normal(size=30))
    flights = rows(values)
    known = [departures(flights[:i], flights[i]) for i in range(MIN_EARLIER, flight)]
    return any(one.value > one.usual for each in known for one in each)


@pytest.mark.thorough
def test_when_drifts_are_found():
    """One deviation in ten flights cannot be known by the 12th: the best test there finds 3 %."""
    rng = np.random.default_rng(21)
    by_30 = np.mean([found_by(0.1, 30, rng) for _ in range(100)])
    steep = np.mean([found_by(0.8, 12, rng) for _ in range(100)])
    print(f"one deviation in ten flights, by the 30th: {by_30}; eight in ten, by the 12th: {steep}")
    assert by_30 >= 0.75
    assert steep >= 0.8


def test_factors_fall_with_the_flights_known():
    assert len(STEP_FACTORS) == MAX_EARLIER - MIN_EARLIER + 1
    assert min(STEP_FACTORS) > 3.0


def test_names_of_features():
    assert len({feature.name for feature in FEATURES}) == len(FEATURES)
    assert named("motor_12_us").number == 12
    assert named("touchdown_m_s").number == 0
    assert named("of_a_later_program") is None


def test_ids_of_airframes():
    assert airframe_id("AB", 1, "CubeOrange") == "uid:AB"
    assert airframe_id("", 1, "CubeOrange") == "system:1 CubeOrange"
    assert airframe_id("", 0, "") == ""


def test_documents_of_earlier_versions_have_no_row():
    assert row_of_document({"name": "x"}) is None
    assert row_of_document({"features": 3, "airframe": None}) is None
    row = row_of_document(
        {
            "name": "x",
            "airframe": {"id": "uid:1"},
            "start_utc": "2026-01-01T00:00:00Z",
            "features": {"motor_1_us": None, "motor_2_us": 3.0},
            "flown": {"flown_s": 60.0, "distance_m": 100.0, "landings": 1, "hard_landings": 0},
        }
    )
    assert row.features == {"motor_2_us": 3.0}
    assert row.flown_s == 60.0
    assert row.start_unix_s == 1_767_225_600.0
