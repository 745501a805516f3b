"""Flies the draws of a campaign through the service, for `h2nav evaluate campaign`."""

import dataclasses
import math
import socket
import time
from array import array
from typing import Any

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.attitude.samples import AttitudeEstimate, EarthField
from h2nav.errors import BadInput
from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.flight import HOST_NS, UNIX_S, events, place_of, simulated
from h2nav.evaluation.campaign.scores import HeardDraw, score
from h2nav.files.earth_field import earth_field_at
from h2nav.fleet.program import program_digest
from h2nav.integrity.findings import Finding, Phase, Severity
from h2nav.service.service import Service, Surroundings
from h2nav.wire.deframer import Frame

# The truth is compared this often; errors last for longer.
STEP_NS = 100_000_000


class _Listener:
    """A watcher of the pipeline: some estimates, and when each finding was first reported."""

    message_ids: frozenset[int] = frozenset()

    def __init__(self) -> None:
        self.t_us, self.rows = array("q"), array("d")
        self.told_s: dict[str, float] = {}
        self._next_ns = 0

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not passed."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Stores an estimate now and then."""
        if t_ns < self._next_ns:
            return
        self._next_ns = t_ns - t_ns % STEP_NS + STEP_NS
        self.t_us.append(estimate.t_us)
        sigmas = (estimate.sigma_tilt_rad, estimate.sigma_heading_rad)
        self.rows.extend((*estimate.q_nb, *map(math.degrees, sigmas)))

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Findings say more."""

    def finding(self, t_ns: int, phase: Phase, finding: Finding) -> None:
        """Stores when a finding of a warning or worse was first reported."""
        if finding.severity <= Severity.WARNING:
            self.told_s.setdefault(finding.id, 1e-9 * (t_ns - HOST_NS))


def fly(draw: Draw) -> dict[str, Any]:
    """Simulates a draw, plays it through the daemon's service, and scores it."""
    started_s = time.process_time()
    chosen = Configuration()
    flight = simulated(draw, _field(draw))
    listener = _Listener()
    filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    settings = chosen.service
    # As in a replay, nothing answers.
    asks_nobody = dataclasses.replace(settings.autopilot, request_streams=False)
    service = Service(
        dataclasses.replace(settings, autopilot=asks_nobody),
        Surroundings(filters.filter_for, earth_field_at, UNIX_S, has_listener=False),
    )
    outlets = Outlets(lambda t_ns: t_ns, None, None, listener, finding=listener.finding)
    pipeline = Pipeline(service, chosen.output.component_id, outlets)
    pipeline.link(HOST_NS, True)
    for envelope, message in events(flight):
        pipeline.imported(envelope, message)
    heard = HeardDraw(
        listener.t_us,
        listener.rows,
        service.findings,
        listener.told_s,
        sum(count for key, count in service.rejected.items() if key.startswith("handler_error")),
        time.process_time() - started_s,
    )
    return score(flight, heard)


def fly_by(program: str, draw: Draw) -> dict[str, Any]:
    """The same on a cluster's worker, if it has this program (`program_digest`).

    Raises:
        BadInput: it has another one.
    """
    if program_digest() != program:
        raise BadInput(f"{socket.gethostname()}: another h2nav than here; install the same one")
    return fly(draw)


def _field(draw: Draw) -> EarthField:
    field = earth_field_at(*place_of(draw), UNIX_S)
    if field is None:
        raise BadInput(f"flight.latitude_deg: {draw.flight.latitude_deg:g}: no declination there")
    return field
