"""Two flights side by side."""

import pytest

from h2nav.airframes.comparison import COUNTERS, compared, group_of
from h2nav.airframes.features import FlightRow


def document(features, parameters, airframe="uid:1", **more):
    own = {
        "name": "x",
        "file": "x.bin",
        "verdict": "Nothing was found wrong.",
        "airframe": {"id": airframe},
        "features": features,
        "parameters": parameters,
    }
    return {**own, **more}


def test_parameters_that_differ_are_grouped():
    first = document({}, {"ATC_RAT_RLL_P": 0.135, "EK3_ENABLE": 1, "STAT_BOOTCNT": 3, "XYZ": 1})
    second = document({}, {"ATC_RAT_RLL_P": 0.2, "EK3_ENABLE": 1, "STAT_BOOTCNT": 4, "NEW": 2})
    found = compared(first, second)["parameters"]
    assert list(found) == ["attitude control", "others", COUNTERS]
    assert found["attitude control"] == [{"name": "ATC_RAT_RLL_P", "first": 0.135, "second": 0.2}]
    assert [pair["name"] for pair in found["others"]] == ["NEW", "XYZ"]
    assert found["others"][0]["first"] is None


def test_a_parameter_is_a_float32():
    first, second = document({}, {"A": 0.1}), document({}, {"A": 0.10000000149})
    assert compared(first, second)["parameters"] == {}


def test_without_parameters_nothing_differs():
    found = compared(document({}, {}), document({}, {"A": 1.0}))
    assert found["parameters"] == {}
    assert found["parameters_known"] == [False, True]


def test_figures_are_in_deviations_of_their_airframe():
    rows = [FlightRow("", "uid:1", float(i), {"motor_2_us": 20.0 * i}) for i in range(10)]
    one, other = document({"motor_2_us": 0.0}, {}), document({"motor_2_us": 50.0}, {})
    (alone,) = compared(one, other)["features"]
    assert alone["deviation"] == 5.0
    assert alone["apart"] == pytest.approx(50.0 / 2.0**0.5 / 5.0)
    (known,) = compared(one, other, rows)["features"]
    assert known["deviation"] > 10.0
    assert known["apart"] < 0.5 * alone["apart"]


def test_what_one_flight_lacks_is_no_difference():
    found = compared(document({"touchdown_m_s": 1.0}, {}), document({}, {}))["features"]
    assert found[0]["second"] is None
    assert found[0]["apart"] is None


def test_whether_it_is_one_airframe():
    one = document({}, {})
    assert compared(one, one)["same_airframe"] is True
    assert compared(one, document({}, {}, "uid:2"))["same_airframe"] is False
    assert compared(one, document({}, {}, None))["same_airframe"] is None


def test_longer_prefixes_count():
    assert group_of("SERIAL1_BAUD") == "serial ports"
    for name in ("BARO1_GND_PRESS", "GND_ABS_PRESS", "INS_GYR2OFFS_X", "INS_GYR1_CALTEMP"):
        assert group_of(name) == COUNTERS
    assert group_of("INS_ACC2OFFS_X") == "inertial sensors and their filters"
    assert group_of("SERVO1_MIN") == "outputs"
    assert group_of("SR1_POSITION") == "telemetry streams"
