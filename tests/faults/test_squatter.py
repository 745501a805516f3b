"""Another UDP port speaks while the vehicle is silent: it gets nothing and takes no place."""

import socket
from collections.abc import Iterator

import pytest
from fault_flights import FaultFlight, fault_flight

pytestmark = pytest.mark.thorough

SILENCE_S = 2.0  # after 1.5 s another peer may take the place


@pytest.fixture
def squatter() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setblocking(False)
        yield other


def received(other: socket.socket) -> int:
    count = 0
    try:
        while other.recv(2048):
            count += 1
    except BlockingIOError:
        return count


def squat(flight: FaultFlight, other: socket.socket, data: bytes) -> None:
    """Sends from the other port, while the vehicle is silent and after its return."""
    flight.vehicle.pause(SILENCE_S)
    for _ in range(3):
        other.sendto(data, ("127.0.0.1", flight.port))
        flight.vehicle.pause(0.3)
    answered = len(flight.vehicle.messages("ATTITUDE"))

    def keeps_on() -> bool:
        other.sendto(data, ("127.0.0.1", flight.port))
        return len(flight.vehicle.messages("ATTITUDE")) >= answered + 100

    flight.until(keeps_on)


@pytest.mark.parametrize("data", [b"x", b"\xfd" * 60], ids=["byte", "markers"])
def test_garbage_from_another_port_takes_no_place(tmp_path, squatter, data):
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        squat(flight, squatter, data)
        assert received(squatter) == 0


def test_frames_of_another_system_take_no_place(tmp_path, squatter):
    """Good frames, but not of the bound autopilot."""
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        foreign = flight.vehicle.packed(flight.vehicle.makers["HEARTBEAT"](0), (9, 1))
        squat(flight, squatter, foreign)
        assert received(squatter) == 0


def test_the_vehicle_itself_may_come_back_from_another_port(tmp_path, squatter):
    """Frames of the bound autopilot after a silence: replies follow it."""
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        own = [flight.vehicle.makers[name] for name in ("HEARTBEAT", "RAW_IMU")]
        flight.vehicle.pause(SILENCE_S)
        flight.vehicle.rates_hz.clear()

        def sends_from_there() -> bool:
            for make in own:
                frame = flight.vehicle.packed(make(flight.vehicle.clock_us()))
                squatter.sendto(frame, ("127.0.0.1", flight.port))
            return received(squatter) > 0

        flight.until(sends_from_there)
