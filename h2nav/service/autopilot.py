"""Selects the autopilot: detected by heartbeats, confirmed by its IMU, kept, monitored.

The rules:

1. The first autopilot received (or the configured one) is *on trial* at once: streams are requested
   from it, and its samples are used.
2. Three heartbeats and an IMU message *confirm* it.
3. Another one with three heartbeats replaces one on trial that is silent or sends no IMU message
   for 3 s, and a confirmed one that is silent for 10 s. Otherwise it is a rival.
4. The reported identity (make and type) changes only after 3 s without the previous one.

Heartbeats of others cost the same few operations and no memory, whatever their number.
"""

from array import array
from enum import Enum
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.limits import Slow, Steady
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.vehicle import Heartbeat

GIVEN_UP_NS = 10 * SECOND_NS
TRIAL_NS = 3 * SECOND_NS
KIND_HOLD_NS = 3 * SECOND_NS
CONFIRMING_HEARTBEATS = 3
# A burst of heartbeats counts once: they come at 1 Hz.
HEARTBEAT_APART_NS = 400_000_000
# Shorter than the interval of two heartbeats.
STATE_HOLD_NS = 900_000_000
ADDRESSES = 1 << 16

# The vehicles that do not move like a multirotor.
CLASSES = {
    mavlink.MAV_TYPE_FIXED_WING: "fixed-wing",
    mavlink.MAV_TYPE_GROUND_ROVER: "rover",
    mavlink.MAV_TYPE_SURFACE_BOAT: "rover",
}

Sender = tuple[int, int]


class Identity(NamedTuple):
    """A MAVLink address with the identity in its heartbeat."""

    system_id: int
    component_id: int
    autopilot: int
    vehicle_type: int

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"

    @property
    def address(self) -> Sender:
        """System and component id."""
        return self.system_id, self.component_id

    @property
    def vehicle_class(self) -> str:
        """Its class; a vehicle that moves like a multirotor counts as one."""
        return CLASSES.get(self.vehicle_type, "multirotor")

    @property
    def is_fixed_wing(self) -> bool:
        """Whether the vehicle flies along its nose."""
        return self.vehicle_class == "fixed-wing"

    @property
    def is_rover(self) -> bool:
        """Whether it drives, on land or water."""
        return self.vehicle_class == "rover"

    @property
    def description(self) -> str:
        """Such as ``ArduPilot quadrotor 1/1``."""
        names = mavlink.enums["MAV_AUTOPILOT"], mavlink.enums["MAV_TYPE"]
        autopilot = names[0][self.autopilot].name if self.autopilot in names[0] else "?"
        vehicle = names[1][self.vehicle_type].name if self.vehicle_type in names[1] else "?"
        autopilot = autopilot.removeprefix("MAV_AUTOPILOT_").replace("ARDUPILOTMEGA", "ArduPilot")
        return f"{autopilot} {vehicle.removeprefix('MAV_TYPE_').lower()} {self}"


class Heard(Enum):
    """The result of a heartbeat."""

    NOTHING = 0
    BOUND = 1  # another autopilot, or another vehicle, is bound from now on
    RIVAL = 2  # another autopilot is on the link


class Candidates:
    """Counts the heartbeats of every possible address, in tables of fixed size."""

    def __init__(self) -> None:
        self._counts = bytearray(ADDRESSES)
        self._last_ns = array("q", bytes(8 * ADDRESSES))

    def take(self, t_ns: int, sender: Sender) -> int:
        """Counts a heartbeat; returns how many came without a long pause (at most 255)."""
        place = sender[0] << 8 | sender[1]
        count, pause_ns = self._counts[place], t_ns - self._last_ns[place]
        if count and pause_ns < HEARTBEAT_APART_NS:
            return count
        count = min(count + 1, 255) if pause_ns <= GIVEN_UP_NS else 1
        self._counts[place] = count
        self._last_ns[place] = t_ns
        return count


