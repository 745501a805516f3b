"""The default filter and the smoother on arrays, for notebooks and programs.

Arrays hold one row per sample: rates in rad/s, specific forces in m/s^2 (at rest they point up),
fields in any constant unit. The body's x axis points forward; the directions of y and z do not
matter, because the force shows where down is.

Missing values: a row of `gyr` or `acc` that is not finite is skipped; the last attitude is
repeated, and the next sample is integrated over both. A row of `mag` that is not finite is no new
field: this is how to pass a slow magnetometer. Output is NaN only before the first attitude
(some 20 ms).
"""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.attitude import native, smoothing
from h2nav.attitude.batch import filter_array, samples_of
from h2nav.attitude.batch_driver import BatchResult, BatchSamples, empty_result, run_python
from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.maths import frames
from h2nav.recordings.trials import usual_rate_hz

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Frame = Literal["ned", "enu"]

MIN_RATE_HZ, MAX_RATE_HZ = 5.0, 2000.0


class Velocity(NamedTuple):
    """Velocities over ground from outside the inertial sensors, such as from a GPS receiver.

    Attributes:
        t_s: (M,) times of validity, rising, on the clock of the samples.
        v_m_s: (M, 3) north, east, down, or with ``frame="enu"`` east, north, up; the vertical one
            may be NaN.
        sigma_m_s: one-sigma accuracy per axis: one number or (M,).
    """

    t_s: npt.ArrayLike
    v_m_s: npt.ArrayLike
    sigma_m_s: npt.ArrayLike = 0.3


class Attitude(NamedTuple):
    """An attitude per sample.

    Attributes:
        q: (N, 4) from the body to north-east-down or east-north-up, Hamilton, scalar first.
        gyro_bias_rad_s: (N, 3) in body axes; measured = true + bias.
        sigma_tilt_rad: (N,) predicted deviation of the tilt.
        sigma_heading_rad: (N,) of the heading.
        is_at_rest: (N,) the body was at rest, and the gyro's bias was estimated.
        is_disturbed: (N,) a field was measured and rejected as disturbed.
    """

    q: Floats
    gyro_bias_rad_s: Floats
    sigma_tilt_rad: Floats
    sigma_heading_rad: Floats
    is_at_rest: Mask
    is_disturbed: Mask


