"""Reads trials from `.npz` files or from recordings, which are played through the service."""

import dataclasses
from pathlib import Path
from typing import NamedTuple

from h2nav.apps.configuration import Configuration
from h2nav.apps.log_contents import inputs_of
from h2nav.apps.pipeline import deliver
from h2nav.apps.playback import date_of
from h2nav.errors import BadInput
from h2nav.evaluation.dataset.recorded import trial_of
from h2nav.files.earth_field import earth_field_at
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.listener import Listener
from h2nav.recordings.recording import open_recording
from h2nav.recordings.reference import Reference
from h2nav.recordings.trials import RECORDING_SUFFIXES, SUFFIX, Trial, read_trial
from h2nav.service.service import Service, Surroundings
from h2nav.wire.deframer import Deframer


class ReadTrial(NamedTuple):
    """A trial, and its vehicle class, empty if unknown."""

    trial: Trial
    vehicle_class: str


def read(path: Path) -> Trial:
    """Reads the trial of an `.npz`, a telemetry log, raw bytes or an MCAP of h2nav.

    Raises:
        BadInput: another kind of file, or no samples.
    """
    return read_with_class(path).trial


def read_with_class(path: Path) -> ReadTrial:
    """Reads the trial of a file and the class of its vehicle; see `read`."""
    if path.suffix == SUFFIX:
        return ReadTrial(read_trial(path), "")
    try:
        recording = open_recording(path)
    except BadInput:
        if path.suffix in RECORDING_SUFFIXES or not path.exists():
            raise
        raise BadInput(
            f"{path}: not a trial; expected an {SUFFIX} file or a recording "
            "(.tlog, our .mcap, raw MAVLink bytes)"
        ) from None
    listener, reference = Listener(), Reference()
    service = _listen(recording, listener, reference)
    trial = trial_of(path, listener, reference)
    assert listener.identity is not None  # samples come from a bound autopilot only
    flown = listener.identity.vehicle_class
    about = f"{listener.identity.description}, {service.health.imu_message}; its class is {flown}"
    return ReadTrial(trial._replace(notes=(about, *trial.notes)), flown)


def _listen(recording: Recording, listener: Listener, reference: Reference) -> Service:
    """Plays the whole recording through the service."""
    recorded = inputs_of(recording)
    settings = (recorded.configuration if recorded else Configuration()).service
    settings = dataclasses.replace(
        settings,
        autopilot=dataclasses.replace(settings.autopilot, request_streams=False),
        aiding=dataclasses.replace(settings.aiding, gps_velocity=True, autopilot_velocity=False),
    )
    unix_s = date_of(recording, recorded)
    service = Service(settings, Surroundings(listener.filter_for, earth_field_at, unix_s))
    deframer, wanted = Deframer(), service.message_ids
    for t_ns, data in recording.received():
        listener.arrives(t_ns)
        for frame in deframer.feed(data):
            if frame.msg_id in reference.message_ids:
                reference.frame(t_ns, frame)
            if frame.msg_id in wanted:
                deliver(service, frame, t_ns, t_ns)
    return service
