"""Requests one parameter of the autopilot: a few times with growing pauses, then never again.

A reply to another requester also counts.
"""

from h2nav.service.limits import SECOND_NS
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage

PAUSES_NS = tuple(seconds * SECOND_NS for seconds in (2, 4, 8, 16, 32))


class ParameterRequest:
    """The requests for one parameter.

    Args:
        name: of the parameter; empty = nothing is requested.
    """

    def __init__(self, name: str = "") -> None:
        self._name = name
        self.restart()

    def restart(self) -> None:
        """Starts again after a reboot of the autopilot, which may have changed the value."""
        self._is_known = False
        self._asked = 0
        self._due_ns = 0

    def heard(self, name: str) -> None:
        """Notes that the autopilot has sent the value of a parameter."""
        self._is_known |= name == self._name

    def next(self, t_ns: int, target: Address) -> OutMessage | None:
        """Returns the request to send now; None if nothing is due.

        Args:
            target: system and component id of the autopilot.
        """
        if not self._name or self._is_known or self._asked == len(PAUSES_NS):
            return None
        if t_ns < self._due_ns:
            return None
        self._due_ns = t_ns + PAUSES_NS[self._asked]
        self._asked += 1
        return outbound.param_request_read(target, self._name)