class AttitudeFilter:
    """The default filter, sample by sample or array by array; calls may be mixed.

    >>> import h2nav
    >>> chosen = h2nav.AttitudeFilter(rate_hz=100.0)
    >>> for _ in range(10):
    ...     estimate = chosen.update((0.0, 0.0, 0.0), (0.0, 0.0, -9.81), (20.0, 0.0, 43.0))
    >>> [round(number, 6) for number in estimate.q_nb]
    [1.0, 0.0, 0.0, 0.0]

    Args:
        rate_hz: nominal rate of the samples, 5 to 2000; it chooses the gains.
        vehicle: ``handheld``, ``multirotor``, ``fixed-wing`` or ``rover``: how it may move.
        frame: of the attitudes and velocities: ``ned`` or ``enu``.

    Raises:
        BadInput: invalid rate, vehicle or frame.
    """

    def __init__(self, rate_hz: float, vehicle: str = "handheld", frame: Frame = "ned") -> None:
        if not MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
            limits = f"{MIN_RATE_HZ:g} to {MAX_RATE_HZ:g} Hz"
            raise BadInput(f"rate_hz: expected {limits}, found {rate_hz}")
        if vehicle not in VEHICLE_CLASSES:
            known = ", ".join(VEHICLE_CLASSES)
            raise BadInput(f"vehicle: expected one of {known}; found {vehicle!r}")
        if frame not in ("ned", "enu"):
            raise BadInput(f"frame: expected ned or enu, found {frame!r}")
        self._period_us = 1e6 / rate_hz
        self._frame = frame
        self._filter = _default_filter(rate_hz, vehicle)
        self._next_us = 0.0
        self._origin_s: float | None = None

    def update(
        self,
        gyr: npt.ArrayLike,
        acc: npt.ArrayLike,
        mag: npt.ArrayLike | None = None,
        dt_s: float | None = None,
    ) -> AttitudeEstimate | None:
        """Processes one sample.

        Args:
            gyr: (3,) rad/s.
            acc: (3,) m/s^2.
            mag: (3,) field; None where this sample has no new one.
            dt_s: time since the previous sample; None = the nominal period.

        Returns:
            The estimate, whose `q_nb` is to east-north-up with ``frame="enu"``; None before the
            first attitude.
        """
        if dt_s is not None:
            self._next_us += dt_s * 1e6 - self._period_us
        t_us = round(self._next_us)
        self._next_us += self._period_us
        field = None if mag is None else _vector(mag)
        estimate = self._filter.update(ImuSample(t_us, _vector(gyr), _vector(acc), field))
        if estimate is None or self._frame == "ned":
            return estimate
        return estimate._replace(q_nb=frames.attitude_enu_from_ned(estimate.q_nb))

    def use_velocity(self, v_m_s: npt.ArrayLike, sigma_m_s: float = 0.3) -> None:
        """Uses a velocity over ground, valid at the time of the last sample.

        Args:
            v_m_s: (3,) in the filter's frame; the vertical one may be NaN.
            sigma_m_s: one-sigma accuracy per axis.
        """
        v_n = _vector(v_m_s) if self._frame == "ned" else frames.ned_from_enu(_vector(v_m_s))
        t_us = round(self._next_us - self._period_us)
        self._filter.use_velocity(VelocityFix(t_us, v_n, sigma_m_s))

    def batch(
        self,
        gyr: npt.ArrayLike,
        acc: npt.ArrayLike,
        mag: npt.ArrayLike | None = None,
        *,
        t_s: npt.ArrayLike | None = None,
        velocity: Velocity | None = None,
    ) -> Attitude:
        """Processes many samples.

        Args:
            gyr: (N, 3) rad/s.
            acc: (N, 3) m/s^2.
            mag: (N, 3) field, rows of NaN where none is new; None without a magnetometer.
            t_s: (N,) increasing times, on one clock for all calls; None = the nominal rate.
            velocity: velocities over ground, on the clock of `t_s`, otherwise since the first
                sample.

        Raises:
            ValueError: the shapes do not match, or the times do not increase.
        """
        t_us = self._times_us(t_s, len(np.asarray(gyr)))
        steps_s = np.diff(t_us, prepend=0) * 1e-6  # the filter's clock begins with zero
        if velocity is None:
            found = filter_array(gyr, acc, mag, steps_s, self._filter, explains=True)
        else:
            samples = samples_of(gyr, acc, mag, steps_s)
            found = _with_fixes(self._filter, samples, self._fixes(velocity))
        return _attitude(found, _is_finite(mag, len(t_us)), self._frame)

    def _times_us(self, t_s: npt.ArrayLike | None, count: int) -> npt.NDArray[np.int64]:
        """Times of the next samples since the very first one."""
        if t_s is None:
            times_us = self._next_us + np.arange(count) * self._period_us
        else:
            given_s = np.asarray(t_s, dtype=np.float64)
            if given_s.shape != (count,) or not np.isfinite(given_s).all():
                raise ValueError(f"t_s needs the shape ({count},) and finite times")
            if self._origin_s is None and count:
                self._origin_s = float(given_s[0]) - self._next_us * 1e-6
            times_us = (given_s - (self._origin_s or 0.0)) * 1e6
        if count:
            self._next_us = float(times_us[-1]) + self._period_us
        found: npt.NDArray[np.int64] = np.round(times_us).astype(np.int64)
        return found

    def _fixes(self, velocity: Velocity) -> list[VelocityFix]:
        """The fixes on the filter's clock and in its frame."""
        times_s = np.asarray(velocity.t_s, dtype=np.float64) - (self._origin_s or 0.0)
        rows = np.asarray(velocity.v_m_s, dtype=np.float64)
        if rows.shape != (len(times_s), 3):
            raise ValueError("velocity: t_s needs the shape (M,), v_m_s (M, 3)")
        sigmas = np.broadcast_to(np.asarray(velocity.sigma_m_s, dtype=np.float64), times_s.shape)
        return [
            VelocityFix(
                round(t * 1e6),
                (v[0], v[1], v[2]) if self._frame == "ned" else frames.ned_from_enu(tuple(v)),
                sigma,
            )
            for t, v, sigma in zip(times_s.tolist(), rows.tolist(), sigmas.tolist(), strict=True)
        ]


def estimate(
    gyr: npt.ArrayLike,
    acc: npt.ArrayLike,
    mag: npt.ArrayLike | None = None,
    *,
    rate_hz: float | None = None,
    t_s: npt.ArrayLike | None = None,
    velocity: Velocity | None = None,
    vehicle: str = "handheld",
    frame: Frame = "ned",
) -> Attitude:
    """Estimates the attitude of a recording, each sample from those before it.

    With `mag` the heading is from magnetic north (9D); without it, it is relative (6D).

    >>> import numpy as np
    >>> import h2nav
    >>> gyr, acc = np.zeros((300, 3)), np.tile([0.0, 0.0, 9.81], (300, 1))
    >>> found = h2nav.estimate(gyr, acc, rate_hz=100.0, frame="enu")
    >>> bool(found.is_at_rest[-1]), found.q.shape
    (True, (300, 4))

    Args:
        gyr: (N, 3) rad/s.
        acc: (N, 3) m/s^2.
        mag: (N, 3) field, rows of NaN where none is new; None without a magnetometer.
        rate_hz: of the samples; may be left out where `t_s` is given.
        t_s: (N,) their times, increasing; None = evenly spaced.
        velocity: velocities over ground.
        vehicle: ``handheld``, ``multirotor``, ``fixed-wing`` or ``rover``.
        frame: ``ned`` or ``enu``.

    Raises:
        BadInput: invalid rate, vehicle or frame.
        ValueError: the shapes do not match, or the times do not increase.
    """
    chosen = AttitudeFilter(_rate_hz(rate_hz, t_s), vehicle, frame)
    return chosen.batch(gyr, acc, mag, t_s=t_s, velocity=velocity)


