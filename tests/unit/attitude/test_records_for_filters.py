"""Each record other than a sample reaches the filter as what it is."""

from typing import Any
from unittest.mock import Mock

import pytest

from h2nav.attitude.filter import AttitudeFilter, pass_on
from h2nav.attitude.samples import EarthField, SensorDelays, VehicleState, VelocityFix


@pytest.mark.parametrize(
    ("what", "method"),
    [
        (VelocityFix(0, (1.0, 2.0, 3.0), 0.2), "use_velocity"),
        (EarthField(50.0, 1.1, 0.05), "use_field"),
        (SensorDelays(), "use_delays"),
        (VehicleState(on_ground=True), "use_vehicle"),
    ],
)
def test_a_record_is_passed_on_once_to_its_method(what: Any, method: str) -> None:
    chosen = Mock(spec_set=AttitudeFilter)
    pass_on(chosen, what)
    ((name, arguments, _),) = chosen.method_calls
    assert (name, arguments) == (method, (what,))
