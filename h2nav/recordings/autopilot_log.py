"""Converts an autopilot's own log, of any format, to events of the service.

The importers of the formats (`dataflash`, `ulog`) return arrays; this module turns them into the
typed records that the service would have received in flight, in the order of their times.
"""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.rows import select_rows
from h2nav.recordings.context import (
    NO_ARMING,
    Array,
    AttitudeTrack,
    ChangedSetting,
    Context,
    GpsTrack,
    ImuTrack,
    Series,
    Span,
)
from h2nav.recordings.imported import Event, ImportedLog
from h2nav.recordings.imu_series import (
    MIN_IMU_HZ,
    Fields,
    ImuRows,
    Readings,
    Samples,
    Times,
    readings_of,
    track_of,
    usable,
)
from h2nav.recordings.log_clock import in_order
from h2nav.recordings.log_rows import Log
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.dialect import GNSS_INTEGRITY_ID
from h2nav.wire.imu import RECORDED_IMU, ImuReading
from h2nav.wire.position import (
    GnssLevels,
    GnssState,
    GnssTime,
    GpsFix,
    NoFix,
    Origin,
    Place,
)
from h2nav.wire.readers import Envelope, Message
from h2nav.wire.vehicle import (
    EARLIEST_UNIX_S,
    LATEST_UNIX_S,
    Airspeed,
    Heartbeat,
    LandedState,
    ParameterValue,
    StatusText,
    SystemTime,
)

SENDER = (1, 1)
SECOND_US = 1_000_000
# Events are generated in chunks of this length: few at once keep the garbage collector idle.
BLOCK_US = SECOND_US
# The service compares at most ten attitudes a second.
ATTITUDE_STEP_US = 50_000
# Parameters that are counters and change by themselves.
COUNTERS = "STAT_"
MAX_BURSTS = 2_000


class Setting(NamedTuple):
    """A parameter of the autopilot and the time from which it holds."""

    t_us: int
    name: str
    value: float


class Recorded(NamedTuple):
    """The contents of a log."""

    context: Context  # for the review
    autopilot: int  # MAV_AUTOPILOT
    vehicle_type: int  # MAV_TYPE
    start_us: int  # the autopilot's time at the beginning of the context
    readings: tuple[Readings, ...] = ()  # of the IMUs
    receiver: int = 0  # number of the GPS receiver whose fixes are used
    fix_us: Times = np.empty(0, np.int64)  # (N,) times of its fixes, on the autopilot's clock
    flown: AttitudeTrack | None = None  # attitude that the autopilot used for control
    second: AttitudeTrack | None = None  # attitude of its second estimator, as in AHRS2
    airspeed_m_s: Series | None = None  # (N,) of a sensor, along the nose; None without
    settings: tuple[Setting, ...] = ()  # parameters, in order
    origin: Place | None = None  # where the vehicle started; None if unknown
    airspeed_is_true: bool = False  # it is corrected by the density of the air


class _Stream(NamedTuple):
    """Messages of one kind."""

    t_us: Times  # (N,) their times, in order
    message_id: int  # of the equivalent MAVLink message
    make: Callable[[slice], Iterable[Message]]  # creates the messages of a slice


