"""Flights of an autopilot's own log, without a filter's part in them."""

import numpy as np

from h2nav.calibration.evidence import Evidence
from h2nav.recordings.context import Context, ImuTrack
from h2nav.reviews.flight import EarthFields, Estimates, Flight, Ratios

NOTHING = np.zeros(0)


def level_attitude(seconds: float) -> Estimates:
    """Level and to the north, known to 0.2 deg."""
    t_s = np.arange(0.0, seconds, 0.02)
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (len(t_s), 1))
    sigma = np.full(len(t_s), 3.5e-3)
    return Estimates(t_s, q_nb, np.zeros((len(t_s), 3)), sigma, sigma)


def evidence_of_log(
    context: Context,
    parameters: dict[str, float],
    *,
    kind: str = "dataflash",
    free: Estimates | None = None,
) -> Evidence:
    """What was recorded, with these parameters in use."""
    flight = Flight(
        "flight", "flight.bin", kind, "", context, None, None, "", "IMU",
        Ratios(NOTHING, (), np.zeros((0, 0))), EarthFields(*[NOTHING] * 4),
        (), (), (), (), {},
    )  # fmt: skip
    return Evidence(flight, free or level_attitude(1.0), parameters)


def imu_track(
    w_b: np.ndarray,
    f_b: np.ndarray,
    *,
    rate_hz: float = 100.0,
    source: str = "IMU",
    device_ids: tuple[int, int] = (0, 0),
) -> ImuTrack:
    """Samples of the first IMU."""
    t_s = np.arange(len(w_b)) / rate_hz
    stamp_us = np.round(t_s * 1e6).astype(np.int64)
    field = np.full(w_b.shape, np.nan)
    return ImuTrack(0, source, t_s, stamp_us, w_b, f_b, field, device_ids)
