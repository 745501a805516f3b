"""Trials made from recordings of an autopilot: what the service would have given to its filter.

The recording runs through the service with a filter that only listens, so message, times, checks,
velocities, vehicle state and earth field are those of the daemon. The truth is SIMSTATE, or, where
there is none, ATTITUDE, which is only another estimate; both against true north.
"""

import dataclasses
import time
from pathlib import Path

import numpy as np

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import vehicle_class
from h2nav.apps.log_contents import inputs_of
from h2nav.apps.pipeline import deliver
from h2nav.apps.reference import Pairs, Reference, quaternions
from h2nav.attitude.filter import FilterState
from h2nav.attitude.samples import EarthField, ImuSample, VehicleState, VelocityFix
from h2nav.errors import BadInput
from h2nav.io.deframer import Deframer
from h2nav.io.earth_field import earth_field_at
from h2nav.io.recordings import Recording, open_recording
from h2nav.io.trials import RECORDING_SUFFIXES, SUFFIX, Array, Told, Trial, usual_rate_hz
from h2nav.maths import frames
from h2nav.service.autopilot import Identity
from h2nav.service.service import Service, Surroundings

LEAST_SAMPLES = 2


class Stretch:
    """Samples between two restarts of the filter, and what else it was given between them."""

    def __init__(self) -> None:
        self.samples: list[ImuSample] = []
        self.arrived_us: list[int] = []
        self.told: list[Told] = []


