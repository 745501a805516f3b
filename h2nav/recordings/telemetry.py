"""The context of recorded telemetry: the content of MAVLink messages besides service events.

Sources: the MAVLink common and ardupilotmega message definitions.
"""

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput
from h2nav.maths.units import HOUR_S
from h2nav.recordings import telemetry_controls as controls
from h2nav.recordings.airframe_identity import ardupilot_board, autopilot_uid
from h2nav.recordings.attitude_tables import ATTITUDES, attitudes_of, truth_of
from h2nav.recordings.autopilot_log import vehicle_name, what_sensors_lack
from h2nav.recordings.columns import Format, messages_of
from h2nav.recordings.compass_rows import compass_rows
from h2nav.recordings.context import (
    Array,
    CompassRows,
    Context,
    ImuTrack,
    Said,
    Span,
)
from h2nav.recordings.context_fields import table_fields
from h2nav.recordings.field_tables import FIELDS
from h2nav.recordings.flight_modes import of_vehicle, px4_mode
from h2nav.recordings.frame_tables import FrameTable, TableMaker
from h2nav.recordings.imu_tables import IMUS, ImuColumns, imu_columns
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.lost_frames import LostFrames, missing_share
from h2nav.recordings.receiver_tables import RECEIVERS, receivers_of, start_unix_s
from h2nav.recordings.spans import silences, spans
from h2nav.recordings.telemetry_rows import TelemetryRows, message_ids
from h2nav.recordings.text_tables import TEXTS, said_of
from h2nav.service.imu_choice import preference
from h2nav.wire.frame_scan import FrameScan
from h2nav.wire.imu import (
    IMU_MESSAGES,
    MAX_IMUS,
)

HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
# A longer recording with fewer messages holds times that are damaged: a review needs memory for
# every second of it.
LONGEST_SPARSE_S = 12 * HOUR_S
MIN_HZ = 1.0

MESSAGE_IDS = frozenset(
    {
        HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        *message_ids(messages_of(Format.TELEMETRY, (*FIELDS, *ATTITUDES, *RECEIVERS, IMUS, TEXTS))),
        *controls.MESSAGE_IDS,
    }
)
"""The messages that `context_of` reads."""

Tables = Mapping[int, FrameTable]


def read_context(recording: Recording) -> Context:
    """Reads the context of a recording, in a separate pass.

    Raises:
        BadInput: its times are damaged.
    """
    maker, scan, lost = TableMaker(MESSAGE_IDS), FrameScan(), LostFrames()
    start_ns: int | None = None
    end_ns = 0
    for arrivals in recording.batches():
        found = scan.frames_of(arrivals)
        maker.add(found)
        lost.add(found)
        if len(arrivals.t_ns):
            start_ns = int(arrivals.t_ns[0]) if start_ns is None else start_ns
            end_ns = int(arrivals.t_ns[-1])
    offset_ns = 0 if recording.times_are_synthetic else recording.unix_offset_ns
    tables = maker.tables()
    start_ns = start_ns or 0
    messages = sum(len(table.t_ns) for table in tables.values())
    length_s = 1e-9 * (end_ns - start_ns)
    if length_s > max(LONGEST_SPARSE_S, messages / MIN_HZ):
        raise BadInput(
            f"{recording.path}: {messages} messages within {length_s / HOUR_S:.0f} h; "
            "expected a recording with times that are not damaged"
        )
    context = context_of(tables, start_ns, end_ns, offset_ns, dict(recording.notes))
    beats = _heartbeats(tables)
    if beats is None:
        return context
    return context._replace(link_loss_share=_loss(tables, lost, beats.senders[0]))


