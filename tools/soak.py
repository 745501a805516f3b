"""Flies for simulated hours through the whole pipeline with its log: does anything grow?

A vehicle at rest sends RAW_IMU whose 32-bit microseconds wrap after 5 minutes and then every 71.6,
with all that goes with it; strangers, questions and reboots come by. Memory, blocks of Python's
allocator and descriptors are counted after the first tenth and at the end.

Run: python tools/soak.py [--hours H] [--rate-hz R] [--json]; status 1 where something grew, or
where a sample was lost.
"""

import argparse
import gc
import json
import os
import random
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import Configuration, LogSettings
from h2nav.apps.filters import FilterFactory
from h2nav.apps.log_contents import open_recorder
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.log.recorder import Recorder
from h2nav.maths.units import SECOND_NS
from h2nav.service.service import Service, Surroundings
from h2nav.service.settings import AutopilotSettings
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame

UNIX_S = 1_795_000_000
START_NS = 1_000 * SECOND_NS
CLOCK = 1 << 32
WRAP_AFTER_S = 300
STRANGER_S = 600
REBOOT_S = 5 * 3600
READINGS = 997
WARM_UP_SHARE = 0.1
LOG_FILE_MB = 8
LOG_FILES = 3
DRAINED_S = 0.1
DESCRIPTOR_LOOKS = 10
# The index of the present log file grows until the next file, and caches breathe. A leak of one
# block a second would be 78,000 blocks in a day, one a sample twenty times as many.
MAX_GROWN_BLOCKS = 15_000
MAX_GROWN_MIB = 16.0
KIB_PER_MIB = 1024.0
STATION = (255, 190)


class Sizes(NamedTuple):
    """What may grow.

    Attributes:
        rss_mib: resident memory.
        blocks: of Python's allocator.
        descriptors: open files.
    """

    rss_mib: float
    blocks: int
    descriptors: int


