"""A daemon that starts in mid-flight on a machine that stalls: no sound sensor is accused."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SimulatedFlight

from h2nav.integrity.findings import Kind
from h2nav.sim.scenarios import scenario

ACCUSES = {
    Kind.GPS_VELOCITY,
    Kind.GYRO_BIAS_STEP,
    Kind.ACCELEROMETER_BIAS_STEP,
    Kind.COMPASSES_DIFFER,
}
# Begin after the first sample, length, and time of which the socket holds the messages, s.
STALLS = ((3.6, 1.8, 1.2), (6.4, 1.6, 1.2), (12.9, 2.4, 1.2), (15.8, 1.0, 1.0), (17.3, 2.4, 1.2))


def joined(flown: str, kind: int, join_s: float, seed: int, imus: int = 1) -> SimulatedFlight:
    """A flight that is heard from `join_s` on, with stalls."""
    chosen = scenario(flown)._replace(mav_type=kind)
    flight = SimulatedFlight(chosen, seed=seed, imus=imus).miss(join_s)
    for begin_s, length_s, kept_s in STALLS:
        flight.run(join_s + begin_s).hold_up(length_s, kept_s)
    return flight.run(join_s + 45.0)


@pytest.mark.parametrize(
    ("join_s", "seed"), [(17.4, 11), pytest.param(19.5, 21, marks=pytest.mark.thorough)]
)
def test_what_was_aligned_and_learnt_badly_in_the_air_is_no_sensors_fault(
    join_s: float, seed: int
) -> None:
    flight = joined("flight", mavlink.MAV_TYPE_HELICOPTER, join_s, seed)
    findings = flight.pipeline.service.findings
    assert not [finding for finding in findings if finding.kind in ACCUSES]
    # It was aligned badly, and that was reported as our own error.
    assert flight.errors().tilt > 4.0
    assert any(
        finding.kind is Kind.AUTOPILOT_TILT and finding.text.startswith("our tilt off")
        for finding in findings
    )
