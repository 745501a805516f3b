"""The whole pipeline under watch: whatever comes in, what goes out is sound, bounded and soon over.

It is fed through its three events alone; nothing of the service's inside is touched but what it
shows to everybody (`health`, `rejected`).
"""

import functools
import gc
import math
import sys
import time
from collections import deque
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fuzz.clean_sessions import CONFIGURATIONS
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.log.recorder import Recorder
from h2nav.service.records import estimate_record
from h2nav.service.service import Service, Surroundings
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame

MINUTE_NS = 60_000_000_000
START_NS = 1_000_000_000_000
UNIX_OFFSET_NS = 1_794_000_000_000_000_000
UNIX_S = 1_795_000_000.0
# Attitude, quaternion and odometry for a sample; three parameters for a question; an answer.
MAX_SENT_PER_INPUT = 8
MAX_TOLD_PER_INPUT = 8
# Windows fill after a session has begun: 170 kB were seen after 1,200 frames.
MAX_GROWTH_BYTES = 200_000
FASTEST_RAD_S = 1e4
# Counts of what only a fault of ours can cause.
GUARDS = ("handler_error", "filter_error", "non_finite_estimate", "odometry_not_finite")
WITHOUT_REFERENTS = (ModuleType, FunctionType, type)


class InvariantBrokenError(Exception):
    """The pipeline did what it must never do."""


class WatchedPipeline:
    """A pipeline and all that it says.

    Args:
        configuration: a name of `CONFIGURATIONS`.
        log: where to record; None = no log.

    Attributes:
        said: messages that it sent since the last `heard`, decoded.
        frames: frames fed so far.
        slowest_s: time of the slowest input.
        told: notices so far.
        most_told: notices in the worst minute.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, configuration: str, log: Path | None = None) -> None:
        chosen = CONFIGURATIONS[configuration]
        filters = _filters(configuration)
        surroundings = Surroundings(filters.filter_for, earth_field_at, UNIX_S, UNIX_OFFSET_NS)
        self.service = Service(chosen.service, surroundings)
        self._recorder = None if log is None else Recorder.to_file(log, UNIX_OFFSET_NS)
        outlets = Outlets(lambda t_ns: t_ns + UNIX_OFFSET_NS, self._hears, self._recorder, self)
        self._pipeline = Pipeline(self.service, chosen.output.component_id, outlets)
        self._ear = Deframer()
        self._sent = 0
        self._told_before = 0
        self._first_bytes: int | None = None
        self.said: list[Any] = []
        self.frames = 0
        self.slowest_s = 0.0
        self.told = 0
        self.most_told = 0
        self._reported_ns: deque[int] = deque()

    @property
    def is_active(self) -> bool:
        """Whether the attitude is sent and believed."""
        return self.service.health.state == "active"

    @property
    def next_timer_ns(self) -> int:
        """When `tick` has something to do."""
        return self._pipeline.next_timer_ns

    def received(self, t_ns: int, data: bytes) -> None:
        """Feeds bytes."""
        self.frames += 1
        self._watch(self._pipeline.received, t_ns, data)

    def tick(self, t_ns: int) -> None:
        """Lets the clock work."""
        self._watch(self._pipeline.tick, t_ns)

    def link(self, t_ns: int, is_up: bool) -> None:
        """Moves the link."""
        self._watch(self._pipeline.link, t_ns, is_up)

    def heard(self) -> list[Any]:
        """What was sent since the last call."""
        said, self.said = self.said, []
        return said

    def check_counts(self) -> None:
        """No guard was reached, and every record could be written."""
        reached = [reason for reason in self.service.rejected if reason.startswith(GUARDS)]
        if reached:
            raise InvariantBrokenError(f"guards were reached: {', '.join(reached)}")
        if self._recorder is not None:
            if self._recorder.statistics().rejected:
                raise InvariantBrokenError("the recorder refused a record")
            if self._recorder.trouble:
                raise InvariantBrokenError(f"the recorder gave up: {self._recorder.trouble}")

    def check_memory(self) -> None:
        """What the pipeline holds has not grown since the first call."""
        held = _bytes_held(self._pipeline, self)
        if self._first_bytes is None:
            self._first_bytes = held
        if held - self._first_bytes > MAX_GROWTH_BYTES:
            raise InvariantBrokenError(f"memory grew from {self._first_bytes} to {held} bytes")

    def close(self) -> None:
        """Ends the log."""
        if self._recorder is not None:
            self._recorder.close()

    # --- the watcher's side -------------------------------------------------------------------

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not watched."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Every number of an estimate is one; not every filter knows its sigma."""
        record = estimate_record(estimate, late_ns)
        for name, value in zip(record._fields, record, strict=True):
            is_unknown = name.startswith("sigma_") and math.isnan(value)
            if isinstance(value, float) and not math.isfinite(value) and not is_unknown:
                raise InvariantBrokenError(f"estimate: {name} is {value}")

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """A notice is one readable line."""
        self.told += 1
        self._reported_ns.append(t_ns)
        while self._reported_ns[0] < t_ns - MINUTE_NS:
            self._reported_ns.popleft()
        self.most_told = max(self.most_told, len(self._reported_ns))
        if not text.isprintable():
            raise InvariantBrokenError(f"a notice is not readable: {text!r}")

    # --- inside -------------------------------------------------------------------------------

    def _watch(self, event: Any, *arguments: Any) -> None:
        self._sent = 0
        self._told_before = self.told
        begun_s = time.perf_counter()
        event(*arguments)
        self.slowest_s = max(self.slowest_s, time.perf_counter() - begun_s)
        if self._sent > MAX_SENT_PER_INPUT:
            raise InvariantBrokenError(f"{self._sent} messages were sent for one input")
        if self.told - self._told_before > MAX_TOLD_PER_INPUT:
            raise InvariantBrokenError("a flood of notices for one input")

    def _hears(self, data: bytes) -> None:
        frames = self._ear.feed(data)
        if len(frames) != 1 or frames[0].raw != data:
            raise InvariantBrokenError(f"what was sent is not one frame: {data.hex()}")
        self._sent += 1
        message = codec.decode(frames[0])
        check_sent(frames[0], message)
        self.said.append(message)


