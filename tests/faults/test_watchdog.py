"""24: the watchdog is fed while samples become attitudes, and no longer when they do not."""

import socket
import time

import pytest
from daemon_process import WAIT_S
from fault_flights import fault_flight

pytestmark = pytest.mark.thorough

PERIOD_S = 0.9


@pytest.fixture
def ear(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind(str(tmp_path / "notify"))
        end.setblocking(False)
        yield end


def pings(ear):
    count = 0
    try:
        while True:
            count += ear.recv(4096) == b"WATCHDOG=1"
    except BlockingIOError:
        return count


def test_the_watchdog_starves_when_no_sample_progresses(tmp_path, ear):
    """The autopilot is there, its IMU is not: systemd has to see that nothing moves."""
    environment = {
        "NOTIFY_SOCKET": str(tmp_path / "notify"),
        "WATCHDOG_USEC": str(round(PERIOD_S * 1e6)),
    }
    with fault_flight(tmp_path, environment=environment) as flight:
        flight.until_state("active")
        flight.until(lambda: pings(ear) > 0)
        del flight.vehicle.rates_hz["RAW_IMU"]
        end_s = time.monotonic() + WAIT_S
        while time.monotonic() < end_s:
            pings(ear)
            flight.vehicle.fly(3.0 * PERIOD_S)
            if pings(ear) == 0:
                return
        raise AssertionError(f"still fed {WAIT_S:.0f} s after the last sample")


def test_the_watchdog_is_fed_while_there_is_no_autopilot(tmp_path, ear):
    """A vehicle that is switched off is no reason to be started again and again."""
    environment = {
        "NOTIFY_SOCKET": str(tmp_path / "notify"),
        "WATCHDOG_USEC": str(round(PERIOD_S * 1e6)),
    }
    with fault_flight(tmp_path, environment=environment) as flight:
        flight.vehicle.rates_hz.clear()
        heard = 0

        def fed() -> bool:
            nonlocal heard
            heard += pings(ear)
            return heard >= 10

        flight.until(fed)
