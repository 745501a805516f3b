"""Which autopilot a recording is of: its board, and the id of its processor.

ArduPilot names both in a text at boot (``CubeOrange 002E0023 3433510D 38373934``), in its log and
in telemetry; AUTOPILOT_VERSION has the same twelve bytes, words little endian. PX4's log has them
as ``sys_uuid``, eighteen bytes, and AUTOPILOT_VERSION too.

Sources: ArduPilot, AP_HAL_ChibiOS/Util.cpp, get_system_id; PX4, board_get_px4_guid_formated.
"""

import re
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.frame_tables import FrameTable

_ARDUPILOT = re.compile(r"(\S.{0,23}?) ([0-9A-F]{8}) ([0-9A-F]{8}) ([0-9A-F]{8})")
_WORD_BYTES, _ARDUPILOT_BYTES = 4, 12


def ardupilot_board(texts: Iterable[str]) -> tuple[str, str]:
    """Board and id by the autopilot's texts; empty if they do not tell."""
    for text in texts:
        found = _ARDUPILOT.fullmatch(text.strip())
        if found is not None:
            board, *words = found.groups()
            return board, "-".join(words)
    return "", ""


def autopilot_uid(table: FrameTable | None, autopilot: int) -> str:
    """The id in AUTOPILOT_VERSION, as in the autopilot's own log; empty if it has none.

    Args:
        table: the messages of the autopilot.
        autopilot: its make, MAV_AUTOPILOT.
    """
    if table is None:
        return ""
    row = table.fields[-1]
    long = bytes(row["uid2"].tobytes())
    if not any(long):
        return f"{int(row['uid']):016x}" if int(row["uid"]) else ""
    if autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return long.hex()
    words = range(0, _ARDUPILOT_BYTES, _WORD_BYTES)
    return "-".join(long[place : place + _WORD_BYTES][::-1].hex().upper() for place in words)
