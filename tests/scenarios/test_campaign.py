"""Forty drawn flights of a minute: what holds of every flight, and how often the rest."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest
from needs import REPOSITORY

from h2nav.apps.campaign_flights import fly
from h2nav.evaluation.campaign.distribution import Range, read_distribution
from h2nav.evaluation.campaign.summary import summary

SEEDS = 40


def short_draws():
    """One IMU at 50 Hz, a minute with at most one fault: about a second of work each."""
    shipped = read_distribution(REPOSITORY / "configs" / "campaign.yaml")
    shipped.sections["flight"] |= {
        "length_min": Range("value", (1.2,)),
        "rest_s": Range("uniform", (5.0, 15.0)),
    }
    shipped.sections["imu"] |= {"count": Range("value", (1,)), "rate_hz": Range("value", (50.0,))}
    short = shipped._replace(
        fault_count=Range("choice", (0, 0, 1)), fault_length_s=Range("value", (15.0,))
    )
    return [short.draw(seed) for seed in range(SEEDS)]


@pytest.fixture(scope="module")
def rows():
    return [fly(draw) for draw in short_draws()]
