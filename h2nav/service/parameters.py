"""This component's own parameters, for ground stations that request them.

They mirror the output settings and are read-only unless the configuration allows changes; the reply
to a refused PARAM_SET is the unchanged value, as the protocol requires.
"""

from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.outputs import Outputs
from h2nav.wire import outbound
from h2nav.wire.outbound import OutMessage
from h2nav.wire.questions import ParameterRead, ParameterWrite

_RATES = {
    "H2_ATT_HZ": mavlink.MAVLINK_MSG_ID_ATTITUDE,
    "H2_ATTQ_HZ": mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    "H2_ATTC_HZ": mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV,
    "H2_STAT_HZ": mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    "H2_DIF_HZ": mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    "H2_ODO_HZ": mavlink.MAVLINK_MSG_ID_ODOMETRY,
}


class Parameters:
    """Replies to PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET.

    Args:
        outputs: with the rates that the parameters show.
        may_change: obey PARAM_SET.
    """

    def __init__(self, outputs: Outputs, may_change: bool) -> None:
        self._outputs = outputs
        self._names = [name for name, message_id in _RATES.items() if outputs.offers(message_id)]
        self._may_change = may_change

    def every_value(self) -> Iterator[OutMessage]:
        """All PARAM_VALUE messages."""
        return (self._value(index) for index in range(len(self._names)))

    def read(self, asked: ParameterRead) -> OutMessage | None:
        """Returns the requested PARAM_VALUE, by index or name; None if unknown."""
        if asked.place is not None:
            return self._value(asked.place) if asked.place < len(self._names) else None
        return self._value(self._names.index(asked.name)) if asked.name in self._names else None

    def write(self, asked: ParameterWrite) -> OutMessage | None:
        """Applies or refuses PARAM_SET; returns the resulting PARAM_VALUE, None if unknown."""
        if asked.name not in self._names:
            return None
        if self._may_change and asked.value is not None:
            self._outputs.set_rate(_RATES[asked.name], asked.value)
        return self._value(self._names.index(asked.name))

    def _value(self, index: int) -> OutMessage:
        name = self._names[index]
        rate_hz = self._outputs.rate_hz(_RATES[name])
        return outbound.param_value(name, rate_hz, index, len(self._names))