class AutopilotLog(ImportedLog):
    """A log that is read completely when it is opened.

    Raises:
        BadInput: the file cannot be read, or is of another kind.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._recorded = self._read()
        context = self._recorded.context
        self.notes = context.notes
        if context.start_unix_s is not None:
            self.unix_start_ns = round(context.start_unix_s * 1e9)
            self.unix_offset_ns = self.unix_start_ns - self._recorded.start_us * 1000

    @abstractmethod
    def _read(self) -> Recorded:
        """Reads the file."""

    def context(self) -> Context:
        """Everything else."""
        return self._recorded.context

    def events(self) -> Iterator[Event]:
        """Yields the events of the service in flight; `t_ns` never decreases."""
        streams = [stream for stream in _streams(self._recorded) if len(stream.t_us)]
        size = self.progress[1]
        start_us = self._recorded.start_us
        length_us = max(1, max((int(s.t_us[-1]) for s in streams), default=0) - start_us)
        places = [0] * len(streams)
        while heads := [
            int(s.t_us[i]) for s, i in zip(streams, places, strict=True) if i < len(s.t_us)
        ]:
            end_us = min(heads) + BLOCK_US
            times, block = [], list[Event]()
            for number, stream in enumerate(streams):
                part = slice(places[number], int(np.searchsorted(stream.t_us, end_us)))
                places[number] = part.stop
                times.append(stream.t_us[part])
                block += zip(
                    _envelopes(times[-1], stream.message_id), stream.make(part), strict=False
                )
            # Events of equal time stay in the order of the streams.
            order = np.argsort(np.concatenate(times), kind="stable")
            yield from map(block.__getitem__, order.tolist())
            self.progress = (min(size, size * (end_us - start_us) // length_us), size)
        self.progress = (size, size)


def _envelopes(t_us: Times, message_id: int) -> Iterator[Envelope]:
    """Envelopes of messages that arrived at the times of their measurement."""
    t_ns = (t_us * 1000).tolist()
    return map(Envelope._make, zip(t_ns, t_ns, repeat(SENDER), repeat(message_id), strict=False))


def _streams(recorded: Recorded) -> list[_Stream]:
    """All streams of messages to the service; at equal times, earlier streams come first."""
    context = recorded.context
    seconds = _seconds(recorded)
    streams = [_heartbeats(recorded, seconds), _settings(recorded)]
    if context.start_unix_s is not None:
        streams.append(_dates(seconds, recorded.start_us, context.start_unix_s))
    if context.airborne is not None:
        streams.append(_landed(seconds, recorded.start_us, context.airborne))
    if recorded.origin is not None:
        origin = Origin(recorded.origin)
        message_id = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        streams.append(_Stream(seconds[:1], message_id, lambda part: repeat(origin)))
    for receiver in context.gps:
        streams += _signal_states(recorded, receiver)
        streams += _signal_levels(recorded, receiver)
        streams += _clock(recorded, receiver)
        if receiver.receiver == recorded.receiver:
            streams.append(_fixes(recorded, receiver))
    if recorded.airspeed_m_s is not None:
        streams.append(_airspeeds(recorded, recorded.airspeed_m_s))
    for track, is_second in ((recorded.flown, False), (recorded.second, True)):
        if track is not None:
            streams.append(_attitudes(recorded.start_us, track, is_second=is_second))
    streams.append(_texts(recorded))
    streams += [_readings(readings, recorded.start_us) for readings in recorded.readings]
    return streams


def _boot_us(start_us: int, t_s: Array) -> Times:
    """Converts times of the context to the autopilot's clock."""
    return start_us + np.round(t_s * 1e6).astype(np.int64)


def _seconds(recorded: Recorded) -> Times:
    length_us = round(recorded.context.duration_s * 1e6)
    return recorded.start_us + np.arange(0, length_us + 1, SECOND_US, dtype=np.int64)


def _heartbeats(recorded: Recorded, t_us: Times) -> _Stream:
    """One heartbeat a second, as on the wire; the service binds to their sender."""
    t_s = (t_us - recorded.start_us) * 1e-6
    armed = np.zeros(len(t_us), np.bool_)
    for span in recorded.context.armed:
        armed |= (t_s >= span.from_s) & (t_s < span.to_s)
    make, kind = recorded.autopilot, recorded.vehicle_type
    beats = {is_armed: Heartbeat(make, kind, is_armed) for is_armed in (False, True)}
    return _Stream(
        t_us,
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        lambda part: map(beats.__getitem__, armed[part].tolist()),
    )


def _settings(recorded: Recorded) -> _Stream:
    settings = recorded.settings
    t_us = np.array([max(setting.t_us, recorded.start_us) for setting in settings], np.int64)
    return _Stream(
        t_us,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        lambda part: (ParameterValue(name, value) for _, name, value in settings[part]),
    )


def _dates(t_us: Times, start_us: int, start_unix_s: float) -> _Stream:
    unix_s = start_unix_s + (t_us - start_us) * 1e-6
    good = (unix_s >= EARLIEST_UNIX_S) & (unix_s < LATEST_UNIX_S)
    return _Stream(
        t_us[good],
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        lambda part: map(SystemTime, unix_s[good][part].tolist()),
    )


def _landed(t_us: Times, start_us: int, airborne: Series) -> _Stream:
    place = np.searchsorted(airborne.t_s, (t_us - start_us) * 1e-6, side="right") - 1
    landed = np.asarray(airborne.values)[np.maximum(place, 0)] < 0.5
    return _Stream(
        t_us,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        lambda part: map(LandedState, landed[part].tolist()),
    )


def _signal_states(recorded: Recorded, track: GpsTrack) -> list[_Stream]:
    """What a receiver says of its signals; nothing if it says nothing."""
    if track.jamming is None and track.spoofing is None:
        return []
    # PX4's receivers told of jamming years before they told of spoofing.
    unknown = np.zeros(len(track.t_s), np.int64)
    said = (unknown if each is None else each for each in (track.jamming, track.spoofing))
    states = np.stack((*said,), axis=1)

    def make(part: slice) -> Iterator[Message]:
        for jamming, spoofing in states[part].tolist():
            yield GnssState(track.receiver, jamming, spoofing)

    t_us = _boot_us(recorded.start_us, track.t_s)
    return [_Stream(t_us, GNSS_INTEGRITY_ID, make)]


