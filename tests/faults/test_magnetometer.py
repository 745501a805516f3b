"""12: a disturbed field, or none. Yaw is marked as unreferenced; roll and pitch do not notice."""

import dataclasses

import pytest
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps.configuration import FilterSettings
from h2nav.attitude.samples import Trust
from h2nav.service.settings import AidingSettings

FILTERS = ("float", "fixed")  # arithmetics of the default one
# As strong as the earth's field: nobody may take it for that.
STRONG_MAGNET_UT = 60.0


def flown(name, fault):
    """Sixteen seconds of flight in which GPS velocity tells nothing of the heading either."""
    configuration = dataclasses.replace(
        SIMULATED,
        filter=FilterSettings(arithmetic=name),
        aiding=AidingSettings(gps_velocity=False),
    )
    return SimulatedFlight("flight", faults=(fault,), configuration=configuration).run(16.0)


def share(records, bit):
    """The share of estimates that rest on something."""
    return sum(bool(record.trust & bit) for record in records) / len(records)


@pytest.mark.parametrize("name", FILTERS)
def test_without_a_magnetometer_yaw_is_called_unreferenced_and_tilt_stays(name):
    flight = flown(name, "no-mag@0")
    assert share(flight.estimates_between(2.0, 16.0), Trust.YAW_REFERENCED) == 0.0
    assert flight.errors().tilt < 1.5
    assert flight.seen.states[-1][1] == "active"


@pytest.mark.parametrize("name", FILTERS)
def test_a_magnet_in_flight_is_not_used_and_turns_nothing(name):
    flight = flown(name, f"hard-iron={STRONG_MAGNET_UT}@10+5")
    assert share(flight.estimates_between(5.0, 9.5), Trust.FIELD_USED) > 0.9
    assert share(flight.estimates_between(11.5, 14.5), Trust.FIELD_USED) < 0.1
    errors = flight.errors()
    assert errors.tilt < 1.5
    assert errors.yaw < 3.0
