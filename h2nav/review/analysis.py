"""The findings that only a whole flight shows, and what they were read from."""

from typing import NamedTuple

from h2nav.integrity.findings import Finding
from h2nav.review.flight import Flight
from h2nav.review.tracks import (
    Bias,
    CompassFit,
    Field,
    Receiver,
    Spectrum,
    Timing,
    Vibration,
)


class Analysis(NamedTuple):
    """What `analyse` returns; the tracks are for pictures.

    Attributes:
        findings: of the whole flight only, in the order of their times. Those of the checks in
            flight stand in `Flight.findings`.
        spectra: gyro and accelerometer of each IMU.
        vibrations: one per IMU.
        fields: one per compass.
        compasses: one per compass that could be compared with the earth's field.
        biases: one per IMU.
        timings: one per IMU.
        receivers: one per receiver.
    """

    findings: tuple[Finding, ...] = ()
    spectra: tuple[Spectrum, ...] = ()
    vibrations: tuple[Vibration, ...] = ()
    fields: tuple[Field, ...] = ()
    compasses: tuple[CompassFit, ...] = ()
    biases: tuple[Bias, ...] = ()
    timings: tuple[Timing, ...] = ()
    receivers: tuple[Receiver, ...] = ()


def analyse(flight: Flight) -> Analysis:
    """Looks at a whole flight."""
    raise NotImplementedError(flight.name)
