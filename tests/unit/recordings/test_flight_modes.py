"""The names of flight modes are pymavlink's."""

import pytest
from pymavlink import mavutil

from h2nav.recordings.flight_modes import of_vehicle, px4_mode


@pytest.mark.parametrize("vehicle_type", range(60))
def test_of_every_type_of_vehicle(vehicle_type: int) -> None:
    assert of_vehicle(vehicle_type) == (mavutil.mode_mapping_bynumber(vehicle_type) or {})


@pytest.mark.parametrize("main", range(12))
def test_of_px4(main: int) -> None:
    for sub in range(12):
        custom = main << 16 | sub << 24
        assert px4_mode(0, custom) == mavutil.interpret_px4_mode(0, custom)
