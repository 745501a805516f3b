"""What a filter knows of its sensors' errors, and how it learns those anew that are doubted."""

from abc import ABC, abstractmethod

from h2nav.attitude.samples import SensorDoubt, SensorErrors, Vec3
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.heading_witness import HIGH_PASS_S, HeadingWitness
from h2nav.attitude.velocity_aided.kernel.aiding import MAX_ACCEL_BIAS

# A gyro is doubted anew when the variance of its bias grows by this factor.
NEWS = 4.0


class DoubtedSensors(ABC):
    """The errors of a filter's sensors; an arithmetic gives how its kernel holds them."""

    def __init__(self, gains: VelocityAidedGains) -> None:
        self._gains = gains
        self._witness = HeadingWitness()

    def doubt(self, doubt: SensorDoubt) -> None:
        """Estimates anew what was found wrong; see `AttitudeFilter`."""
        g = self._gains.kernel
        x, y, z = (min(sigma * sigma, g.bias_variance) for sigma in doubt.rate_b)
        known = self.sensor_errors.gyro_variance
        if any(new > NEWS * old for new, old in zip((x, y, z), known, strict=True)):
            # An undetected gyro error has bent the velocity felt until now, and bends it until the
            # tilt is corrected.
            self._witness.clear(HIGH_PASS_S)
        force = None
        if self._gained() is not None and g.accel_variance > 0.0:
            a, b = (min((sigma / g.gravity) ** 2, MAX_ACCEL_BIAS**2) for sigma in doubt.force_b)
            force = (a, b)
        self._open_biases((x, y, z), force)
        if doubt.tilt_rad > 0.0:
            self._open_attitude(doubt.tilt_rad, doubt.heading_rad)

    def _know_biases(self, rate: Vec3, force: tuple[float, float]) -> None:
        """Sets the deviations of the biases, rad/s and m/s^2."""
        g = self._gains.kernel
        x, y, z = (min(sigma * sigma, g.bias_variance) for sigma in rate)
        self._set_gyro_variance((x, y, z))
        a, b = (min((sigma / g.gravity) ** 2, MAX_ACCEL_BIAS**2) for sigma in force)
        self._set_aided_variances((a, b), self.sensor_errors.fix_latency_variance)

    def know_sensors(self, errors: SensorErrors, walked_s: float) -> None:
        """Starts with sensors whose errors are corrected, known as well as so long ago."""
        g = self._gains.kernel
        walk = g.bias_walk * walked_s
        x, y, z = (min(v + walk, g.bias_variance) for v in errors.gyro_variance)
        self._set_gyro_variance((x, y, z))
        if min(errors.force_variance) > 0.0:
            walk, unit = g.accel_walk * walked_s, g.gravity * g.gravity
            a, b = (min(v / unit + walk, g.accel_variance) for v in errors.force_variance)
            lag = errors.fix_latency_variance + g.fix_lag_walk * walked_s
            self._set_aided_variances((a, b), min(lag, g.fix_lag_variance))

    # --- what an arithmetic gives ---------------------------------------------------------------

    @property
    @abstractmethod
    def sensor_errors(self) -> SensorErrors:
        """The errors of the sensors estimated so far."""

    @property
    @abstractmethod
    def field_latency_s(self) -> float:
        """Estimated delay of the magnetometer's samples relative to the gyro's."""

    @abstractmethod
    def _gained(self) -> tuple[float, float] | None:
        """Velocity gained from the force since aiding began, over g; None without fixes."""

    @abstractmethod
    def _open_biases(self, rate: Vec3, force: tuple[float, float] | None) -> None:
        """Raises the biases' variances to these, (rad/s)^2 and g^2."""

    @abstractmethod
    def _open_attitude(self, tilt_rad: float, heading_rad: float) -> None:
        """Raises the deviations of tilt and heading to these."""

    @abstractmethod
    def _set_gyro_variance(self, variance: Vec3) -> None:
        """Sets the variance of the gyro's bias, (rad/s)^2, without correlations."""

    @abstractmethod
    def _set_aided_variances(self, force: tuple[float, float], lag: float) -> None:
        """Sets the variances of accelerometer bias and fix latency, g^2 and s^2."""
