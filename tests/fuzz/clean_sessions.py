"""What an honest autopilot says, recorded once from the simulator and then played without end."""

import dataclasses
import functools
from typing import NamedTuple

from motion_flights import CAMERA
from simulated_flight import SIMULATED, START_NS, SimulatedFlight

from fuzz.raw_frames import RawFrame, place
from h2nav.apps.configuration import Configuration, FilterSettings
from h2nav.service.settings import AidingSettings, MotionSettings, OutputSettings
from h2nav.sim.vision_streams import vision_stream
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS

RECORDED_S = 12.0
TIME_FIELDS = (("time_usec", 1), ("time_boot_ms", 1000), ("usec", 1))
OPEN_TO_CHANGES = OutputSettings(allow_remote_changes=True)
FILTERS = {
    "default-float": FilterSettings("default", "float"),
    "default-fixed": FilterSettings("default", "fixed"),
    # as the corpus names them, from when there was a filter of that name
    "two_stage-float": FilterSettings(),
    "two_stage-fixed": FilterSettings("constant_gain", "fixed"),
}
CONFIGURATIONS: dict[str, Configuration] = {
    f"{name}-{estimator}": dataclasses.replace(
        SIMULATED,
        filter=filter_,
        motion=MotionSettings(estimator),
        output=OPEN_TO_CHANGES if estimator == "twist" else OutputSettings(),
        aiding=AidingSettings(autopilot_velocity=estimator == "wheels"),
    )
    for name, filter_ in FILTERS.items()
    for estimator in ("twist", "wheels")
}
"""Every filter with every motion estimator."""


class Played(NamedTuple):
    """A frame of the recording.

    Attributes:
        t_ns: after the start of the recording.
        frame: as it was sent.
    """

    t_ns: int
    frame: RawFrame


@functools.cache
def recording(estimator: str) -> tuple[Played, ...]:
    """The frames that the simulated autopilot sends to a service with this motion estimator."""
    scenario, streams = ("hover", (vision_stream(CAMERA, 3),))
    if estimator == "wheels":
        scenario, streams = "figure-eight", ()
    configuration = dataclasses.replace(SIMULATED, motion=MotionSettings(estimator))
    flight = SimulatedFlight(scenario, configuration=configuration, extra_streams=streams)
    ear = Deframer()
    heard: list[Played] = []
    receive = flight.pipeline.received

    def listen(t_ns: int, data: bytes) -> None:
        for frame in ear.feed(data):
            payload = frame.payload.ljust(LAYOUTS[frame.msg_id].size, b"\0")
            raw = RawFrame(frame.msg_id, frame.sysid, frame.compid, payload)
            heard.append(Played(t_ns - START_NS, raw))
        receive(t_ns, data)

    flight.pipeline.received = listen  # type: ignore[method-assign]
    flight.run(RECORDED_S)
    return tuple(heard)


class Player:
    """Plays a recording again and again, its time stamps on one clock that goes with the host's.

    Args:
        estimator: whose recording.
        t_ns: host time of its beginning.
    """

    def __init__(self, estimator: str, t_ns: int) -> None:
        self._frames = recording(estimator)
        self._length_ns = round(RECORDED_S * 1e9)
        self._origin_ns = t_ns
        self._begun_ns = t_ns
        self._next = 0

    def next(self) -> tuple[int, RawFrame]:
        """Host time and frame of what comes next."""
        if self._next == len(self._frames):
            self._next = 0
            self._begun_ns += self._length_ns
        t_ns, frame = self._frames[self._next]
        self._next += 1
        shift_us = (self._begun_ns - self._origin_ns) // 1000
        return self._begun_ns + t_ns, restamped(frame, shift_us)

    def wait(self, pause_ns: int) -> None:
        """Nothing is heard for a while; the clocks go on."""
        self._begun_ns += pause_ns


def restamped(frame: RawFrame, shift_us: int) -> RawFrame:
    """The frame with its time stamps later by `shift_us`, modulo their width."""
    for name, unit_us in TIME_FIELDS:
        if shift_us and name in LAYOUTS[frame.msg_id].field_names:
            field = place(frame.msg_id, name)
            width = 4 if field.type_name == "uint32_t" else 8
            old = int.from_bytes(frame.payload[field.offset : field.offset + width], "little")
            return frame.where(field, (old + shift_us // unit_us) % (1 << 8 * width))
    return frame