def smooth(
    gyr: npt.ArrayLike,
    acc: npt.ArrayLike,
    mag: npt.ArrayLike | None = None,
    *,
    rate_hz: float | None = None,
    t_s: npt.ArrayLike | None = None,
    velocity: Velocity | None = None,
    vehicle: str = "handheld",
    frame: Frame = "ned",
) -> Attitude:
    """Estimates the attitude of a recording, each sample from those before and after it.

    Arguments and errors are those of `estimate`; it takes longer, for three passes.
    """
    chosen_hz = _rate_hz(rate_hz, t_s)
    chosen = AttitudeFilter(chosen_hz, vehicle, frame)
    steps_s = np.diff(chosen._times_us(t_s, len(np.asarray(gyr))), prepend=0) * 1e-6
    samples = samples_of(gyr, acc, mag, steps_s)
    fixes = [] if velocity is None else chosen._fixes(velocity)
    rows = np.searchsorted(samples.t_us, [fix.t_us for fix in fixes])
    given = smoothing.Given(samples, list(zip(rows.tolist(), fixes, strict=True)))
    (found,) = smoothing.smooth([given], lambda: _default_filter(chosen_hz, vehicle))
    result = BatchResult(
        np.ascontiguousarray(found.q_nb.T),
        np.ascontiguousarray(found.bias_b.T),
        *(found.sigma_tilt_rad, found.sigma_heading_rad, found.trust),
    )
    return _attitude(result, samples.has_field, frame)


def _default_filter(rate_hz: float, vehicle: str) -> VelocityAidedFilter:
    name = f"{vehicle}_{gain_files.shipped_rate(rate_hz)}hz"
    gains = velocity_aided_gains(gain_files.load(name), name)
    return VelocityAidedFilter(gains, native.compiled_step(VELOCITY_AIDED))


def _rate_hz(rate_hz: float | None, t_s: npt.ArrayLike | None) -> float:
    """The given rate, otherwise the usual one of the times."""
    if rate_hz is not None:
        return float(rate_hz)
    if t_s is None or len(np.asarray(t_s)) < 2:
        raise BadInput("rate_hz: missing; give it, or the times t_s of at least two samples")
    t_us = np.round(np.asarray(t_s, dtype=np.float64) * 1e6)
    steps_us = np.diff(t_us)
    if t_us.ndim != 1 or not ((steps_us > 0.0) & (steps_us < np.inf)).all():
        raise ValueError("t_s needs the shape (N,) and finite times that increase")
    return usual_rate_hz(t_us.astype(np.int64))


def _with_fixes(
    chosen: VelocityAidedFilter, samples: BatchSamples, fixes: list[VelocityFix]
) -> BatchResult:
    """Yields samples and velocities in the order of their times."""
    count = len(samples.t_us)
    result = empty_result(count, explains=True)
    first = 0
    for fix in fixes:
        stop = int(np.searchsorted(samples.t_us, fix.t_us))
        run_python(chosen, samples, result, first, stop)
        chosen.use_velocity(fix)
        first = max(first, stop)
    run_python(chosen, samples, result, first, count)
    return result


def _attitude(found: BatchResult, has_field: Mask, frame: Frame) -> Attitude:
    q = found.q_nb if frame == "ned" else _enu_from_ned(found.q_nb)
    is_aligned = (found.trust & int(Trust.ALIGNED)) > 0
    used = (found.trust & int(Trust.FIELD_USED)) > 0
    return Attitude(
        q,
        found.bias_b,
        found.sigma_tilt_rad,
        found.sigma_heading_rad,
        (found.trust & int(Trust.REST)) > 0,
        is_aligned & has_field & ~used,
    )


def _enu_from_ned(q_nb: Floats) -> Floats:
    """Source: `frames.attitude_enu_from_ned`, for rows."""
    turn = np.array(frames.attitude_enu_from_ned((1.0, 0.0, 0.0, 0.0)))
    a, b, c, d = turn
    w, x, y, z = q_nb.T
    rows = np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=1,
    )
    rows[rows[:, 0] < 0.0] *= -1.0
    return rows


def _is_finite(mag: npt.ArrayLike | None, count: int) -> Mask:
    if mag is None:
        return np.zeros(count, dtype=bool)
    return np.asarray(np.isfinite(np.asarray(mag, dtype=np.float64)).all(axis=1))


def _vector(values: npt.ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return x, y, z
