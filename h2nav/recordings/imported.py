"""An autopilot's own log: events of the service, and the context for the review."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path

from h2nav.recordings.context import Context
from h2nav.wire.readers import Envelope, Message

Event = tuple[Envelope, Message]


class ImportedLog(ABC):
    """Typed records behind the wire boundary, in the order of their times.

    The clock of the events is the autopilot's own: arrival and measurement coincide.

    Attributes:
        path: the file.
        kind: ``dataflash`` or ``ulog``.
        unix_offset_ns: UNIX time minus the `t_ns` of the events; 0 if the date is unknown.
        unix_start_ns: UNIX time of the first event; 0 if the date is unknown.
        progress: bytes read, and bytes of the file.
        notes: what was damaged or skipped: reason -> count.
    """

    kind = ""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unix_offset_ns = 0
        self.unix_start_ns = 0
        self.progress = (0, path.stat().st_size)
        self.notes: dict[str, int] = {}

    @abstractmethod
    def events(self) -> Iterator[Event]:
        """Yields the events of the service in flight; `t_ns` never decreases.

        IMU readings are `h2nav.wire.imu.RECORDED_IMU` with the number of their IMU.
        """

    @abstractmethod
    def context(self) -> Context:
        """Everything else."""