class Autopilot:
    """Binds to one autopilot by the rules above and follows its state.

    Args:
        settings: which ids to accept; 0 accepts any.
        own_component_id: ours, which no autopilot can have.
    """

    def __init__(self, settings: AutopilotSettings, own_component_id: int = 0) -> None:
        self._settings = settings
        self._own_component_id = own_component_id
        self._candidates = Candidates()
        self._kind = Steady((0, 0), KIND_HOLD_NS)
        self._armed = Slow(False, STATE_HOLD_NS)
        self._landed: Slow[bool | None] = Slow(None, STATE_HOLD_NS)
        self._heard_ns = 0
        self._trial_since_ns = 0
        self.has_imu = False  # the bound one has sent IMU messages
        self.identity: Identity | None = None
        self.is_confirmed = False

    @property
    def is_armed(self) -> bool:
        """Whether its heartbeat says armed."""
        return self._armed.value

    @property
    def on_ground(self) -> bool:
        """Whether it is disarmed, or reported as landed."""
        return not self._armed.value or self._landed.value is True

    def take_heartbeat(self, t_ns: int, sender: Sender, heartbeat: Heartbeat) -> Heard:
        """Takes a HEARTBEAT of any sender."""
        if not heartbeat.is_of_autopilot or 0 in sender:
            return Heard.NOTHING
        count = self._candidates.take(t_ns, sender)
        if self.owns(sender):
            return self._take_own(t_ns, heartbeat, count)
        if not self.accepts(sender):
            return Heard.RIVAL if count >= CONFIRMING_HEARTBEATS else Heard.NOTHING
        if self.identity is None:
            return self._bind(t_ns, sender, heartbeat)
        if count < CONFIRMING_HEARTBEATS:
            return Heard.NOTHING
        return self._bind(t_ns, sender, heartbeat) if self._gives_way(t_ns) else Heard.RIVAL

    def brings_imu(self) -> None:
        """Notes an IMU message of the bound autopilot."""
        self.has_imu = True

    def take_landed_state(self, t_ns: int, on_ground: bool | None) -> None:
        """Takes EXTENDED_SYS_STATE."""
        self._landed.take(t_ns, on_ground)

    def accepts(self, sender: Sender) -> bool:
        """Whether the settings allow this address; 0 is the broadcast id, never a sender."""
        if 0 in sender or sender[1] == self._own_component_id:
            return False
        wanted = self._settings
        return wanted.system_id in (0, sender[0]) and wanted.component_id in (0, sender[1])

    def owns(self, sender: Sender) -> bool:
        """Whether this sender is the bound autopilot."""
        mine = self.identity
        return mine is not None and mine.system_id == sender[0] and mine.component_id == sender[1]

    def may_be_replaced(self, t_ns: int) -> bool:
        """Whether no autopilot is bound, or the bound one has been silent for long."""
        return self.identity is None or t_ns - self._heard_ns > GIVEN_UP_NS

    def _take_own(self, t_ns: int, heartbeat: Heartbeat, count: int) -> Heard:
        assert self.identity is not None
        self._heard_ns = t_ns
        self._armed.take(t_ns, heartbeat.is_armed)
        self.is_confirmed |= self.has_imu and count >= CONFIRMING_HEARTBEATS
        if self._kind.take(t_ns, (heartbeat.autopilot, heartbeat.vehicle_type)):
            self.identity = Identity(*self.identity.address, *self._kind.value)
            return Heard.BOUND
        return Heard.NOTHING

    def _bind(self, t_ns: int, sender: Sender, heartbeat: Heartbeat) -> Heard:
        kind = (heartbeat.autopilot, heartbeat.vehicle_type)
        self.identity = Identity(*sender, *kind)
        self._kind = Steady(kind, KIND_HOLD_NS)
        self._armed = Slow(heartbeat.is_armed, STATE_HOLD_NS)
        self._landed = Slow(None, STATE_HOLD_NS)
        self._heard_ns = self._trial_since_ns = t_ns
        self.has_imu = self.is_confirmed = False
        return Heard.BOUND

    def _gives_way(self, t_ns: int) -> bool:
        if self.is_confirmed:
            return t_ns - self._heard_ns > GIVEN_UP_NS
        is_silent = t_ns - self._heard_ns > TRIAL_NS
        return is_silent or (not self.has_imu and t_ns - self._trial_since_ns > TRIAL_NS)
