"""Figures that are compared: their least deviations and limits, and rows of documents."""

import math

import pytest

from h2nav.airframes.features import (
    FEATURES,
    FlightRow,
    airframe_id,
    is_unique,
    named,
    row_of_document,
    unix_s_of,
)

INF = math.inf


@pytest.mark.parametrize(
    ("name", "number", "least", "limit", "both_ways"),
    [
        ("imu_2_vibration_m_s2", 2, 0.5, 30.0, False),
        ("imu_2_displacement_um", 2, 0.2, INF, False),
        ("rotation_hz", 0, INF, INF, False),
        ("hover_throttle", 0, 0.015, 0.6875, True),
        ("motor_12_us", 12, 5.0, 40.0, False),
        ("motor_spread_us", 0, INF, INF, False),
        ("compass_1_residual_ut", 1, 0.5, INF, False),
        ("imu_1_gyro_bias_x_deg_s", 1, 0.1, 2.0, True),
        ("imu_3_gyro_bias_z_deg_s", 3, 0.1, 2.0, True),
        ("imu_1_force_at_rest_m_s2", 1, 0.05, 0.785, True),
        ("imu_1_temperature_degc", 1, INF, INF, False),
        ("gps_2_velocity_noise_m_s", 2, 0.03, INF, False),
        ("gps_1_delay_s", 1, 0.03, INF, True),
        ("battery_resistance_ohm", 0, 0.002, INF, False),
        ("link_loss_share", 0, 0.005, INF, False),
        ("touchdown_m_s", 0, 0.2, 3.0, False),
    ],
)
def test_what_a_figure_is_held_to(name, number, least, limit, both_ways):
    feature, of = named(name)
    assert (of, feature.least, feature.limit, feature.both_ways) == (
        number, least, limit, both_ways,
    )  # fmt: skip


def test_biases_alone_are_compared_at_one_temperature():
    beside = {feature.name: (feature.beside, feature.beside_within) for feature in FEATURES}
    warm = {name for name, (other, _) in beside.items() if other}
    assert warm == {"imu_{}_force_at_rest_m_s2", *(f"imu_{{}}_gyro_bias_{a}_deg_s" for a in "xyz")}
    assert {beside[name] for name in warm} == {("imu_{}_temperature_degc", 7.0)}


@pytest.mark.parametrize(
    "name", ["motor_us", "motor__us", "motor_-1_us", "motor_1_us_", "xtouchdown_m_s", ""]
)
def test_a_name_of_something_else_is_no_figure(name):
    assert named(name) is None


@pytest.mark.parametrize(
    ("date", "unix_s"),
    [
        ("1970-01-01T00:00:01Z", 1.0),
        ("1970-01-01T00:00:01", 1.0),  # without a zone it is UTC
        ("1970-01-01T01:00:00.500+01:00", 0.5),
        ("0001-01-01T00:00:00+02:00", None),
        ("9999-12-31T23:59:59-02:00", None),
        ("yesterday", None),
        ("", None),
        (None, None),
        (1_700_000_000, None),
    ],
)
def test_a_date_in_iso_8601(date, unix_s):
    found = unix_s_of(date)
    assert math.isnan(found) if unix_s is None else found == unix_s


@pytest.mark.parametrize(
    ("uid", "system_id", "board", "known", "unique"),
    [
        ("AB", 1, "Cube", "uid:AB", True),
        ("", 1, "Cube", "system:1 Cube", False),
        ("", 7, "", "system:7", False),
        ("", 0, "Cube", "system:0 Cube", False),
        ("", 0, "", "", False),
    ],
)
def test_an_id_of_an_airframe(uid, system_id, board, known, unique):
    found = airframe_id(uid, system_id, board)
    assert (found, is_unique(found)) == (known, unique)


def test_a_row_holds_the_numbers_of_a_document():
    features = {"a": 1, "b": 2.5, "c": True, "d": None, "e": "3", "f": math.nan, "g": math.inf}
    flown = {"flown_s": 60, "distance_m": 100.5, "landings": 1.0, "hard_landings": 2}
    document = {"name": "x", "airframe": {"id": "uid:1"}, "features": features, "flown": flown}
    document["start_utc"] = "1970-01-01T00:00:01Z"
    assert row_of_document(document) == FlightRow(
        "x", "uid:1", 1.0, {"a": 1.0, "b": 2.5}, 60.0, 100.5, 1, 2
    )


@pytest.mark.parametrize("flown", [None, 3, {}, {"flown_s": None, "landings": True}])
def test_a_document_that_does_not_say_what_was_flown_counts_nothing(flown):
    row = row_of_document({"airframe": {"id": None}, "features": {}, "flown": flown})
    assert (row.flight, row.airframe, row.features) == ("", "", {})
    assert row[4:] == (0.0, 0.0, 0, 0)
    assert math.isnan(row.start_unix_s)


@pytest.mark.parametrize("lacking", [{"airframe": None}, {"features": None}, {"features": [1]}])
def test_what_is_no_review_has_no_row(lacking):
    whole = {"airframe": {"id": "uid:1"}, "features": {}}
    assert row_of_document(whole) is not None
    assert row_of_document({**whole, **lacking}) is None
