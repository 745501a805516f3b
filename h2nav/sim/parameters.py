"""The autopilot's parameters: a few of the real names, served by the parameter protocol."""

import math
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink


class ParameterServer:
    """Answers PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET; all values are REAL32.

    Args:
        values: initial values by name (at most 16 characters).
    """

    def __init__(self, values: dict[str, float]) -> None:
        self._values = dict(values)
        self._names = tuple(values)

    @property
    def values(self) -> Mapping[str, float]:
        """The current values."""
        return self._values

    def every_value(self, _request: Any) -> list[Any]:
        """The replies to PARAM_REQUEST_LIST: all PARAM_VALUE messages."""
        return [self._message(index) for index in range(len(self._names))]

    def read(self, fields: Any) -> list[Any]:
        """The replies to PARAM_REQUEST_READ, by index or name; none without such a parameter."""
        if fields.param_index >= 0:
            known = fields.param_index < len(self._names)
            return [self._message(fields.param_index)] if known else []
        return self._by_name(fields.param_id)

    def write(self, fields: Any) -> list[Any]:
        """Applies PARAM_SET; the replies have the new value."""
        if fields.param_id in self._values and math.isfinite(fields.param_value):
            self._values[fields.param_id] = fields.param_value
        return self._by_name(fields.param_id)

    def _by_name(self, name: str) -> list[Any]:
        return [self._message(self._names.index(name))] if name in self._values else []

    def _message(self, index: int) -> Any:
        name = self._names[index]
        return mavlink.MAVLink_param_value_message(
            name.encode(),
            self._values[name],
            mavlink.MAV_PARAM_TYPE_REAL32,
            len(self._names),
            index,
        )
