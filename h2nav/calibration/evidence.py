"""The evidence for a calibration: a flight, and an attitude independent of any compass."""

from typing import NamedTuple

import numpy as np

from h2nav.recordings.board_trim import Trim
from h2nav.recordings.context import Array, CompassTrack, Context, GpsTrack, Series
from h2nav.reviews.flight import Estimates, Flight
from h2nav.reviews.inertial import Attitudes, Mask, attitudes, within

PX4, ARDUPILOT = "PX4", "ArduPilot"


class Evidence(NamedTuple):
    """One flight."""

    flight: Flight  # as played and reviewed
    free: Estimates  # the smoothed attitude of gyro, gravity and the receiver's velocity alone
    parameters: dict[str, float]  # of the autopilot: the recording's, or those given by the user

    @property
    def context(self) -> Context:
        """The recording."""
        return self.flight.context

    @property
    def autopilot(self) -> str:
        """Its make."""
        says = f"{self.flight.autopilot} {self.context.firmware}"
        return PX4 if "PX4" in says or self.flight.kind == "ulog" else ARDUPILOT

    @property
    def is_log(self) -> bool:
        """Whether the autopilot wrote it itself, with the arrival time of each fix."""
        return self.flight.kind in ("dataflash", "ulog")

    @property
    def gps(self) -> GpsTrack | None:
        """The first receiver that shows velocities; None without one."""
        return next((one for one in self.context.gps if with_velocity(one).sum() > 1), None)

    @property
    def trim(self) -> Trim:
        """From the axes of the board, in which compasses are calibrated, to those of the body.

        Data of the board in a dataflash log were rotated when read; telemetry was not.
        """
        return Trim(self.parameters if self.flight.kind == "dataflash" else {})

    def attitude(self) -> Attitudes:
        """Of the board, to NED; the deviation of an unknown heading is infinite."""
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
        """In the axes of the board, with the autopilot's calibration, if any."""
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
        """Whether the fields are uncalibrated, as in PX4's SCALED_IMU."""
        sources = {track.imu: track.source for track in self.context.imus}
        is_message = not self.context.compasses
        return is_message and self.autopilot == PX4 and "SCALED" in sources.get(compass, "")

    def flying(self, t_s: Array) -> Mask:
        """While the motors could turn; everything if unknown."""
        armed = self.context.armed
        return within(t_s, armed) if armed else np.ones(len(t_s), dtype=bool)


def with_velocity(gps: GpsTrack) -> Mask:
    """(N,) fixes with a level velocity."""
    return gps.has_fix & np.isfinite(gps.v_n[:, :2]).all(axis=1)


def series_at(series: Series | None, t_s: Array) -> Array:
    """(N,) interpolated values; NaN beyond the recorded ones, or without any."""
    if series is None:
        return np.full(len(t_s), np.nan)
    good = np.isfinite(series.values)
    if good.sum() < 2:
        return np.full(len(t_s), np.nan)
    values: Array = np.interp(t_s, series.t_s[good], series.values[good], left=np.nan, right=np.nan)
    return values


def _finite(sigma: Array) -> Array:
    return np.where(np.isfinite(sigma), sigma, np.inf)
