"""What a calibration rests on: a flight, and an attitude that no compass has had a part in."""

from typing import NamedTuple

import numpy as np

from h2nav.recordings.context import Array, CompassTrack, Context, Series
from h2nav.recordings.dataflash import Trim
from h2nav.reviews.flight import Estimates, Flight
from h2nav.reviews.inertial import Attitudes, Mask, attitudes, within

PX4, ARDUPILOT = "PX4", "ArduPilot"


class Evidence(NamedTuple):
    """One flight.

    Attributes:
        flight: as it was played and reviewed.
        free: the smoothed attitude of gyro, gravity and the receiver's velocity alone.
        parameters: of the autopilot: the recording's, or those that somebody brought.
    """

    flight: Flight
    free: Estimates
    parameters: dict[str, float]

    @property
    def context(self) -> Context:
        """What was recorded."""
        return self.flight.context

    @property
    def autopilot(self) -> str:
        """Its make."""
        says = f"{self.flight.autopilot} {self.context.firmware}"
        return PX4 if "PX4" in says or self.flight.kind == "ulog" else ARDUPILOT

    @property
    def is_log(self) -> bool:
        """Whether the autopilot wrote it itself, with every fix when it came."""
        return self.flight.kind in ("dataflash", "ulog")

    @property
    def trim(self) -> Trim:
        """From the axes of the board, in which compasses are calibrated, to those of the body.

        What a dataflash log has of the board was turned when it was read; telemetry was not.
        """
        return Trim(self.parameters if self.flight.kind == "dataflash" else {})

    def attitude(self) -> Attitudes:
        """Of the board, to NED; where the deviation of the heading is not known, it is infinite."""
        track = self.attitude_of_tracks()
        return track._replace(q_nb=self.trim.of_board(track.q_nb))

    def attitude_of_tracks(self) -> Attitudes:
        """The same in the axes in which rates and forces were read."""
        free = self.free
        return attitudes(free.t_s, free.q_nb)._replace(
            sigma_tilt_rad=_finite(free.sigma_tilt_rad),
            sigma_heading_rad=_finite(free.sigma_heading_rad),
        )

    def compasses(self) -> tuple[CompassTrack, ...]:
        """In the axes of the board, as they are calibrated by the autopilot, if at all."""
        if self.context.compasses:
            return self.context.compasses
        found = []
        for track in self.context.imus:
            good = np.isfinite(track.m_b_ut).all(axis=1)
            if good.any():
                field = track.m_b_ut[good].astype(float)
                unknown = np.full(field.shape, np.nan)
                found.append(CompassTrack(track.imu, 0, track.t_s[good], field, unknown, unknown))
        return tuple(found)

    def is_raw(self, compass: int) -> bool:
        """Whether the fields are without any calibration: PX4's SCALED_IMU is."""
        sources = {track.imu: track.source for track in self.context.imus}
        is_message = not self.context.compasses
        return is_message and self.autopilot == PX4 and "SCALED" in sources.get(compass, "")

    def flying(self, t_s: Array) -> Mask:
        """While the motors could turn; everything where nothing says when that was."""
        armed = self.context.armed
        return within(t_s, armed) if armed else np.ones(len(t_s), dtype=bool)


def series_at(series: Series | None, t_s: Array) -> Array:
    """(N,) values between those that were recorded; NaN beyond them, or without any."""
    if series is None:
        return np.full(len(t_s), np.nan)
    good = np.isfinite(series.values)
    if good.sum() < 2:
        return np.full(len(t_s), np.nan)
    values: Array = np.interp(t_s, series.t_s[good], series.values[good], left=np.nan, right=np.nan)
    return values


def _finite(sigma: Array) -> Array:
    return np.where(np.isfinite(sigma), sigma, np.inf)
