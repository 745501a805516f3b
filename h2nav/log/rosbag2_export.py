"""A log as a bag of ROS 2: a folder with one MCAP and the ``metadata.yaml`` that rosbag2 reads.

Axes and units are those of REP-103, frames those of REP-105, IMU topics those of REP-145: ``map``
is east-north-up, ``base_link`` is forward-left-up, and a specific force points up at rest.
"""

import math
import struct
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import orjson
import yaml
from mcap.records import Channel
from mcap.writer import CompressionType, Writer

from h2nav import __version__
from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log.file import new_file
from h2nav.log.progress import Progress
from h2nav.log.reader import messages_of
from h2nav.log.records import StoredMessage
from h2nav.log.ros_messages import definition, encode, full_name
from h2nav.log.survey import require_mcap
from h2nav.maths.frames import attitude_enu_flu_from_ned_frd, enu_from_ned, flu_from_frd
from h2nav.maths.quaternion import Quat, Vec3
from h2nav.maths.units import SECOND_NS

MAP, BASE = "map", "base_link"
TYPES = {
    "/imu/data": "sensor_msgs/Imu",
    "/imu/data_raw": "sensor_msgs/Imu",
    "/imu/mag": "sensor_msgs/MagneticField",
    "/velocity": "geometry_msgs/TwistStamped",
    "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    "/tf": "tf2_msgs/TFMessage",
}
METADATA_VERSION = 5  # of rosbag2 in Humble; later ones read it, and nothing of theirs is needed
NOISE_SAMPLES = 100  # that a variance is made of
TESLA_PER_UT = 1e-6
_OK, _WARN, _ERROR = 0, 1, 2
_LEVELS = {
    Severity.CRITICAL: _ERROR,
    Severity.ERROR: _ERROR,
    Severity.WARNING: _WARN,
    Severity.NOTICE: _OK,
    Severity.INFO: _OK,
}
_STATE_LEVELS = {"active": _OK, "aligning": _WARN, "degraded": _WARN}
_UNKNOWN = (0.0,) * 9
_NO_ORIENTATION = (-1.0, *(0.0,) * 8)
_ANY_HEADING_DEG = 180.0 / math.sqrt(3.0)  # the deviation of a heading that may be any

_Status = tuple[int, str, str, str, list[tuple[str, str]]]


class BagResult(NamedTuple):
    """What was written."""

    path: Path  # the folder
    messages: dict[str, int]  # topic -> how many
    left_out: int  # records with fields missing, as in logs of old versions, or times beyond 2038


def export_rosbag2(
    path: Path,
    folder: Path,
    topics: Collection[str] = (),
    progress: Progress = lambda done, total: None,
) -> BagResult:
    """Writes samples, attitudes, velocities and findings of a log to a bag.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        folder: of the bag; a new one.
        topics: of the bag, out of `TYPES`; all when empty.
        progress: called with the bytes done and in all.

    Raises:
        BadInput: no log, `folder` exists, no such topic, or nothing in the log for them.
    """
    require_mcap(path)
    unknown = sorted(set(topics) - set(TYPES))
    if unknown:
        raise BadInput(f"--topic: no {', '.join(unknown)} in a bag; it has {', '.join(TYPES)}")
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise BadInput(f"{folder}: exists; name another folder with -o") from None
    try:
        with new_file(folder / f"{folder.name}_0.mcap") as stream:
            bag = _Bag(stream, topics or TYPES)
            flight = _Flight(bag)
            for channel, stored in messages_of(path, progress):
                flight.take(channel, stored)
            if not bag.messages:
                raise BadInput(f"{path}: no samples, attitudes or findings in it")
            document = bag.finish(Path(stream.name).name)
            with new_file(folder / "metadata.yaml", "x") as metadata:
                yaml.safe_dump(document, metadata, sort_keys=False)
    except BaseException:
        folder.rmdir()
        raise
    return BagResult(folder, bag.messages, flight.left_out)


