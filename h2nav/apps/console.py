"""What the daemon shows: a live line on a terminal, else journal-style lines or JSON events."""

import json
import os
import sys
from typing import TextIO

from h2nav.io.deframer import Frame
from h2nav.service.effects import Severity
from h2nav.service.records import EstimateRecord, HealthRecord

REFRESH_NS = 200_000_000
EVENT_NS = 1_000_000_000
ERASE_LINE = "\r\x1b[K"


class Console:
    """Looks on at the pipeline and shows what happens.

    Args:
        events_as_json: write status events to standard output, one JSON document a line.
        stream: where people read.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, events_as_json: bool = False, stream: TextIO = sys.stderr) -> None:
        self._events_as_json = events_as_json
        self._stream = stream
        self._is_terminal = stream.isatty()
        # systemd sets it; its journal takes a priority in front of a line.
        self._is_journal = "JOURNAL_STREAM" in os.environ
        self._latest: EstimateRecord | None = None
        self._shown_ns = 0
        self._event_ns = 0
        self._line_is_open = False

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not shown."""

    def estimate(self, t_ns: int, record: EstimateRecord) -> None:
        """Remembers it for the live line."""
        self._latest = record

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Shows a line."""
        if self._events_as_json:
            event = {"event": "notice", "severity": severity.name.lower(), "text": text}
            print(json.dumps(event), flush=True)
        self._close_line()
        prefix = f"<{int(severity)}>" if self._is_journal else f"{severity.name.lower()}: "
        print(f"{prefix}{text}", file=self._stream, flush=True)

    def status(self, t_ns: int, health: HealthRecord) -> None:
        """Refreshes the live line a few times a second; as JSON, writes an event each second."""
        if self._events_as_json and t_ns - self._event_ns >= EVENT_NS:
            self._event_ns = t_ns
            print(json.dumps({"event": "status", **health._asdict()}), flush=True)
        if not self._is_terminal or t_ns - self._shown_ns < REFRESH_NS:
            return
        self._shown_ns = t_ns
        self._stream.write(ERASE_LINE + self._status_line(health))
        self._stream.flush()
        self._line_is_open = True

    def closing(self, health: HealthRecord) -> None:
        """The last event of a run."""
        self._close_line()
        if self._events_as_json:
            print(json.dumps({"event": "stopped", **health._asdict()}), flush=True)

    def _status_line(self, health: HealthRecord) -> str:
        parts = [health.state]
        if health.reason:
            parts.append(f"({health.reason})")
        if health.imu_message:
            parts.append(f"{health.imu_message} {health.imu_rate_hz:.0f} Hz")
        latest = self._latest
        if latest is not None:
            parts.append(
                f"roll {latest.roll_deg:+7.2f}  pitch {latest.pitch_deg:+7.2f}  "
                f"yaw {latest.yaw_deg:+7.2f} deg"
            )
        parts.append(f"used {health.samples_used}  refused {health.samples_rejected}")
        return "  ".join(parts)

    def _close_line(self) -> None:
        if self._line_is_open:
            self._stream.write("\n")
            self._line_is_open = False
