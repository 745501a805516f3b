"""The attitude of a filter in the air, where forces do not show it: found by velocities."""

import math
from abc import abstractmethod

from h2nav.attitude.samples import ImuSample, Quat, Vec3, VelocityFix
from h2nav.attitude.velocity_aided.air_alignment import AirAlignment, AirReference, Leveled
from h2nav.attitude.velocity_aided.doubted_sensors import DoubtedSensors
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.velocity_aiding import MIN_SIGMA_M_S
from h2nav.maths.units import DEG
from h2nav.maths.vectors import ZERO

# A larger bias turns the forces of a window in the air by more than the velocities can show, unless
# nothing else shows the tilt.
KNOWN_BIAS_RAD_S = 0.3 * DEG
UNKNOWN_TILT_RAD = 10.0 * DEG


class VelocityAttitude(DoubtedSensors):
    """Windows of forces and velocities in the air; an arithmetic gives what its kernel holds."""

    def __init__(self, gains: VelocityAidedGains) -> None:
        super().__init__(gains)
        self._air: AirAlignment | None = None

    def _watch_in_air(
        self, t_us: int, known_rad: float = math.inf, tilt_sigma_rad: float = 0.0
    ) -> None:
        """Begins a window in the air; if neither bias nor tilt is known, too.

        Args:
            t_us: time of the sample before it.
            known_rad: deviation of the tilt that the window has to show better.
            tilt_sigma_rad: deviation of the tilt, at a start.
        """
        drift_rad_s = math.sqrt(sum(self.sensor_errors.gyro_variance))
        may_show = drift_rad_s < KNOWN_BIAS_RAD_S or tilt_sigma_rad > UNKNOWN_TILT_RAD
        self._air = None
        if may_show and self._flies:
            self._air = AirAlignment(t_us, known_rad, drift_rad_s)

    def _follow_in_air(self, window: AirAlignment, sample: ImuSample) -> None:
        """Adds a sample to the window; the window ends at its full length."""
        if window.is_over(sample.t_us):
            self._air = None
            return
        if sample.clipped or sample.f_b == ZERO:
            # What it hides of turn or force is missing in all sums.
            self._watch_in_air(sample.t_us)
            return
        rate, force, field = self._without_biases(sample)
        window.add(sample.t_us, rate, force, field, self.field_latency_s)

    def _take_in_air(self, window: AirAlignment, fix: VelocityFix) -> None:
        """Adds a fix to the window, which may show the attitude then."""
        late_s = self.sensor_errors.fix_latency_s
        window.take(fix.t_us - late_s * 1e6, fix.v_n)
        sigma_m_s = max(fix.sigma_m_s, MIN_SIGMA_M_S)
        self._take_level(window.solve(self._attitude(), self._reference(), sigma_m_s))

    def _take_level(self, found: Leveled | None) -> None:
        """Continues with the attitude from a window in the air."""
        if found is None:
            return
        self._find_in_air(found)
        if found.heading_sigma_rad < math.inf:
            self._witness.clear()

    # --- what an arithmetic gives ---------------------------------------------------------------

    @property
    @abstractmethod
    def _flies(self) -> bool:
        """Whether the vehicle is reported to be in the air."""

    @abstractmethod
    def _attitude(self) -> Quat:
        """The attitude, body to n."""

    @abstractmethod
    def _reference(self) -> AirReference:
        """The reference of the field; its norm is 0 while velocities show the heading."""

    @abstractmethod
    def _without_biases(self, sample: ImuSample) -> tuple[Vec3, Vec3, Vec3 | None]:
        """Rate, force and, if new, field of the latest sample, without biases."""

    @abstractmethod
    def _find_in_air(self, found: Leveled) -> None:
        """Continues with an attitude from velocities in flight."""
