"""What a sample costs, held by counts that do not vary with the machine.

A count of calls is the same in every run of one version of Python; versions differ by a few
percent, because some inline what others call. `python tools/bench_speed.py` measures times.
"""

import inspect
import sys
from types import FrameType

from h2nav.apps import playback
from h2nav.apps.pipeline import Pipeline
from h2nav.apps.playback import Playback, PlaybackOptions
from h2nav.attitude.native import backend
from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.integrity.findings import Severity
from h2nav.recordings.listener import Listener
from h2nav.recordings.recording import open_recording
from h2nav.service.lane import FilterFor
from h2nav.wire.deframer import Frame
from tests.needs import REPOSITORY, absent

FLIGHT = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
# Calls of Python functions per sample, everything on its way and beside it included, with CPython
# 3.11 and 5 % for others.
MAX_CALLS = 170.0
MAX_FRAMES = 8
REMEDY = (
    "look with `python -m cProfile` at `h2nav replay --no-log` for what could be done per second, "
    "per fix or once per message id; raise the bound only together with what that buys"
)


class Nobody:
    """Looks on and sees nothing."""

    message_ids: frozenset[int] = frozenset()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not looked at."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Estimates are not looked at."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Notices are not looked at."""


def played(filter_for: FilterFor | None = None) -> tuple[Pipeline, Playback]:
    """A pipeline, and the flight that is to be played through it."""
    recording = open_recording(FLIGHT)
    inputs = playback.inputs_for(recording, PlaybackOptions())
    pipeline = playback.pipeline_for(recording, inputs, None, Nobody(), filter_for)
    return pipeline, Playback(recording, whole_frames=inputs.whole_frames)


def test_a_sample_costs_no_more_calls_than_it_did() -> None:
    if backend() != "native":
        absent("the compiled kernels are not built")
    pipeline, playing = played()
    calls = samples = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"

    for _ in playing.through(pipeline):  # caches are filled by a first flight
        pass
    pipeline, playing = played()
    sys.setprofile(count)
    try:
        for _ in playing.through(pipeline):
            pass
    finally:
        sys.setprofile(None)
    samples = pipeline.service.health.samples_used
    assert samples > 3_000
    per_sample = calls / samples
    assert per_sample < MAX_CALLS, (
        f"{per_sample:.1f} calls per sample that is sent, at most {MAX_CALLS}: {REMEDY}"
    )


class Deep(Listener):
    """Counts the frames from the pipeline to the filter."""

    def __init__(self) -> None:
        super().__init__()
        self.depths: set[int] = set()

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Counts them."""
        frame, depth = inspect.currentframe(), 0
        while frame is not None and frame.f_code is not Pipeline.play.__code__:
            frame, depth = frame.f_back, depth + 1
        self.depths.add(depth)
        return None


def test_few_frames_lie_between_the_pipeline_and_the_filter() -> None:
    deep = Deep()
    pipeline, playing = played(deep.filter_for)
    for _ in playing.through(pipeline):
        pass
    assert deep.depths
    assert max(deep.depths) <= MAX_FRAMES, REMEDY