class Listener:
    """Takes the place of a filter in the service, and keeps everything that it is given.

    Attributes:
        name: as filters have one.
        now_us: time of arrival of the message under way.
        stretches: so far; the last one is being filled.
        identity: of the autopilot, once it is known.
    """

    def __init__(self) -> None:
        self.name = "listener"
        self.now_us = 0
        self.stretches = [Stretch()]
        self.identity: Identity | None = None
        self._vehicle: VehicleState | None = None
        self._field: EarthField | None = None

    def filter_for(self, identity: Identity) -> "Listener":
        """Makes the filter of a vehicle."""
        self.identity = identity
        self.restart()
        return self

    def update(self, sample: ImuSample) -> None:
        """Keeps a sample."""
        self.stretches[-1].samples.append(sample)
        self.stretches[-1].arrived_us.append(self.now_us)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Keeps the vehicle's state."""
        self._vehicle = vehicle
        self._keep(vehicle)

    def use_field(self, field: EarthField) -> None:
        """Keeps the earth field."""
        self._field = field
        self._keep(field)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Keeps a velocity."""
        self._keep(fix)

    def restart(self) -> None:
        """Begins a stretch, in which the last state and field still hold."""
        if self.stretches[-1].samples:
            self.stretches.append(Stretch())
            for what in (self._vehicle, self._field):
                if what is not None:
                    self._keep(what)

    def state(self) -> FilterState:
        """It computes nothing, so nothing has to be continued."""
        return FilterState(self.name, ())

    def restore(self, state: FilterState) -> None:
        """See `state`."""

    def _keep(self, what: VehicleState | EarthField | VelocityFix) -> None:
        stretch = self.stretches[-1]
        stretch.told.append(Told(len(stretch.samples), what))


def read_recorded_trial(path: Path) -> Trial:
    """The trial of a telemetry log, of raw bytes or of our MCAP.

    Raises:
        BadInput: it is no recording, or holds no samples.
    """
    try:
        recording = open_recording(path)
    except BadInput:
        if path.suffix in RECORDING_SUFFIXES or not path.exists():
            raise
        raise BadInput(
            f"{path}: no trial; expected an {SUFFIX} file or a recording "
            "(.tlog, our .mcap, raw MAVLink bytes)"
        ) from None
    listener, reference = Listener(), Reference()
    service = _listen(recording, listener, reference)
    stretch = max(listener.stretches, key=lambda found: len(found.samples))
    if len(stretch.samples) < LEAST_SAMPLES or listener.identity is None:
        raise BadInput(f"{path}: no IMU samples of a known autopilot in it")
    boot_us = np.array([sample.t_us for sample in stretch.samples])
    pairs = reference.pairs(np.array(stretch.arrived_us), boot_us)
    notes = (
        f"{listener.identity.description}, {service.health.imu_message}; its class is "
        f"{vehicle_class(listener.identity.vehicle_type)}",
        *_notes(listener, stretch, pairs),
    )
    return _trial(path.stem, stretch, pairs, boot_us)._replace(notes=notes)


def _listen(recording: Recording, listener: Listener, reference: Reference) -> Service:
    """Sends the whole recording through the service."""
    recorded = inputs_of(recording)
    settings = (recorded.configuration if recorded else Configuration()).service
    settings = dataclasses.replace(
        settings,
        autopilot=dataclasses.replace(settings.autopilot, request_streams=False),
        aiding=dataclasses.replace(settings.aiding, gps_velocity=True, autopilot_velocity=False),
    )
    if recorded is not None:
        unix_s = recorded.unix_s
    else:
        unix_s = time.time() if recording.times_are_synthetic else recording.unix_start_ns * 1e-9
    service = Service(settings, Surroundings(listener.filter_for, earth_field_at, unix_s))
    deframer, wanted = Deframer(), service.message_ids
    for t_ns, data in recording.received():
        listener.now_us = t_ns // 1000
        for frame in deframer.feed(data):
            if frame.msg_id in reference.message_ids:
                reference.frame(t_ns, frame)
            if frame.msg_id in wanted:
                deliver(service, frame, t_ns, t_ns)
    return service


def _trial(
    name: str, stretch: Stretch, pairs: Pairs, boot_us: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> Trial:
    samples, start_us = stretch.samples, int(boot_us[0])
    unknown = (np.nan, np.nan, np.nan)
    fields = np.array([sample.m_b_ut or unknown for sample in samples])
    clipped = np.array([sample.clipped for sample in samples])
    q_es = np.full((len(samples), 4), np.nan)
    q_es[pairs.rows] = _enu(quaternions(pairs.angles))
    known = [told.what for told in stretch.told if isinstance(told.what, EarthField)]
    return Trial(
        name=name,
        rate_hz=usual_rate_hz(boot_us),
        t_us=boot_us - start_us,
        w_s=np.array([sample.w_b for sample in samples]),
        f_s=np.array([sample.f_b for sample in samples]),
        m_s=None if np.isnan(fields).all() else fields,
        q_es=q_es if len(pairs.rows) else None,
        mask=np.isfinite(q_es[:, 0]),
        heading_fixed=True,
        gps=None,
        clipped=clipped if clipped.any() else None,
        told=tuple(_on_clock_of_trial(told, start_us) for told in stretch.told),
        declination_rad=known[-1].declination_rad if known else 0.0,
    )


def _on_clock_of_trial(told: Told, start_us: int) -> Told:
    if isinstance(told.what, VelocityFix):
        return told._replace(what=told.what._replace(t_us=told.what.t_us - start_us))
    return told


def _enu(q_nb: Array) -> Array:
    rows = [frames.attitude_enu_from_ned((w, x, y, z)) for w, x, y, z in q_nb.tolist()]
    return np.array(rows).reshape(-1, 4)


def _notes(listener: Listener, stretch: Stretch, pairs: Pairs) -> list[str]:
    """What limits the meaning of the trial's errors."""
    notes = [f"against {pairs.reference}"] if pairs.reference else []
    if pairs.reference == "ATTITUDE":
        notes = ["against ATTITUDE, the autopilot's own estimate: no truth"]
    if not any(isinstance(told.what, EarthField) for told in stretch.told):
        notes.append("no position, so no declination: our headings are against magnetic north")
    used = [len(found.samples) for found in listener.stretches if found.samples]
    if len(used) > 1:
        notes.append(
            f"the autopilot's clock began anew {len(used) - 1} times; the longest stretch, "
            f"{len(stretch.samples)} of {sum(used)} samples, is scored"
        )
    return notes
