"""Requests of other components: commands and parameters."""

import math
from typing import Any, NamedTuple


class Command(NamedTuple):
    """The parts of COMMAND_LONG and COMMAND_INT that the service uses."""

    command: int  # MAV_CMD
    param1: float  # first parameter; may be NaN or infinite
    param2: float  # second parameter; likewise
    target: tuple[int, int]  # addressed system and component id; 0 = all


class ParameterList(NamedTuple):
    """PARAM_REQUEST_LIST."""

    target: tuple[int, int]


class ParameterRead(NamedTuple):
    """PARAM_REQUEST_READ."""

    name: str  # of the parameter; used if `place` is None
    place: int | None  # of the parameter, from 0; None = requested by name
    target: tuple[int, int]  # addressed system and component id; 0 = all


class ParameterWrite(NamedTuple):
    """PARAM_SET."""

    name: str  # of the parameter
    value: float | None  # None for NaN and infinity
    target: tuple[int, int]  # addressed system and component id; 0 = all


Question = Command | ParameterList | ParameterRead | ParameterWrite


def command(m: Any) -> Command:
    """COMMAND_LONG, COMMAND_INT: the fields used have the same names in both."""
    return Command(m.command, m.param1, m.param2, _target(m))


def param_request_list(m: Any) -> ParameterList:
    """PARAM_REQUEST_LIST."""
    return ParameterList(_target(m))


def param_request_read(m: Any) -> ParameterRead:
    """PARAM_REQUEST_READ; a negative index selects by name."""
    return ParameterRead(m.param_id, m.param_index if m.param_index >= 0 else None, _target(m))


def param_set(m: Any) -> ParameterWrite:
    """PARAM_SET."""
    value = m.param_value if math.isfinite(m.param_value) else None
    return ParameterWrite(m.param_id, value, _target(m))


def _target(m: Any) -> tuple[int, int]:
    return m.target_system, m.target_component