class _Flight:
    """Turns records of a log into messages."""

    def __init__(self, bag: "_Bag") -> None:
        self.left_out = 0
        self._bag = bag
        self._takers = {
            "/imu": self._imu,
            "/estimate": self._estimate,
            "/aiding": self._velocity,
            "/finding": self._finding,
            "/health": self._health,
        }
        self._rate_noise, self._force_noise = _Noise(), _Noise()
        self._force: tuple[int, Vec3] | None = None
        self._open: dict[str, _Status] = {}

    def take(self, channel: Channel, stored: StoredMessage) -> None:
        """Writes what follows from one message of the log; one that is none of ours, nothing."""
        taker = self._takers.get(channel.topic)
        if taker is None or channel.message_encoding != "json":
            return
        try:
            taker(orjson.loads(stored.data), _Times(stored.log_ns, stored.publish_ns))
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, struct.error):
            self.left_out += 1

    def _imu(self, fields: dict[str, Any], times: "_Times") -> None:
        rate, force = (
            flu_from_frd(_vector(fields, name)) for name in ("gyro_?_rad_s", "acc_?_m_s2")
        )
        self._rate_noise.take(rate)
        self._force_noise.take(force)
        self._force = fields["t_us"], force
        head = times.head(BASE)
        values = (*head, 0.0, 0.0, 0.0, 1.0, *_NO_ORIENTATION, *self._measured(rate, force))
        self._bag.write("/imu/data_raw", times, values)
        if fields["mag_x_ut"] is not None:
            field_t = [each * TESLA_PER_UT for each in flu_from_frd(_vector(fields, "mag_?_ut"))]
            self._bag.write("/imu/mag", times, (*head, *field_t, *_UNKNOWN))

    def _estimate(self, fields: dict[str, Any], times: "_Times") -> None:
        w, x, y, z = attitude_enu_flu_from_ned_frd(_quaternion(fields))
        head = (*times.head(MAP), BASE)
        self._bag.write("/tf", times, ([(*head, 0.0, 0.0, 0.0, x, y, z, w)],))
        if self._force is None or self._force[0] != fields["t_us"]:
            return
        rate = flu_from_frd(_vector(fields, "rate_?_rad_s"))
        covariance = _orientation_covariance(fields)
        measured = self._measured(rate, self._force[1])
        values = (*times.head(BASE), x, y, z, w, *covariance, *measured)
        self._bag.write("/imu/data", times, values)

    def _measured(self, rate: Vec3, force: Vec3) -> tuple[float, ...]:
        rates, forces = self._rate_noise.covariance, self._force_noise.covariance
        return (*rate, *rates, *force, *forces)

    def _velocity(self, fields: dict[str, Any], times: "_Times") -> None:
        if fields["kind"] != "velocity":
            return
        north, east, down = (fields[f"{axis}_m_s"] for axis in ("north", "east", "down"))
        linear = enu_from_ned((float(north), float(east), float(down or 0.0)))
        self._bag.write("/velocity", times, (*times.head(MAP), *linear, 0.0, 0.0, 0.0))

    def _finding(self, fields: dict[str, Any], times: "_Times") -> None:
        name = fields["id"]
        status = _finding_status(fields)
        if fields["is_open"]:
            self._open[name] = status
        else:
            self._open.pop(name, None)
        self._bag.write("/diagnostics", times, (*times.head(""), [status]))

    def _health(self, fields: dict[str, Any], times: "_Times") -> None:
        """Writes health and open findings once a second: unrepeated ones count as stale."""
        statuses = [_health_status(fields), *self._open.values()]
        self._bag.write("/diagnostics", times, (*times.head(""), statuses))


class _Times(NamedTuple):
    """Times of arrival and, as far as known, of creation of a message in the log; UNIX ns."""

    log_ns: int
    publish_ns: int

    def head(self, frame: str) -> tuple[int, int, str]:
        return *divmod(self.publish_ns, SECOND_NS), frame


class _Noise:
    """The variance of a sensor's latest samples about a smooth motion; vibration is noise here.

    The second difference of white noise has six times its variance.
    """

    def __init__(self) -> None:
        self._last: list[Vec3] = []
        self._variances = [0.0, 0.0, 0.0]
        self._count = 0

    def take(self, value: Vec3) -> None:
        if len(self._last) == 2:
            self._count = min(self._count + 1, NOISE_SAMPLES)
            for axis, (newest, before, first) in enumerate(zip(value, *self._last, strict=True)):
                found = (newest - 2.0 * before + first) ** 2 / 6.0
                self._variances[axis] += (found - self._variances[axis]) / self._count
        self._last = [value, *self._last[:1]]

    @property
    def covariance(self) -> tuple[float, ...]:
        """Row-major; zeros, which stand for an unknown one, before the third sample."""
        return _diagonal(*self._variances)


