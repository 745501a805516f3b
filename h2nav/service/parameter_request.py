"""Requests parameters of the autopilot: each a few times with growing pauses, then never again.

A reply to another requester also counts.
"""

from h2nav.maths.units import SECOND_NS
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage

PAUSES_NS = tuple(seconds * SECOND_NS for seconds in (2, 4, 8, 16, 32))


class ParameterRequests:
    """The requests for some parameters, one after the other.

    Args:
        names: of the parameters, the most important first.
    """

    def __init__(self, *names: str) -> None:
        self._names = names
        self.restart()

    def restart(self) -> None:
        """Starts again after a reboot of the autopilot, which may have changed the values."""
        self._missing = dict.fromkeys(self._names, 0)  # how often each was asked for
        self._due_ns = 0

    def heard(self, name: str) -> None:
        """Notes that the autopilot has sent the value of a parameter."""
        if self._missing.pop(name, None) is not None:
            self._due_ns = 0

    def next(self, t_ns: int, target: Address) -> OutMessage | None:
        """Returns the request to send now; None if nothing is due.

        Args:
            t_ns: host time.
            target: system and component id of the autopilot.
        """
        if not self._missing or t_ns < self._due_ns:
            return None
        name, asked = min(self._missing.items(), key=lambda item: item[1])
        if asked == len(PAUSES_NS):
            return None
        self._due_ns = t_ns + PAUSES_NS[asked]
        self._missing[name] = asked + 1
        return outbound.param_request_read(target, name)