def _signal_levels(recorded: Recorded, track: GpsTrack) -> list[_Stream]:
    """What a receiver measures of the power at its antenna; nothing if it does not."""
    power = track.power
    if power is None:
        return []

    def make(part: slice) -> Iterator[Message]:
        for noise, gain, line in power.values[part].tolist():
            yield GnssLevels(track.receiver, noise, gain, line)

    return [_Stream(_boot_us(recorded.start_us, power.t_s), GNSS_INTEGRITY_ID, make)]


def _clock(recorded: Recorded, track: GpsTrack) -> list[_Stream]:
    """The time that a receiver tells; nothing if the log does not have it."""
    clock = track.clock
    if clock is None:
        return []
    t_us = _boot_us(recorded.start_us, clock.t_s)

    def make(part: slice) -> Iterator[Message]:
        for time_us, unix_s in zip(t_us[part].tolist(), clock.values[part].tolist(), strict=True):
            yield GnssTime(track.receiver, time_us, unix_s)

    return [_Stream(t_us, GNSS_INTEGRITY_ID, make)]


def _fixes(recorded: Recorded, track: GpsTrack) -> _Stream:
    def make(part: slice) -> Iterator[Message]:
        rows = zip(
            track.has_fix[part].tolist(),
            recorded.fix_us[part].tolist(),
            track.latitude_deg[part].tolist(),
            track.longitude_deg[part].tolist(),
            track.altitude_m[part].tolist(),
            _vectors(track.v_n[part]),
            track.sigma_m_s[part].tolist(),
            track.satellites[part].tolist(),
            strict=True,
        )
        for has_fix, stamp_us, latitude, longitude, altitude, v_n, sigma, satellites in rows:
            if not has_fix:
                yield NoFix()
                continue
            is_known = v_n[0] == v_n[0] and v_n[1] == v_n[1]
            place = Place(latitude, longitude, altitude)
            count = int(satellites) if math.isfinite(satellites) else None
            yield GpsFix(stamp_us, place, v_n if is_known else None, sigma, count)

    t_us = _boot_us(recorded.start_us, track.t_s)
    return _Stream(t_us, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, make)


def _airspeeds(recorded: Recorded, airspeed: Series) -> _Stream:
    values = airspeed.values
    return _Stream(
        _boot_us(recorded.start_us, airspeed.t_s),
        mavlink.MAVLINK_MSG_ID_AIRSPEED,
        lambda part: (
            Airspeed(v if v > 0.0 else None, recorded.airspeed_is_true)
            for v in values[part].tolist()
        ),
    )


