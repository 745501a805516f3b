"""The autopilot that the service is bound to: found by its heartbeat, kept, watched."""

from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.settings import AutopilotSettings

LOST_NS = 5_000_000_000


class Identity(NamedTuple):
    """A MAVLink address with what its heartbeat says it is."""

    system_id: int
    component_id: int
    autopilot: int
    vehicle_type: int

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"

    @property
    def description(self) -> str:
        """Such as ``ArduPilot quadrotor 1/1``."""
        names = mavlink.enums["MAV_AUTOPILOT"], mavlink.enums["MAV_TYPE"]
        autopilot = names[0][self.autopilot].name if self.autopilot in names[0] else "?"
        vehicle = names[1][self.vehicle_type].name if self.vehicle_type in names[1] else "?"
        autopilot = autopilot.removeprefix("MAV_AUTOPILOT_").replace("ARDUPILOTMEGA", "ArduPilot")
        return f"{autopilot} {vehicle.removeprefix('MAV_TYPE_').lower()} {self}"


class Autopilot:
    """Latches the first autopilot that is heard (or the configured one) and follows its state.

    Args:
        settings: which ids to accept; 0 accepts any.
    """

    def __init__(self, settings: AutopilotSettings) -> None:
        self._settings = settings
        self.identity: Identity | None = None
        self.is_armed = False
        self.is_landed: bool | None = None
        self.rivals: set[tuple[int, int]] = set()
        self._heard_ns = 0

    def hears_heartbeat(self, t_ns: int, system_id: int, component_id: int, message: Any) -> bool:
        """Takes a HEARTBEAT of anybody.

        Returns:
            True when it made the binding, or changed what is known of the vehicle's type.
        """
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if not self._may_bind(system_id, component_id):
            if self.identity is not None:
                self.rivals.add((system_id, component_id))
            return False
        self._heard_ns = t_ns
        self.is_armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        identity = Identity(system_id, component_id, message.autopilot, message.type)
        changed = identity != self.identity
        self.identity = identity
        return changed

    def hears_landed_state(self, landed_state: int) -> None:
        """Takes EXTENDED_SYS_STATE.landed_state."""
        if landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
            self.is_landed = None
        else:
            self.is_landed = landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND

    def owns(self, system_id: int, component_id: int) -> bool:
        """Whether a message of this sender is the bound autopilot's own."""
        mine = self.identity
        return (
            mine is not None and mine.system_id == system_id and mine.component_id == component_id
        )

    def is_lost(self, t_ns: int) -> bool:
        """No heartbeat for `LOST_NS`."""
        return self.identity is not None and t_ns - self._heard_ns > LOST_NS

    @property
    def on_ground(self) -> bool:
        """Disarmed, or landed as far as the autopilot says so."""
        return not self.is_armed or self.is_landed is True

    def _may_bind(self, system_id: int, component_id: int) -> bool:
        if self.identity is not None:
            return self.owns(system_id, component_id)
        wanted = self._settings
        return wanted.system_id in (0, system_id) and wanted.component_id in (0, component_id)
