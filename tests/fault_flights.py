"""The daemon as a process and a vehicle in real time, for tests of what must not harm it.

Nothing here is a matter of how fast the machine is: a flight goes on until something is so, for
`WAIT_S` at the most.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from daemon_process import H2NAV, WAIT_S, DaemonProcess, daemon, free_udp_port
from udp_vehicle import UdpVehicle


class FaultFlight(NamedTuple):
    """A daemon and the vehicle that it listens to."""

    daemon: DaemonProcess
    vehicle: UdpVehicle
    port: int

    @property
    def status(self) -> dict[str, Any]:
        """The latest status event; empty before the first."""
        events = reversed(self.daemon.read_events())
        return next((event for event in events if "state" in event), {})

    @property
    def texts(self) -> list[str]:
        """The notices so far."""
        return [event["text"] for event in self.daemon.read_events() if event["event"] == "notice"]

    def until(self, so: Callable[[], bool]) -> None:
        """Flies until something is so."""
        assert self.vehicle.fly(WAIT_S, lambda: self._ended() or so()), self._seen()
        assert not self._ended(), self._seen()

    def until_listening(self) -> None:
        """Waits, without sending anything, until the daemon's socket is there."""
        self.daemon.wait_for(lambda event: "state" in event)

    def until_state(self, state: str) -> None:
        """Flies until the daemon's latest status is this one."""
        self.until(lambda: self.status.get("state") == state)

    def until_more_samples(self, count: int = 150) -> None:
        """Flies until so many more samples were used."""
        before = self.status.get("samples_used", 0)
        self.until(lambda: self.status.get("samples_used", 0) >= before + count)

    def _ended(self) -> bool:
        return self.daemon.process.poll() is not None

    def _seen(self) -> str:
        if self._ended():
            assert self.daemon.process.stderr is not None
            return f"the daemon ended: {self.daemon.process.stderr.read().decode()}"
        return f"not seen within {WAIT_S:.0f} s: {self.daemon.read_events()[-5:]}"


@contextmanager
def fault_flight(
    folder: Path,
    sections: str = "",
    environment: dict[str, str] | None = None,
    program: Sequence[str] = H2NAV,
    **vehicle: Any,
) -> Iterator[FaultFlight]:
    """A daemon with a log in `folder`, and a vehicle that has not sent anything yet.

    Args:
        folder: for configuration and log.
        sections: further lines of the configuration file.
        environment: variables of the daemon.
        program: what is started in place of ``h2nav``.
        vehicle: how the vehicle differs from the usual one.
    """
    port = free_udp_port()
    config = folder / "config.yaml"
    logs = folder / "logs"
    config.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\nlog: {{folder: '{logs}'}}\n{sections}\n"
    )
    flown = UdpVehicle(port, **vehicle)
    try:
        with daemon("-c", str(config), environment=environment, program=program) as running:
            yield FaultFlight(running, flown, port)
    finally:
        flown.close()