class _Bag:
    """A bag that is being written."""

    def __init__(self, stream: Any, topics: Collection[str]) -> None:
        self.messages: dict[str, int] = {}
        self._topics = topics
        self._writer = Writer(stream, compression=CompressionType.ZSTD, use_summary_offsets=False)
        self._writer.start("ros2", f"h2nav {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._first_ns, self._last_ns = 2**63 - 1, 0

    def write(self, topic: str, times: _Times, values: Iterable[Any]) -> None:
        """Writes a message of the topic's type; nothing where the topic is not wanted."""
        if topic not in self._topics:
            return
        channel = self._channels.get(topic) or self._channel(topic)
        data = encode(TYPES[topic], values)
        self._writer.add_message(channel, times.log_ns, data, times.publish_ns)
        self.messages[topic] = self.messages.get(topic, 0) + 1
        self._first_ns = min(self._first_ns, times.log_ns)
        self._last_ns = max(self._last_ns, times.log_ns)

    def _channel(self, topic: str) -> int:
        name = TYPES[topic]
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(
                full_name(name), "ros2msg", definition(name)
            )
        self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[name])
        return self._channels[topic]

    def finish(self, file_name: str) -> dict[str, Any]:
        """Writes the index; returns the metadata of the bag, which has one file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        return {"rosbag2_bagfile_information": self._metadata(file_name)}

    def _span(self) -> dict[str, Any]:
        return {
            "duration": {"nanoseconds": self._last_ns - self._first_ns},
            "starting_time": {"nanoseconds_since_epoch": self._first_ns},
            "message_count": sum(self.messages.values()),
        }

    def _metadata(self, file_name: str) -> dict[str, Any]:
        return {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            **self._span(),
            "topics_with_message_count": [
                {"topic_metadata": _topic_metadata(topic), "message_count": count}
                for topic, count in self.messages.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file_name],
            "files": [{"path": file_name, **self._span()}],
        }


def _topic_metadata(topic: str) -> dict[str, str]:
    return {
        "name": topic,
        "type": full_name(TYPES[topic]),
        "serialization_format": "cdr",
        "offered_qos_profiles": "",
    }


def _vector(fields: dict[str, Any], name: str) -> Vec3:
    x, y, z = (float(fields[name.replace("?", axis)]) for axis in "xyz")
    return x, y, z


def _quaternion(fields: dict[str, Any]) -> Quat:
    w, x, y, z = (float(fields[f"q_{axis}"]) for axis in "wxyz")
    return w, x, y, z


def _orientation_covariance(fields: dict[str, Any]) -> tuple[float, ...]:
    """About the axes of `MAP`: tilt about east and north, heading about up; zeros: unknown."""
    tilt_deg, heading_deg = fields["sigma_tilt_deg"], fields.get("sigma_heading_deg")
    if tilt_deg is None:
        return _UNKNOWN
    tilt, heading = math.radians(tilt_deg), math.radians(heading_deg or _ANY_HEADING_DEG)
    return _diagonal(tilt * tilt, tilt * tilt, heading * heading)


def _diagonal(x: float, y: float, z: float) -> tuple[float, ...]:
    return x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z


def _finding_status(fields: dict[str, Any]) -> _Status:
    """``h2nav: KIND.SENSOR``: another one of the same kind takes the place of one that is over."""
    level = _LEVELS[Severity.of(fields["severity"]) or Severity.INFO]
    text = fields["text"]
    return (
        level if fields["is_open"] else _OK,
        f"h2nav: {fields['id'].rpartition('.')[0]}",
        text if fields["is_open"] else f"over: {text}",
        fields["source"],
        _key_values(
            fields, ("id", "severity", "from_s", "to_s", "size", "unit", "evidence", "cause")
        ),
    )


def _health_status(fields: dict[str, Any]) -> _Status:
    state, reason = fields["state"], fields["reason"]
    keys = ("imu_message", "imu_rate_hz", "samples_rejected", "armed", "independent", "late_ms")
    return (
        _STATE_LEVELS.get(state, _ERROR),
        "h2nav: attitude",
        f"{state}: {reason}" if reason else state,
        fields["autopilot"],
        _key_values(fields, keys),
    )


def _key_values(fields: dict[str, Any], keys: Iterable[str]) -> list[tuple[str, str]]:
    return [(key, str(fields[key])) for key in keys if fields.get(key) is not None]
