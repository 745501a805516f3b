"""5: somebody sets the host's clock. Only the log notices; attitudes and watchdog go on."""

import socket
import sys

import pytest
from fault_flights import FaultFlight, fault_flight

pytestmark = pytest.mark.thorough

STEP_S = 3600
# The UNIX clock of the process alone, moved by what stands in a file. (libfaketime cannot do it:
# where it leaves the monotonic clock alone, sleeping fails.)
STEPPED = """
import sys, time
from pathlib import Path
shift, *words = sys.argv[1:]
true_ns = time.time_ns
time.time_ns = lambda: true_ns() + 10**9 * int(Path(shift).read_text())
time.time = lambda: time.time_ns() * 1e-9
from h2nav import cli
sys.exit(cli.main(words))
"""


@pytest.mark.parametrize("step_s", [STEP_S, -STEP_S])
def test_a_step_of_the_host_clock_is_noted_and_harms_nothing(tmp_path, step_s):
    shift = tmp_path / "shift"
    shift.write_text("0")
    program = [sys.executable, "-c", STEPPED, str(shift)]
    environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "600000"}
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(environment["NOTIFY_SOCKET"])
        ear.setblocking(False)
        with fault_flight(tmp_path, environment=environment, program=program) as flight:
            flight.until_state("active")
            before = len(flight.texts)
            (tmp_path / "next").write_text(str(step_s))
            (tmp_path / "next").rename(shift)
            flight.until(lambda: any("clock stepped" in text for text in flight.texts))
            flight.until_more_samples()
            until_watchdog_is_fed(ear, flight)
            told = [text for text in flight.texts[before:] if "clock stepped" in text]
            flight.until_state("active")
            assert flight.daemon.stop() == 0
    assert len(told) == 1
    assert f"{step_s:+d}" in told[0]


def until_watchdog_is_fed(ear: socket.socket, flight: FaultFlight) -> None:
    """Flies until it is fed anew; what was fed before does not count."""
    heard(ear)
    flight.until(lambda: b"WATCHDOG=1" in heard(ear))


def heard(ear: socket.socket) -> list[bytes]:
    """The notifications that have come."""
    told = []
    try:
        while True:
            told.append(ear.recv(4096))
    except BlockingIOError:
        return told