class Vehicle:
    """An autopilot at rest and the pipeline that listens to it, on one simulated clock.

    Args:
        rate_hz: of RAW_IMU.
        recorder: the log.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, rate_hz: float, recorder: Recorder | None) -> None:
        chosen = Configuration(autopilot=AutopilotSettings(imu_rate_hz=rate_hz))
        filters = FilterFactory.shipped(chosen.filter, rate_hz)
        service = Service(
            chosen.service, Surroundings(filters.filter_for, earth_field_at, float(UNIX_S))
        )
        self._unix_offset_ns = UNIX_S * SECOND_NS - START_NS
        outlets = Outlets(self._unix_ns, self._hears, recorder, self)
        self.pipeline = Pipeline(service, chosen.output.component_id, outlets)
        self.t_ns = START_NS
        self.sent = 0
        self.notices = 0
        self.estimates = 0
        self._booted_ns = START_NS + (WRAP_AFTER_S * SECOND_NS - CLOCK * 1000)
        self._period_ns = round(SECOND_NS / rate_hz)
        self._per_second = round(rate_hz)
        self._encoder = codec.Encoder(1, 1)
        self._usual = [self._encoder.encode(message) for message in _usual_messages()]
        question = mavlink.MAVLink_param_request_list_message(1, 191)
        self._question = codec.Encoder(*STATION).encode(question)
        self._back = Deframer()
        self._answers: list[Any] = []
        noise = random.Random(1)
        self._readings = [
            tuple(
                round(mean + noise.gauss(0.0, 2.0))
                for mean in (0, 0, -1000, 0, 0, 0, 224, 80, -528)
            )
            for _ in range(READINGS)
        ]

    def fly(self, second: int) -> None:
        """One more second."""
        self._say_what_comes_each_second(second)
        for _ in range(self._per_second):
            self.t_ns += self._period_ns
            reading = self._readings[self.sent % READINGS]
            self.sent += 1
            stamp_us = self._clock_us() % CLOCK
            self._say(mavlink.MAVLink_raw_imu_message(stamp_us, *reading, 0, 2500))
            if self.t_ns >= self.pipeline.next_timer_ns:
                self.pipeline.tick(self.t_ns)
            while self._answers:
                self._say(self._answers.pop())
        self.pipeline.report(self.t_ns, LinkStatistics())

    def _say_what_comes_each_second(self, second: int) -> None:
        unix_us = self._unix_ns(self.t_ns) // 1000
        boot_ms = self._clock_us() // 1000 % CLOCK
        self._say(mavlink.MAVLink_system_time_message(unix_us, boot_ms))
        for frame in self._usual:
            self.pipeline.received(self.t_ns, frame)
        if second % STRANGER_S == STRANGER_S - 1:
            number = second // STRANGER_S
            stranger = codec.Encoder(2 + number // 250 % 250, 1 + number % 250)
            self.pipeline.received(self.t_ns, stranger.encode(_heartbeat()))
            self.pipeline.received(self.t_ns, self._question)
        if second % REBOOT_S == REBOOT_S - 1:
            self._booted_ns = self.t_ns

    def _clock_us(self) -> int:
        return (self.t_ns - self._booted_ns) // 1000

    def _say(self, message: Any) -> None:
        self.pipeline.received(self.t_ns, self._encoder.encode(message))

    def _hears(self, data: bytes) -> None:
        for frame in self._back.feed(data):
            if frame.msg_id == mavlink.MAVLINK_MSG_ID_TIMESYNC:
                asked = codec.decode(frame)
                if asked.tc1 == 0:
                    clock_ns = self._clock_us() * 1000
                    self._answers.append(mavlink.MAVLink_timesync_message(clock_ns, asked.ts1))
            elif frame.msg_id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
                command = codec.decode(frame).command
                self._answers.append(mavlink.MAVLink_command_ack_message(command, 0))

    def _unix_ns(self, t_ns: int) -> int:
        return t_ns + self._unix_offset_ns

    # --- the watcher's side -------------------------------------------------------------------

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not looked at."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Counts."""
        self.estimates += 1

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Counts."""
        self.notices += 1


def _heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)


def _usual_messages() -> list[Any]:
    """What comes each second besides the IMU and the time."""
    fix = (473_977_000, 85_456_000, 500_000, 100, 100, 0, 0, 12)
    return [
        _heartbeat(),
        mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND),
        *[mavlink.MAVLink_gps_raw_int_message(0, 3, *fix)] * 5,
        *[mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 0, 500.0, 0.0)] * 4,
    ]


def sizes(recorder: Recorder) -> Sizes:
    """Measured when the recorder has written what it was given.

    A file and its folder are open for a moment where one log ends and the next begins, so the
    descriptors are the fewest of some looks: what leaks is in all of them.
    """
    written = -1
    while written != (written := recorder.statistics().written):
        time.sleep(DRAINED_S)
    gc.collect()
    found = re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())
    assert found is not None
    memory = int(found[1]) / KIB_PER_MIB, sys.getallocatedblocks()
    return Sizes(*memory, min(_descriptors_now_and_then()))


def _descriptors_now_and_then() -> Iterator[int]:
    for _ in range(DESCRIPTOR_LOOKS):
        yield len(os.listdir("/proc/self/fd"))
        time.sleep(DRAINED_S)


def soak(hours: float, rate_hz: float, folder: Path) -> dict[str, Any]:
    """Flies; what was found."""
    settings = LogSettings(str(folder), max_file_mb=LOG_FILE_MB, max_files=LOG_FILES, min_free_mb=0)
    recorder = open_recorder(settings, 0)
    assert recorder is not None
    vehicle = Vehicle(rate_hz, recorder)
    vehicle.pipeline.link(vehicle.t_ns, True)
    seconds = round(hours * 3600)
    warm_s = max(round(WARM_UP_SHARE * seconds), 1)
    start_s = time.monotonic()
    for second in range(warm_s):
        vehicle.fly(second)
    first = sizes(recorder)
    for second in range(warm_s, seconds):
        vehicle.fly(second)
    last = sizes(recorder)
    took_s = time.monotonic() - start_s
    health = vehicle.pipeline.service.health
    rejected = vehicle.pipeline.service.rejected
    recorder.close()
    return {
        "hours": hours,
        "times_real_time": seconds / took_s,
        "samples_sent": vehicle.sent,
        "samples_used": health.samples_used,
        "rejected": rejected,
        "estimates": vehicle.estimates,
        "notices": vehicle.notices,
        "state": health.state,
        "after_a_tenth": first._asdict(),
        "at_the_end": last._asdict(),
        "complaints": complaints(vehicle.sent - health.samples_used, seconds, first, last),
    }


def complaints(lost: int, seconds: int, first: Sizes, last: Sizes) -> list[str]:
    """What is not as it should be."""
    found = []
    # Binding takes a few seconds, each reboot a few samples.
    if lost > 1000 + 10 * (seconds // REBOOT_S):
        found.append(f"{lost} samples were not used")
    if last.rss_mib - first.rss_mib > MAX_GROWN_MIB:
        found.append(f"memory grew by {last.rss_mib - first.rss_mib:.1f} MiB")
    if last.blocks - first.blocks > MAX_GROWN_BLOCKS:
        found.append(f"Python holds {last.blocks - first.blocks} more blocks")
    if last.descriptors > first.descriptors:
        found.append(f"{last.descriptors - first.descriptors} more descriptors are open")
    return found


def main() -> int:
    """Soaks and says what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rate-hz", type=float, default=50.0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="h2nav-soak-") as folder:
        found = soak(args.hours, args.rate_hz, Path(folder))
    if args.json:
        print(json.dumps(found))
    else:
        for name, value in found.items():
            print(f"{name.replace('_', ' ')}: {value}")
    return 1 if found["complaints"] else 0


if __name__ == "__main__":
    sys.exit(main())
