"""A vehicle with three IMUs: the service is flown on one of them, or on whichever is well."""

import pytest
from lanes import few, few_rows
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps.configuration import Configuration
from h2nav.service.settings import AutopilotSettings


def on(imu_message):
    settings = AutopilotSettings(imu_message=imu_message, simulation_truth=True)
    return Configuration(autopilot=settings)


@pytest.mark.parametrize(
    ("imu_message", "imu"), few_rows(1, [("SCALED_IMU", 1), ("SCALED_IMU2", 2), ("SCALED_IMU3", 3)])
)
def test_an_imu_that_is_well_is_flown_on_while_the_others_fail(imu_message, imu):
    others = {1, 2, 3} - {imu}
    faults = tuple(f"{fault}@15/{n}" for n in others for fault in ("gyro-zero", "accel-fixed"))
    flight = SimulatedFlight("flight", faults=faults, configuration=on(imu_message), imus=3)
    errors = flight.run(25.0).errors()
    assert flight.health.imu_message == imu_message
    assert flight.health.state == "active"
    assert errors.compared > 2000
    assert errors.total < 1.0


def test_a_gyro_that_reads_zero_shows_in_the_attitude():
    """So the faults reach the samples that the service uses."""
    flight = SimulatedFlight("flight", faults=("gyro-zero@15",), configuration=SIMULATED)
    assert flight.run(25.0).errors().total > 1.0


@pytest.mark.parametrize("fault", few(1, ["accel-fixed", "imu-frozen"]))
def test_the_service_goes_on_with_another_imu_and_says_so_once(fault):
    flight = SimulatedFlight("flight", faults=(f"{fault}@15",), imus=3).run(25.0)
    switches = [text for _, _, text in flight.seen.notices if "instead of" in text]
    assert len(switches) == 1
    assert switches[0].startswith("IMU 2 instead of 1: ")
    assert flight.health.imu_message == "SCALED_IMU2"
    assert flight.health.state == "active"
    assert flight.errors().total < 1.0
