"""Flights of recordings, played through the service for `h2nav evaluate flights`."""

from pathlib import Path

from h2nav.apps.playback import Playback, Wishes, fusing_gps, inputs_for, pipeline_for
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardFlight
from h2nav.io.recordings import open_recording

# Ours, by name: fuses the GPS velocity. The first one hears what the autopilot says.
ESTIMATORS = {"h2nav": True, "h2nav_no_gps": False}
STATE_EVERY_NS = 100_000_000


def play(path: Path, wished: Wishes) -> HeardFlight:
    """Plays a recording through one service per estimator, in one pass over the file.

    Args:
        path: the recording.
        wished: configuration, filter and vehicle class.

    Raises:
        BadInput: the recording or the configuration cannot be used.
    """
    recording = open_recording(path)
    inputs = inputs_for(recording, wished)
    autopilot = FromAutopilot()
    runs, pipelines = {}, []
    for number, (name, fuses_gps) in enumerate(ESTIMATORS.items()):
        runs[name] = FromService(autopilot, listens=number == 0)
        own = inputs._replace(configuration=fusing_gps(inputs.configuration, fuses_gps))
        pipelines.append(pipeline_for(recording, own, None, runs[name]))
    playback = Playback(recording, whole_frames=inputs.whole_frames)
    next_ns = t_ns = 0
    for t_ns in playback.through(*pipelines):
        autopilot.time(t_ns)
        if t_ns >= next_ns:
            next_ns = t_ns + STATE_EVERY_NS
            for run, pipeline in zip(runs.values(), pipelines, strict=True):
                run.state(t_ns, pipeline.service.health.state)
    for run, pipeline in zip(runs.values(), pipelines, strict=True):
        run.state(t_ns, pipeline.service.health.state)
    return HeardFlight(autopilot, runs)
