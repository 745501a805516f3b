"""Which messages have to be read: decided once per message id, and remembered while it holds.

An IMU message is read if a lane needs it, an attitude of the autopilot if a comparison is due, a
place once a second after the earth's field is known, everything else that has a reader always. Of
other senders, samples and attitudes are of no use.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service import comparing
from h2nav.service.aiding import Aiding
from h2nav.service.autopilot import Autopilot, Identity, Sender
from h2nav.service.comparing import Comparing
from h2nav.service.estimation import Estimation
from h2nav.service.wanted import Wanted
from h2nav.wire.imu import IMU_MESSAGES
from h2nav.wire.readers import READERS

GLOBAL_POSITION_INT = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
# The earth field changes over kilometres, but some autopilots send their place 50 times a second.
PLACE_PAUSE_NS = SECOND_NS


class Routing:
    """Takes every message of a link as it arrives.

    Args:
        autopilot: is told of its IMU messages.
        wanted: counts what arrives of it.
        estimation: needs IMU messages.
        comparing: needs attitudes of the autopilot.
        aiding: needs places.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        wanted: Wanted,
        estimation: Estimation,
        comparing_: Comparing,
        aiding: Aiding,
    ) -> None:
        self._autopilot, self._wanted = autopilot, wanted
        self._estimation, self._comparing, self._aiding = estimation, comparing_, aiding
        self._bound: Sender | None = None
        self._counts = wanted.counts
        self._idle_until_ns: dict[int, int] = {}  # of the bound autopilot's messages
        self._routes = estimation.routes

    def on_binding(self, identity: Identity) -> None:
        """Begins for an autopilot."""
        self._bound, self._counts = identity.address, self._wanted.counts
        self._idle_until_ns.clear()

    def on_arrival(self, t_ns: int, sender: Sender, message_id: int) -> bool:
        """Counts a message that has arrived; returns whether it has to be read.

        Args:
            t_ns: host time.
            sender: system and component id.
            message_id: one of `Service.message_ids`.
        """
        if sender == self._bound:
            self._counts[message_id] += 1
            idle_until_ns = self._idle_until_ns.get(message_id)
            if idle_until_ns is not None and t_ns < idle_until_ns:
                return False
            route = self._routes.get(message_id)
            if route is not None and t_ns < route[0] and route[1]:
                return True
            return self._on_own(t_ns, message_id)
        if message_id in IMU_MESSAGES:
            is_other = self._autopilot.identity is not None
            self._estimation.reject("other_sender" if is_other else "before_binding")
            return False
        return message_id not in comparing.MESSAGES and message_id in READERS

    def _on_own(self, t_ns: int, message_id: int) -> bool:
        """The same for the bound autopilot; remembers how long the answer holds."""
        if message_id in IMU_MESSAGES:
            if not self._autopilot.has_imu:
                self._autopilot.brings_imu()
            if self._estimation.on_arrival(t_ns, message_id):
                return True
            idle_until_ns = self._estimation.idle_until_ns(message_id)
        elif message_id in comparing.MESSAGES:
            if self._comparing.on_arrival(t_ns, message_id):
                return True
            idle_until_ns = self._comparing.idle_until_ns(message_id)
        else:
            if message_id == GLOBAL_POSITION_INT and self._aiding.knows_field:
                self._idle_until_ns[message_id] = t_ns + PLACE_PAUSE_NS
            return message_id in READERS
        self._idle_until_ns[message_id] = idle_until_ns
        return False