def check_sent(frame: Frame, message: Any) -> None:
    """Every number that we send is one, and inside what it can mean."""
    for name, value in zip(message._fields, message, strict=True):
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and not math.isfinite(number):
                raise InvariantBrokenError(f"sent {type(message).__name__}.{name} = {number}")
    if not (1 <= frame.sysid <= 255 and 1 <= frame.compid <= 255):
        raise InvariantBrokenError(f"sent from {frame.sysid}/{frame.compid}")
    check = _CHECKS.get(frame.msg_id)
    if check is not None and not check(message):
        raise InvariantBrokenError(f"sent out of range: {message}")


def _is_attitude(m: Any) -> bool:
    turned = abs(m.roll) <= 3.1416 and abs(m.pitch) <= 1.5709 and abs(m.yaw) <= 3.1416
    return turned and max(abs(m.rollspeed), abs(m.pitchspeed), abs(m.yawspeed)) < FASTEST_RAD_S


def _is_quaternion(m: Any) -> bool:
    turned = abs(math.hypot(m.q1, m.q2, m.q3, m.q4) - 1.0) < 1e-3
    return turned and max(abs(m.rollspeed), abs(m.pitchspeed), abs(m.yawspeed)) < FASTEST_RAD_S


_CHECKS = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _is_attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _is_quaternion,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: lambda m: abs(math.hypot(*m.q) - 1.0) < 1e-3,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT: lambda m: m.text.isprintable() and m.text != "",
    mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL: lambda m: m.interval_us >= -1,
    mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: lambda m: 0 < m.req_message_rate <= 1000,
}


@functools.cache
def _filters(configuration: str) -> FilterFactory:
    chosen = CONFIGURATIONS[configuration]
    return FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)


def _bytes_held(root: Any, but: Any) -> int:
    """Bytes of all objects that can be reached, code and classes apart."""
    seen = {id(but)}
    total = 0
    waiting = [root]
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, (*WITHOUT_REFERENTS, Recorder)):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
    return total
