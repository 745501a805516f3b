"""Messages that viewers display without configuration: transform, pose and text, in protobuf."""

from enum import IntEnum
from typing import Any

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError

from h2nav.attitude.samples import Quat
from h2nav.integrity.severity import Severity
from h2nav.maths.units import SECOND_NS


class LogLevel(IntEnum):
    """Levels of ``foxglove.Log``."""

    DEBUG = 1
    INFO = 2
    WARNING = 3
    ERROR = 4
    FATAL = 5


LEVELS = {
    Severity.CRITICAL: LogLevel.FATAL,
    Severity.ERROR: LogLevel.ERROR,
    Severity.WARNING: LogLevel.WARNING,
    Severity.NOTICE: LogLevel.INFO,
    Severity.INFO: LogLevel.INFO,
}


class AttitudeMessages:
    """Encodes an attitude as ``foxglove.FrameTransform`` and ``foxglove.PoseInFrame``.

    The messages are reused and overwritten, which halves the cost. Not thread-safe.
    """

    def __init__(self) -> None:
        self._transform: Any = FrameTransform(parent_frame_id="ned", child_frame_id="body")
        self._transform.translation.SetInParent()
        self._pose: Any = PoseInFrame(frame_id="ned")
        self._pose.pose.position.SetInParent()

    def transform(self, unix_ns: int, q_nb: Quat) -> bytes:
        """The rotation that takes body coordinates to NED, as the frame ``body`` in ``ned``."""
        return _filled(self._transform, self._transform.rotation, unix_ns, q_nb)

    def pose(self, unix_ns: int, q_nb: Quat) -> bytes:
        """The same as a pose at the origin of ``ned``."""
        return _filled(self._pose, self._pose.pose.orientation, unix_ns, q_nb)


def _filled(message: Any, rotation: Any, unix_ns: int, q_nb: Quat) -> bytes:
    stamp = message.timestamp
    stamp.seconds, stamp.nanos = divmod(unix_ns, SECOND_NS)
    rotation.w, rotation.x, rotation.y, rotation.z = q_nb
    serialized: bytes = message.SerializeToString()
    return serialized


def log_message(unix_ns: int, severity: Severity, text: str) -> bytes:
    """One ``foxglove.Log`` line; a path in it may hold bytes that are not text."""
    message: Any = Log(message=text.encode(errors="replace").decode(), name="h2nav")
    message.level = int(LEVELS[severity])
    message.timestamp.seconds, message.timestamp.nanos = divmod(unix_ns, SECOND_NS)
    serialized: bytes = message.SerializeToString()
    return serialized


def flat_fields(schema_name: str, data: bytes) -> dict[str, Any] | None:
    """Column -> value of a message of this module; None for any other schema.

    Raises:
        ValueError: the bytes are not such a message.
    """
    kinds: dict[str, Any] = {k.DESCRIPTOR.full_name: k for k in (FrameTransform, PoseInFrame, Log)}
    kind = kinds.get(schema_name)
    if kind is None:
        return None
    message = kind()
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise ValueError(f"damaged {schema_name}") from error
    if kind is Log:
        return {"level": LogLevel(message.level).name, "message": message.message}
    rotation = message.rotation if kind is FrameTransform else message.pose.orientation
    return {f"q_{axis}": getattr(rotation, axis) for axis in "wxyz"}


def descriptor_set(message_type: Any) -> bytes:
    """The message's file descriptor and every one it imports, as MCAP requires."""
    files: dict[str, FileDescriptor] = {}

    def collect(file: FileDescriptor) -> None:
        # Those that a file imports come before it, as protoc orders them and readers expect.
        if file.name not in files:
            for dependency in file.dependencies:
                collect(dependency)
            files[file.name] = file

    collect(message_type.DESCRIPTOR.file)
    found = FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(found.file.add())
    return found.SerializeToString()


def protobuf_schemas() -> dict[str, tuple[str, bytes]]:
    """Topic -> (schema name, descriptor set) of all channels of this module."""
    return {
        topic: (kind.DESCRIPTOR.full_name, descriptor_set(kind))
        for topic, kind in (("/tf", FrameTransform), ("/pose", PoseInFrame), ("/log", Log))
    }
