"""12: a disturbed field, or none. Yaw is marked as unreferenced; roll and pitch do not notice."""

import dataclasses
import math

import pytest
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps.configuration import FilterSettings
from h2nav.attitude.samples import Trust

FILTERS = ("default", "two_stage")
# Dear enough to be out of every gate, and the sensor still shows the earth's field below it.
STRONG_MAGNET_UT = 60.0


def flown(name, *faults, until_s):
    configuration = dataclasses.replace(SIMULATED, filter=FilterSettings(name=name))
    return SimulatedFlight("flight", faults=faults, configuration=configuration).run(until_s)


def referenced(records):
    """The share of estimates whose yaw hangs on the field."""
    return sum(bool(record.trust & Trust.YAW_REFERENCED) for record in records) / len(records)


@pytest.mark.parametrize("name", FILTERS)
def test_without_a_magnetometer_tilt_stays_and_yaw_is_called_unreferenced(name):
    flight = flown(name, "no-mag@0", until_s=20.0)
    assert flight.seen.states[-1][1] in ("active", "degraded")
    assert referenced(flight.estimates_between(10.0, 20.0)) == 0.0
    assert flight.errors().tilt < 1.0
    assert all(math.isfinite(record.yaw_deg) for _, record in flight.seen.estimates)


@pytest.mark.parametrize("name", FILTERS)
def test_a_magnet_in_flight_leaves_tilt_alone_and_takes_the_reference_away(name):
    flight = flown(name, f"hard-iron={STRONG_MAGNET_UT}@10+5", until_s=25.0)
    assert referenced(flight.estimates_between(5.0, 10.0)) > 0.5
    assert referenced(flight.estimates_between(11.0, 15.0)) < 0.5
    assert flight.errors().tilt < 1.0
