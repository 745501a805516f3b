"""Plays recorded flights through the service for `h2nav evaluate flights`."""

from pathlib import Path

from h2nav.apps.playback import Playback, PlaybackOptions, fusing_gps, inputs_for, pipeline_for
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardFlight
from h2nav.recordings.recording import open_recording

# Our estimators by name: whether the GPS velocity is fused. The first one records the autopilot.
ESTIMATORS = {"h2nav": True, "h2nav_no_gps": False}


def play(path: Path, options: PlaybackOptions) -> HeardFlight:
    """Plays a recording through one service per estimator, in one pass over the file.

    Raises:
        BadInput: the recording or the configuration cannot be used.
    """
    recording = open_recording(path)
    inputs = inputs_for(recording, options)
    autopilot = FromAutopilot(inputs.configuration.autopilot.system_id)
    runs, pipelines = {}, []
    for number, (name, fuses_gps) in enumerate(ESTIMATORS.items()):
        runs[name] = FromService(autopilot, listens=number == 0)
        own = inputs._replace(configuration=fusing_gps(inputs.configuration, fuses_gps))
        pipelines.append(pipeline_for(recording, own, None, runs[name]))
    playback = Playback(recording, whole_frames=inputs.whole_frames)
    for t_ns in playback.through(*pipelines):
        autopilot.time(t_ns)
    for run, pipeline in zip(runs.values(), pipelines, strict=True):
        run.end(pipeline.service.state_s)
    return HeardFlight(autopilot, runs)
