"""The figures of a flight, and what differs from the airframe's earlier flights."""

import numpy as np
import pytest
from reviewed_flights import DURATION_S, RATE_HZ, flight

from h2nav.recordings.context import (
    Battery,
    Esc,
    Motors,
    Series,
    TemperatureTrack,
    VibrationTrack,
)
from h2nav.reviews.analysis import analyse
from h2nav.reviews.document import document
from h2nav.reviews.pictures.past import past as past_section
from h2nav.reviews.subjects.past import TREND

UNIX_S, DAY_S = 1_767_225_600.0, 86_400.0
SLOW_S = np.arange(0.0, DURATION_S, 0.1)
T_S = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ


def motors(extra_us=(0.0, 0.0, 0.0, 0.0)) -> Motors:
    noise = np.random.default_rng(1).normal(0.0, 8.0, (len(T_S), 4))
    pwm_us = 1500.0 + noise + np.array(extra_us)
    pwm_us[T_S < 3.0] = 1000.0
    return Motors((1, 2, 3, 4), T_S, pwm_us, 1000.0, 1950.0)


def flown(day: int = 0, **changes):
    own = {
        "uid": "A",
        "board": "CubeOrange",
        "start_unix_s": UNIX_S + day * DAY_S,
        "vehicle_type": 2,
        "motors": motors(),
    }
    return flight(**{**own, **changes})


def features(**changes):
    return analyse(flown(**changes)).row.features


def test_a_motor_that_works_harder_has_it_in_its_figure():
    found = features(motors=motors((0.0, 30.0, 0.0, 0.0)))
    assert found["motor_2_us"] == pytest.approx(30.0, abs=3.0)
    assert found["motor_1_us"] == pytest.approx(-10.0, abs=3.0)
    assert found["motor_spread_us"] == pytest.approx(40.0, abs=4.0)


def test_gyro_bias_and_temperature():
    warm = TemperatureTrack(0, SLOW_S, np.full(len(SLOW_S), 41.0))
    found = features(temperatures=(warm,))
    assert found["imu_1_temperature_degc"] == 41.0
    # As `reviewed_flights` puts them into its IMU.
    for axis, bias_deg_s in zip("xyz", (0.1, -0.1, 0.05), strict=True):
        assert found[f"imu_1_gyro_bias_{axis}_deg_s"] == pytest.approx(bias_deg_s, abs=0.03)


def test_noise_and_delay_of_the_receiver():
    found = features()
    assert found["gps_1_velocity_noise_m_s"] == pytest.approx(0.15, rel=0.15)
    assert found["gps_1_delay_s"] == pytest.approx(0.0, abs=0.03)


def test_sag_of_the_battery():
    rng = np.random.default_rng(2)
    current = 18.0 + 5.0 * np.sin(SLOW_S) + rng.normal(0.0, 1.0, len(SLOW_S))
    # Its charge falls by two volts meanwhile.
    volts = 16.0 - 2.0 * SLOW_S / DURATION_S - 0.03 * current + rng.normal(0.0, 0.01, len(SLOW_S))
    battery = Battery(0, SLOW_S, volts, current, np.full(len(SLOW_S), np.nan))
    assert features(batteries=(battery,))["battery_resistance_ohm"] == pytest.approx(0.03, abs=2e-3)
    steady = battery._replace(current_a=np.full(len(SLOW_S), 18.0))
    assert "battery_resistance_ohm" not in features(batteries=(steady,))


def test_vibration_is_the_autopilots():
    level = np.tile((3.0, 4.0, 12.0), (len(SLOW_S), 1))
    track = VibrationTrack(0, SLOW_S, level, np.zeros(len(SLOW_S)))
    assert features(vibrations=(track,))["imu_1_vibration_m_s2"] == pytest.approx(13.0)


def test_rotation_is_the_controllers():
    nan = np.full(len(SLOW_S), np.nan)
    escs = tuple(Esc(n, SLOW_S, np.full(len(SLOW_S), 6000.0 + n), nan, nan) for n in (1, 2, 3))
    assert features(escs=escs)["rotation_hz"] == pytest.approx(100.0, abs=0.1)


def test_what_was_flown():
    found = document(made := flown(), analyse(made))
    assert found["airframe"]["id"] == "uid:A"
    assert 30.0 < found["flown"]["flown_s"] < T_S[-1]
    assert found["flown"]["distance_m"] > 50.0
    assert found["flown"]["hard_landings"] == 0
    assert set(found["features"]) == set(analyse(made).row.features)


def past(count: int = 12):
    """Rows of earlier flights, whose motors differ a little from flight to flight."""
    rng = np.random.default_rng(7)
    row = analyse(flown()).row
    return tuple(
        row._replace(
            start_unix_s=UNIX_S - (count - i) * DAY_S,
            features={
                name: value + (rng.normal(0.0, 3.0) if name.endswith("_us") else 0.0)
                for name, value in row.features.items()
            },
        )
        for i in range(count)
    )


def test_a_motor_differs_from_its_past():
    made = flown(motors=motors((0.0, 60.0, 0.0, 0.0)))._replace(earlier=past())
    analysis = analyse(made)
    found = document(made, analysis)
    told = [one for one in found["findings"] if one["kind"] == TREND]
    assert any(one["text"].startswith("motor 2 works 60 us harder") for one in told)
    (motor,) = [one for one in found["trends"] if one["name"] == "motor_2_us"]
    assert motor["kind"] == "step"
    assert motor["text"].endswith("us harder than in the last 12 flights")
    assert {one["severity"] for one in told} == {"notice"}


def test_an_equal_flight_differs_in_nothing():
    made = flown(1)._replace(earlier=past())
    assert not analyse(made).trends


def test_another_airframe_has_no_past_here():
    made = flown(motors=motors((0.0, 60.0, 0.0, 0.0)), uid="B")._replace(earlier=past())
    assert not analyse(made).trends


def test_without_times_nothing_is_measured():
    made = flown()._replace(kind="bytes")
    row = analyse(made).row
    assert row.flown_s == 0.0
    assert not any(name.startswith(("motor", "imu", "hover")) for name in row.features)


def test_hover_throttle_needs_a_hover():
    assert "hover_throttle" not in features(throttle=None)
    still = Series(T_S, np.zeros(len(T_S)))
    found = features(climb_m_s=Series(T_S, np.full(len(T_S), 3.0)), throttle=still)
    assert "hover_throttle" not in found


def test_the_page_shows_the_figure_over_the_flights_what_differs_first():
    made = flown(motors=motors((0.0, 60.0, 0.0, 0.0)))._replace(earlier=past())
    section = past_section(made, analyse(made))
    shown = {one.title: one for one in section.pictures}
    motor = shown["Motor 2"]
    assert (motor.x[0], motor.x[-1], motor.unit) == (-12.0, 0.0, "us")
    assert motor.traces[0].values[-1] == pytest.approx(60.0 * 0.75, abs=20.0)
    assert abs(motor.traces[0].values[:-1]).max() < 15.0
    assert {one.title for one in section.further} >= {"Hover throttle"} - set(shown)
    assert not past_section(flown(), analyse(flown())).pictures