def _attitudes(start_us: int, track: AttitudeTrack, *, is_second: bool) -> _Stream:
    """Attitudes, thinned to the rate of the comparison."""
    t_us = _boot_us(start_us, track.t_s)
    step = (t_us - start_us) // ATTITUDE_STEP_US
    kept = np.diff(step, prepend=-1) > 0
    t_us, q_nb = t_us[kept], track.q_nb[kept]

    def make(part: slice) -> Iterator[Message]:
        times_ms = [None] * len(t_us[part]) if is_second else (t_us[part] // 1000).tolist()
        return (
            ReportedAttitude(is_second, time_ms, tuple(q))
            for time_ms, q in zip(times_ms, q_nb[part].tolist(), strict=True)
        )

    message_id = mavlink.MAVLINK_MSG_ID_AHRS2 if is_second else mavlink.MAVLINK_MSG_ID_ATTITUDE
    return _Stream(t_us, message_id, make)


def _texts(recorded: Recorded) -> _Stream:
    said = recorded.context.said
    t_s = np.array([text.t_s for text in said], np.float64)
    return _Stream(
        _boot_us(recorded.start_us, t_s),
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        lambda part: (StatusText(text.text) for text in said[part]),
    )


def _readings(recorded: Readings, start_us: int) -> _Stream:
    """The readings, without those from before the log's first time."""
    first = int(np.searchsorted(recorded.t_us, start_us))
    readings = select_rows(recorded, slice(first, None))
    has_field = ~np.isnan(readings.m_b_ut[:, 0])

    def make(part: slice) -> Iterator[Message]:
        fields = zip(has_field[part].tolist(), _vectors(readings.m_b_ut[part]), strict=True)
        rows = zip(
            readings.t_us[part].tolist(),
            _vectors(readings.w_b[part]),
            _vectors(readings.f_b[part]),
            (field if has else None for has, field in fields),
            readings.clipped[part].tolist(),
            repeat(readings.imu),
            repeat(readings.ages),
            strict=False,
        )
        return map(ImuReading._make, rows)

    return _Stream(readings.t_us, RECORDED_IMU, make)


def _vectors(values: Array) -> Iterator[tuple[float, ...]]:
    """Yields the rows of (N, k) as tuples; by columns, which avoids intermediate lists."""
    return zip(*values.T.tolist(), strict=True)


def imus_of(
    log: Log,
    found: Iterable[ImuRows],
    compasses: Mapping[int, Fields],
    to_body: Callable[[Array], Array] = np.asarray,
) -> tuple[tuple[ImuTrack, ...], tuple[Readings, ...]]:
    """The plausible samples of the IMUs, for the review and for the service.

    Args:
        log: counts what is left out.
        compasses: fields by number, in axes of the body.
        to_body: turns (N, 3) vectors of the sensors' axes into the body's.
    """
    tracks, readings = [], []
    for imu, source, every, averaged_us, device_ids, is_timed in found:
        good = usable(every)
        log.note(f"values of IMU {imu + 1} that cannot be", int((~good).sum()))
        good[good] = in_order(every.t_us[good])
        samples = every.only(good)
        if not len(samples.t_us):
            continue
        samples = Samples(samples.t_us, to_body(samples.w_b), to_body(samples.f_b))
        own = compasses.get(imu)
        track = track_of(imu, source, log.since_start(samples.t_us), samples, own)
        tracks.append(track._replace(device_ids=device_ids, is_timed=is_timed))
        if is_timed and samples.rate_hz >= MIN_IMU_HZ:
            lent = own if own is not None else compasses.get(0)
            # A mean over the time before its stamp is as old as half of that.
            age_s = None if averaged_us is None else 0.5e-6 * float(np.median(averaged_us[good]))
            readings.append(readings_of(imu, samples, lent, age_s))
    return tuple(tracks), tuple(readings)


def completed(
    context: Context,
    log: Log,
    settings: tuple[Setting, ...],
    armed: tuple[Span, ...] | None,
    lacks: Mapping[str, bool],
) -> Context:
    """A context with what follows from the rest of it in every format.

    Args:
        armed: while it was armed; None if unknown.
        lacks: further phrases for `missing`, and whether they hold.
    """
    start_us = log.clock.start_us
    missing = {
        "no row of the log has a time": not log.clock.end_us,
        "no autopilot's attitude to compare with": not context.attitudes,
        NO_ARMING: armed is None,
        **lacks,
    }
    return context._replace(
        vehicle=vehicle_name(context.vehicle_type),
        duration_s=log.duration_s,
        # Without such a message nothing counts as at rest.
        armed=(Span(0.0, log.duration_s, "armed"),) if armed is None else armed,
        parameters={setting.name: setting.value for setting in settings},
        changes=_changes((1e-6 * (t_us - start_us), name, value) for t_us, name, value in settings),
        missing=(*what_sensors_lack(context), *(text for text, is_so in missing.items() if is_so)),
        notes=log.notes,
    )


def _changes(settings: Iterable[tuple[float, str, float]]) -> tuple[ChangedSetting, ...]:
    """Parameters that changed, from time, name and value of all that were logged, in order."""
    known: dict[str, float] = {}
    found = []
    for t_s, name, value in settings:
        before = known.get(name, value)
        known[name] = value
        if before != value and not name.startswith(COUNTERS):
            found.append(ChangedSetting(t_s, name, before, value))
    return tuple(found)


def vehicle_name(vehicle_type: int) -> str:
    """The name of a MAV_TYPE for people."""
    entry = mavlink.enums["MAV_TYPE"].get(vehicle_type)
    if entry is None or not vehicle_type:
        return ""
    return str(entry.name).removeprefix("MAV_TYPE_").replace("_", " ").lower()


def has_enough_samples(context: Context) -> bool:
    """Whether the recording has enough samples for an attitude."""
    timed = (track for track in context.imus if track.is_timed)
    return max(map(imu_rate_hz, timed), default=0.0) >= MIN_IMU_HZ


def imu_rate_hz(track: ImuTrack) -> float:
    """Samples a second, from the usual interval."""
    return Samples(track.stamp_us, track.w_b, track.f_b).rate_hz


def what_sensors_lack(context: Context) -> tuple[str, ...]:
    """What the sensors lack for a better review, one phrase each."""
    rates_hz = [imu_rate_hz(track) for track in context.imus]
    fixes = [track for track in context.gps if track.has_fix.any()]
    no_velocity = not any(np.isfinite(track.v_n[track.has_fix]).any() for track in fixes)
    lacks = {
        "no IMU samples": not context.imus,
        f"IMU samples only {max(rates_hz, default=0.0):.0f} times a second": bool(rates_hz)
        and max(rates_hz) < MIN_IMU_HZ,
        "IMU samples without times of their own": bool(context.imus)
        and not any(track.is_timed for track in context.imus),
        "no compass": not any(np.isfinite(track.m_b_ut[:, 0]).any() for track in context.imus),
        "no GPS fix": not fixes,
        "no GPS velocity": bool(fixes) and no_velocity,
        "no date": context.start_unix_s is None,
    }
    return tuple(text for text, is_so in lacks.items() if is_so)