def _loss(tables: Tables, lost: LostFrames, sender: NDArray[np.int64]) -> float | None:
    """Frames of the autopilot that the link lost, of all."""
    share = lost.share(*sender.tolist())
    attitudes = tables.get(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    if share is None or attitudes is None:
        return share
    own = (attitudes.senders == sender).all(axis=1)
    missing = missing_share(attitudes.fields["time_boot_ms"][own].astype(np.int64))
    return share if missing is None else min(share, missing)


def context_of(
    tables: Tables, start_ns: int, end_ns: int, unix_offset_ns: int, notes: dict[str, int]
) -> Context:
    """Extracts the context from the frames of `MESSAGE_IDS`.

    Args:
        tables: message id -> its frames, of all senders.
        start_ns: arrival of the first bytes of the recording.
        end_ns: of the last.
        unix_offset_ns: UNIX time minus the times of arrival; 0 if unknown.
        notes: what was damaged or skipped in the file.
    """
    beats = _heartbeats(tables)
    own = _of_sender(tables, beats)
    clock = _Clock(own, start_ns)
    kind = (0, 0) if beats is None else _usual_kind(beats)
    duration_s = (end_ns - start_ns) * 1e-9
    parameters = _parameters(clock, kind[0])
    rows = TelemetryRows(own, start_ns)
    imus = _imus(rows, kind[0])
    recorded_s = (start_ns + unix_offset_ns) * 1e-9 if unix_offset_ns else None
    gps = receivers_of(rows).tracks
    said = said_of(rows)
    board, uid = ardupilot_board(one.text for one in said)
    context = Context(
        uid=uid or autopilot_uid(clock[mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION], kind[0]),
        board=board,
        system_id=0 if beats is None else int(beats.senders[0][0]),
        vehicle=vehicle_name(kind[1]),
        start_unix_s=recorded_s or start_unix_s(rows),
        duration_s=duration_s,
        imus=imus,
        attitudes=attitudes_of(rows),
        truth=truth_of(rows),
        gps=gps,
        modes=_modes(clock, kind, duration_s),
        armed=_armed(clock, duration_s),
        said=said,
        parameters=parameters,
        vehicle_type=kind[1],
        compass_rows=_compass_rows(imus, parameters),
        faults=controls.faults(clock.find),
        silent=_silent(own, start_ns),
        notes=notes,
        **table_fields(rows, parameters, kind, gps),
    )
    firmware = _firmware(context.said)
    return context._replace(firmware=firmware, missing=_missing(context, beats is not None))


class _Clock:
    """Tables of one sender by message id, with times since the recording's start."""

    def __init__(self, tables: Tables, start_ns: int) -> None:
        self._tables = tables
        self._start_ns = start_ns

    def __getitem__(self, message_id: int) -> "FrameTable | None":
        table = self._tables.get(message_id)
        return None if table is None or not len(table.t_ns) else table

    def find(self, message_id: int) -> tuple[FrameTable, Array] | None:
        """Frames and their times; None without any."""
        table = self[message_id]
        return None if table is None else (table, self.t_s(table))

    def t_s(self, table: FrameTable) -> Array:
        """(N,) arrival, s since the start."""
        return np.asarray((table.t_ns - self._start_ns) * 1e-9)


def _heartbeats(tables: Tables) -> FrameTable | None:
    """The heartbeats of the autopilot that sent most of them."""
    table = tables.get(HEARTBEAT)
    if table is None:
        return None
    table = _where(table, table.fields["autopilot"] != mavlink.MAV_AUTOPILOT_INVALID)
    if not len(table.t_ns):
        return None
    addresses = table.senders[:, 0].astype(np.int64) << 8 | table.senders[:, 1]
    usual = np.bincount(addresses).argmax()
    return _where(table, addresses == usual)


def _of_sender(tables: Tables, beats: FrameTable | None) -> Tables:
    """The frames of the autopilot; all frames if there were no heartbeats of one."""
    if beats is None:
        return tables
    sender = beats.senders[0]
    return {
        message_id: _where(table, (table.senders == sender).all(axis=1))
        for message_id, table in tables.items()
    }


def _silent(tables: Tables, start_ns: int) -> tuple[Span, ...]:
    """While no message came that is read here."""
    t_ns = np.sort(np.concatenate([table.t_ns for table in tables.values()]), kind="stable")
    return silences((t_ns - start_ns) * 1e-9)


def _where(table: FrameTable, mask: NDArray[np.bool_]) -> FrameTable:
    return FrameTable(table.t_ns[mask], table.senders[mask], table.fields[mask])


def _usual_kind(beats: FrameTable) -> tuple[int, int]:
    """MAV_AUTOPILOT and MAV_TYPE."""
    make, kind = beats.fields["autopilot"], beats.fields["type"]
    return int(np.bincount(make).argmax()), int(np.bincount(kind).argmax())


# --- inertial sensors -------------------------------------------------------------------------


def _imus(rows: TelemetryRows, autopilot: int) -> tuple[ImuTrack, ...]:
    """One track per IMU: of the message that the service prefers, unless it hardly comes."""
    every = {(one.message, one.number): one for one in imu_columns(rows)}
    ranked = [IMU_MESSAGES[message_id].name for message_id in preference(autopilot, "auto")]
    tracks = []
    for imu in range(MAX_IMUS):
        found = [every[name, imu] for name in ranked if (name, imu) in every]
        if found:
            most = max(len(one.w_b) for one in found)
            tracks.append(_track(next(one for one in found if 2 * len(one.w_b) >= most)))
    return tuple(tracks)


def _track(imu: ImuColumns) -> ImuTrack:
    columns = (imu.stamp_us, imu.w_b, imu.f_b, imu.m_b_ut)
    return ImuTrack(imu.number, imu.message, imu.rows.t_s, *columns)


def _compass_rows(
    imus: tuple[ImuTrack, ...], parameters: dict[str, float]
) -> tuple[CompassRows, ...]:
    """Of the IMUs' messages, in which an absent compass shows zeros."""
    found = []
    for track in imus:
        has_field = np.isfinite(track.m_b_ut[:, 0])
        if has_field.any():
            fields = track.m_b_ut[has_field]
            found.append(compass_rows(track.imu, track.t_s[has_field], fields, parameters))
    return tuple(found)


# --- the vehicle ------------------------------------------------------------------------------


def _modes(clock: _Clock, kind: tuple[int, int], duration_s: float) -> tuple[Span, ...]:
    beats = clock[HEARTBEAT]
    if beats is None:
        return ()
    name_of = _mode_names(*kind)
    pairs = zip(
        beats.fields["base_mode"].tolist(), beats.fields["custom_mode"].tolist(), strict=True
    )
    return spans(clock.t_s(beats).tolist(), (name_of(*pair) for pair in pairs), duration_s)


def _mode_names(autopilot: int, vehicle_type: int) -> Callable[[int, int], str]:
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return px4_mode
    known = of_vehicle(vehicle_type)
    return lambda _, custom: known.get(custom, f"mode {custom}")


def _armed(clock: _Clock, duration_s: float) -> tuple[Span, ...]:
    beats = clock[HEARTBEAT]
    if beats is None:
        return ()
    armed = (beats.fields["base_mode"] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED) != 0
    names = ("armed" if is_armed else "" for is_armed in armed.tolist())
    return spans(clock.t_s(beats).tolist(), names, duration_s)


def _firmware(said: Iterable[Said]) -> str:
    names = ("ArduCopter", "ArduPlane", "ArduRover", "Rover", "ArduSub", "Blimp", "AntennaTracker")
    return next((each.text for each in said if each.text.startswith(names)), "")


def _parameters(clock: _Clock, autopilot: int) -> dict[str, float]:
    """The parameters; PX4 sends the bits of its integers in place of the float."""
    table = clock[mavlink.MAVLINK_MSG_ID_PARAM_VALUE]
    if table is None:
        return {}
    names = (
        bytes(name).split(b"\0", 1)[0].decode("ascii", "replace")
        for name in table.fields["param_id"]
    )
    values = table.fields["param_value"].copy()
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        is_integer = table.fields["param_type"] < mavlink.MAV_PARAM_TYPE_REAL32
        values = np.where(is_integer, values.view(np.int32), values.astype(np.float64))
    pairs = zip(names, values.tolist(), strict=True)
    return {name: value for name, value in pairs if math.isfinite(value)}


def _missing(context: Context, has_autopilot: bool) -> tuple[str, ...]:
    """What the recording lacks for a better review, one phrase each."""
    lacks = {
        "no heartbeats of an autopilot, so that the vehicle is unknown": not has_autopilot,
        "no attitude of the autopilot": not context.attitudes,
        "no throttle": context.throttle is None,
    }
    more = tuple(phrase for phrase, is_missing in lacks.items() if is_missing)
    return what_sensors_lack(context) + more
