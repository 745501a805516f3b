"""Our own parameters, so that a ground station that asks component 191 gets an answer.

They mirror the output settings. They are read-only unless the configuration allows changes; a
refused PARAM_SET is answered with the value that stands, as the protocol wants it.
"""

import math
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.outputs import Outputs

_RATES = {
    "H2_ATT_HZ": mavlink.MAVLINK_MSG_ID_ATTITUDE,
    "H2_ATTQ_HZ": mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    "H2_ODO_HZ": mavlink.MAVLINK_MSG_ID_ODOMETRY,
}


class Parameters:
    """Answers PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET.

    Args:
        outputs: whose rates the parameters show.
        may_change: obey PARAM_SET.
    """

    def __init__(self, outputs: Outputs, may_change: bool) -> None:
        self._outputs = outputs
        self._names = [name for name, message_id in _RATES.items() if outputs.offers(message_id)]
        self._may_change = may_change

    def every_value(self) -> Iterator[Any]:
        """All PARAM_VALUE messages."""
        return (self._value(index) for index in range(len(self._names)))

    def read(self, message: Any) -> Any | None:
        """The PARAM_VALUE asked for by PARAM_REQUEST_READ, by index or name; None if unknown."""
        if message.param_index >= 0:
            known = message.param_index < len(self._names)
            return self._value(message.param_index) if known else None
        return (
            self._value(self._names.index(message.param_id))
            if message.param_id in self._names
            else None
        )

    def write(self, message: Any) -> Any | None:
        """Obeys or refuses PARAM_SET; the PARAM_VALUE that stands afterwards, None if unknown."""
        if message.param_id not in self._names:
            return None
        rate_hz = message.param_value
        if self._may_change and math.isfinite(rate_hz):
            self._outputs.set_rate(_RATES[message.param_id], rate_hz)
        return self._value(self._names.index(message.param_id))

    def _value(self, index: int) -> Any:
        name = self._names[index]
        return mavlink.MAVLink_param_value_message(
            name.encode(),
            self._outputs.rate_hz(_RATES[name]),
            mavlink.MAV_PARAM_TYPE_REAL32,
            len(self._names),
            index,
        )
