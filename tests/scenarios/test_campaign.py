"""Forty drawn flights of a minute: what holds of every flight, and how often the rest."""

from statistics import median

import pytest
from needs import REPOSITORY

from h2nav.apps.campaign_flights import fly
from h2nav.evaluation.campaign.distribution import Range, read_distribution
from h2nav.evaluation.campaign.summary import summary

SEEDS = 40
# Of a gyro without new values the filter makes no estimates.
GYRO = ("gyro-frozen", "gyro-zero", "imu-frozen")

pytestmark = [pytest.mark.thorough, pytest.mark.timeout(1200)]


@pytest.fixture(scope="module")
def rows():
    """One IMU at 50 Hz, at most one fault for 15 s: a second of work each."""
    shipped = read_distribution(REPOSITORY / "configs" / "campaign.yaml")
    shipped.sections["flight"] |= {
        "length_min": Range("value", (1.0,)),
        "rest_s": Range("uniform", (5.0, 8.0)),
    }
    shipped.sections["imu"] |= {"count": Range("value", (1,)), "rate_hz": Range("value", (50.0,))}
    short = shipped._replace(
        fault_count=Range("choice", (0, 0, 1)), fault_length_s=Range("value", (15.0,))
    )
    return [fly(short.draw(seed)) for seed in range(SEEDS)]


@pytest.fixture(scope="module")
def found(rows):
    return summary(rows)


def test_the_service_survives_every_flight_and_has_an_attitude(rows):
    for row in rows:
        assert row["handler_errors"] == 0, row["draw"]
        has_gyro = not any(fault["fault"] in GYRO for fault in row["faults"])
        assert row["estimated_share"] > (0.97 if has_gyro else 0.7), row["draw"]


def test_no_attitude_is_wrong_for_long_while_a_sensor_shows_better(rows):
    for row in rows:
        assert row["heading_wrong_s"] < 5.0, row["draw"]
        assert row["tilt_wrong_s"] < 5.0, row["draw"]


def test_most_flights_are_flown_well(rows):
    """Without a compass, or before the first accelerations, a heading is not known."""
    assert median(row["heading_deg"]["p95"] for row in rows) < 4.0
    assert median(row["tilt_deg"]["p95"] for row in rows) < 2.0


def test_hardly_a_sound_part_is_accused(found):
    assert found["false_accusations"] <= 1, found["false_accusations_by_kind"]
    assert found["false_alarms"] <= 5, found["false_alarms_by_kind"]


def test_most_faults_are_told_and_by_their_name(found):
    faults = found["faults"]
    assert faults["count"] >= 10
    assert faults["told_share"] > 0.7
    assert faults["named_share"] > 0.5
    assert faults["wrong"] <= 2
