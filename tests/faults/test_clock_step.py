"""5: somebody sets the host's clock. Only the log notices; attitudes and watchdog go on."""

import socket
from pathlib import Path

import pytest
from fault_flights import fault_flight
from needs import absent, need_program

STEP_S = 3600
LIBRARY = "faketime/libfaketimeMT.so.1"


def clock_library() -> Path:
    """The library that shows a process another UNIX time."""
    need_program("faketime")
    found = [path for folder in ("/usr/lib", "/lib") for path in Path(folder).glob(f"*/{LIBRARY}")]
    return found[0] if found else absent(f"{LIBRARY} is not installed")


@pytest.mark.parametrize("step_s", [STEP_S, -STEP_S])
def test_a_step_of_the_host_clock_is_noted_and_harms_nothing(tmp_path, step_s):
    shift = tmp_path / "shift"
    shift.write_text("+0")
    environment = {
        "LD_PRELOAD": str(clock_library()),
        "FAKETIME_TIMESTAMP_FILE": str(shift),
        "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "NOTIFY_SOCKET": str(tmp_path / "notify"),
        "WATCHDOG_USEC": "600000",
    }
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(environment["NOTIFY_SOCKET"])
        ear.setblocking(False)
        with fault_flight(tmp_path, environment=environment) as flight:
            flight.until_state("active")
            before = len(flight.texts)
            shift.write_text(f"{step_s:+d}")
            flight.until(lambda: any("clock stepped" in text for text in flight.texts))
            flight.until_more_samples()
            pings_after(ear, flight)
            told = flight.texts[before:]
            assert flight.daemon.stop() == 0
    assert [text for text in told if "clock stepped" not in text] == []
    assert len(told) == 1
    assert f"{step_s:+d}" in told[0]


def pings_after(ear, flight):
    """The watchdog is fed now, not only before."""
    while True:
        try:
            ear.recv(4096)
        except BlockingIOError:
            break

    def pinged() -> bool:
        try:
            return ear.recv(4096) == b"WATCHDOG=1"
        except BlockingIOError:
            return False

    flight.until(pinged)
