"""A new epoch of the autopilot's clock: the relation to the host's clock begins anew with it."""

from mcap.reader import make_reader
from simulated_flight import SimulatedFlight

from h2nav.log.recorder import Recorder

REBOOT_S = 12.0
NEAR_NS = 1_000_000_000


def test_after_a_reboot_no_sample_is_placed_by_the_old_clock(tmp_path):
    """Its time on the host's scale is right or is its arrival, never off by the old uptime."""
    path = tmp_path / "flight.mcap"
    with Recorder.to_file(path) as recorder:
        flight = SimulatedFlight("rest", faults=(f"reboot@{REBOOT_S}",), recorder=recorder)
        flight.run(REBOOT_S + 6.0)
    assert flight.first("rebooted") is not None
    with path.open("rb") as file:
        placed = [
            (message.log_time, message.publish_time)
            for _, _, message in make_reader(file).iter_messages(["/imu"])
        ]
    assert len(placed) > 1000
    assert all(abs(log_ns - publish_ns) < NEAR_NS for log_ns, publish_ns in placed)
