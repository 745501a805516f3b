"""The simulated vehicle at one instant: truth, sensors, clocks, the autopilot's own estimate."""

import math
import random
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, ImuSample, Vec3
from h2nav.maths import quaternion
from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.sim.calibrations import (
    FULL_CURRENT_A,
    HOVER_THROTTLE,
    SOUND,
    ZERO,
    Miscalibration,
    heading_error_rad,
    throttle_of,
    trimmed,
)
from h2nav.sim.faults import FaultSchedule
from h2nav.sim.imu_model import GyroSampling, ImuModel, ImuParameters
from h2nav.sim.rigid_motion import RigidMotion, specific_force
from h2nav.sim.scenarios import Scenario
from h2nav.sim.sensor_faults import GpsReading, SensorFaults, faulty_gps


class FlownPlace(NamedTuple):
    """Where on earth a scenario starts."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    field: EarthField


# ArduPilot's home, a model airfield near Canberra; its field after the World Magnetic Model 2025
# at the end of 2026.
HOME = FlownPlace(
    -35.363262,
    149.165237,
    584.0,
    EarthField(norm_ut=58.07, dip_rad=-66.05 * DEG, declination_rad=12.69 * DEG),
)
UNIX_AT_START_US = 1_790_000_000_000_000
WRAP = 1 << 32
# Gyro bias left after the calibration at power-on, per axis.
LEFT_BIAS_DEG_S = 0.1
# Deviations of roll, pitch and yaw of the autopilot's estimators, rad: of the main one and of the
# second one.
OWN_ERROR: Vec3 = (0.1 * DEG, 0.1 * DEG, 0.4 * DEG)
SECOND_ERROR: Vec3 = (0.4 * DEG, 0.4 * DEG, 1.2 * DEG)


class SimulatedAges(NamedTuple):
    """Age of the content of the autopilot's messages at their time stamp, s."""

    rates_s: float  # rates and forces, which have passed a low-pass
    field_s: float  # the field, which is read less often


class Estimate(NamedTuple):
    """The autopilot's own estimate."""

    roll: float
    pitch: float
    yaw: float
    w_b: Vec3


class Vehicle:
    """A vehicle on its scenario, advanced with `go_to`; all else refers to the latest instant.

    Args:
        sensors: the kind of each IMU on board; each has a compass.
        schedule: faults of the sensors and of the clock.
        stamp_jitter_us: the largest delay between a sample and its time stamp.
        ages: of the sensors' values. Each sample is an earlier instant: the effect of a low-pass on
            a slow motion.
    """

    def __init__(
        self,
        scenario: Scenario,
        sensors: Sequence[ImuParameters],
        schedule: FaultSchedule,
        seed: int,
        stamp_jitter_us: int,
        ages: SimulatedAges,
    ) -> None:
        self.scenario = scenario
        self.home = HOME
        self.random = random.Random(f"vehicle {seed}")
        self._schedule = schedule
        self._ages = ages
        self._wrong: Miscalibration = SOUND
        self._parameters: Mapping[str, float] = {}
        self._imus = [self._new_imu(sensor, seed, index) for index, sensor in enumerate(sensors)]
        self._faults = [SensorFaults(schedule.of_imu(index + 1)) for index in range(len(sensors))]
        self._own_error = _SlowError(random.Random(f"estimate {seed}"), OWN_ERROR)
        self._second_error = _SlowError(random.Random(f"second estimate {seed}"), SECOND_ERROR)
        self._has_short_clock = any(f.argument == "us" for f in schedule.starts("clock-wrap"))
        self._stamp_jitter_us = stamp_jitter_us
        self._start_ns: int | None = None
        self._boot_ns = 0
        self._t_ns: int | None = None
        self._motions: dict[float, RigidMotion] = {}
        self._samples: dict[int, ImuSample] = {}
        self._departed_ns = 0
        self.t_s = 0.0  # since the simulator started; continues through a reboot
        self.flown_s = 0.0  # of the scenario
        self.boot_us = 0
        self._stamp_us: int | None = None

    def miscalibrate(self, wrong: Miscalibration, parameters: Mapping[str, float]) -> None:
        """Makes the first IMU and its compass wrong, corrected by the current parameters.

        Args:
            parameters: of the autopilot; they may change.
        """
        self._wrong, self._parameters = wrong, parameters

    def switch_on(self, t_ns: int) -> None:
        """Starts or restarts the autopilot at host time `t_ns`; its clock begins at zero."""
        self._boot_ns = t_ns
        if self._start_ns is None:
            self._start_ns = self._departed_ns = t_ns
            self._boot_ns -= _age_ns(self._schedule)
        self.go_to(t_ns)

    def depart(self, t_ns: int, scenario: Scenario) -> None:
        """Begins another scenario at host time `t_ns`; until then the vehicle is at its start.

        The vehicle jumps there, so the autopilot has to be off meanwhile.
        """
        self.scenario = scenario
        self._departed_ns = t_ns

    def go_to(self, t_ns: int) -> None:
        """Advances to host time `t_ns`, never earlier than the time before."""
        if t_ns == self._t_ns:
            return
        self._t_ns = t_ns
        self.t_s = self.seconds_at(t_ns)
        self.flown_s = (t_ns - self._departed_ns) * 1e-9
        self.boot_us = (t_ns - self._boot_ns) // 1000
        self._stamp_us = None
        self._motions.clear()
        self._samples.clear()

    def seconds_at(self, t_ns: int) -> float:
        """Seconds since the simulator started, the time of faults, at host time `t_ns`."""
        assert self._start_ns is not None
        return (t_ns - self._start_ns) * 1e-9

    @property
    def stamp_us(self) -> int:
        """The time stamp of IMU messages at this instant, since boot."""
        if self._stamp_us is None:
            self._stamp_us = self.boot_us + self.random.randint(0, self._stamp_jitter_us)
        return self._stamp_us

    @property
    def boot_ms(self) -> int:
        """time_boot_ms of messages."""
        return (self.boot_us // 1000) % WRAP

    @property
    def stamp_ms(self) -> int:
        """time_boot_ms of IMU messages."""
        return (self.stamp_us // 1000) % WRAP

    @property
    def time_usec(self) -> int:
        """time_usec of messages that are not IMU samples."""
        return self._usec(self.boot_us)

    @property
    def stamp_usec(self) -> int:
        """time_usec of IMU messages."""
        return self._usec(self.stamp_us)

    @property
    def unix_us(self) -> int:
        """The vehicle's UNIX time: the same in every run."""
        return UNIX_AT_START_US + round(self.t_s * 1e6)

    @property
    def motion(self) -> RigidMotion:
        """The truth."""
        return self._past(0.0)

    def _past(self, age_s: float) -> RigidMotion:
        """The truth `age_s` ago, cached because it is the most expensive part."""
        motion = self._motions.get(age_s)
        if motion is None:
            motion = self._motions[age_s] = self.scenario.motion(self.flown_s - age_s)
        return motion

    @property
    def is_armed(self) -> bool:
        """Whether the motors are armed."""
        return self.scenario.is_armed(self.flown_s)

    @property
    def is_airborne(self) -> bool:
        """Whether the vehicle flies."""
        return self.scenario.is_airborne(self.flown_s)

    @property
    def estimate(self) -> Estimate:
        """The autopilot's own estimate: the truth with a small, slow error, and with its faults."""
        roll, pitch, yaw = self._own_error.at(self.t_s)
        if self._wrong != SOUND:
            yaw += self._compass_error_rad()
            errors = self._wrong.tilt_error_rad(self._parameters)
            roll, pitch = roll + errors[0], pitch + errors[1]
        roll += (self._schedule.number("autopilot-tilt", self.t_s) or 0.0) * DEG
        yaw += (self._schedule.number("autopilot-heading", self.t_s) or 0.0) * DEG
        return self._estimate((roll, pitch, yaw))

    @property
    def second_estimate(self) -> Estimate:
        """The autopilot's second estimate: coarser, and without the faults."""
        return self._estimate(self._second_error.at(self.t_s))

    def _estimate(self, error: Vec3) -> Estimate:
        roll, pitch, yaw = quaternion.to_euler(self.motion.q_nb)
        turned = math.remainder(yaw + error[2], math.tau)
        return Estimate(roll + error[0], pitch + error[1], turned, self.motion.w_b)

    def _compass_error_rad(self) -> float:
        """Error of a heading taken from the first compass, rad."""
        field = self.imu(0).m_b_ut
        if field is None:
            return 0.0
        q_nb = self._past(self._ages.field_s).q_nb
        field = trimmed(field, self._parameters)
        return heading_error_rad(q_nb, field, self.home.field.declination_rad)

    @property
    def throttle(self) -> float:
        """0 to 1; without a motor field it is that of a hover."""
        if not self.is_airborne:
            return 0.0
        if self._wrong.motor_field_mg == ZERO:
            return HOVER_THROTTLE
        return throttle_of(specific_force(self.motion))

    @property
    def current_a(self) -> float | None:
        """Current of the battery, A; None if the motors disturb no compass."""
        return None if self._wrong.motor_field_mg == ZERO else FULL_CURRENT_A * self.throttle

    @property
    def imus(self) -> int:
        """Number of IMUs."""
        return len(self._imus)

    def imu(self, index: int) -> ImuSample:
        """The sample of an IMU, 0 being the first."""
        sample = self._samples.get(index)
        if sample is None:
            faults = self._faults[index]
            sample = self._imus[index].sample(
                self.boot_us,
                self._past(self._ages.rates_s),
                faults.disturbance(self.t_s),
                self._past(self._ages.field_s).q_nb,
            )
            sample = faults.apply(self.t_s, sample)
            if index == 0 and self._wrong != SOUND:
                sample = self._wrong.shown(sample, self.throttle, self._parameters)
            self._samples[index] = sample
        return sample

    @property
    def gyro_in_use(self) -> int:
        """The first IMU whose gyro has new values; otherwise the first of all."""
        has_data = (faults.has_gyro_data(self.t_s) for faults in self._faults)
        return next((index for index, has in enumerate(has_data) if has), 0)

    @property
    def accel_in_use(self) -> int:
        """The first IMU whose accelerometer has new values; otherwise the first of all."""
        has_data = (faults.has_accel_data(self.t_s) for faults in self._faults)
        return next((index for index, has in enumerate(has_data) if has), 0)

    @property
    def has_all_gyro_data(self) -> bool:
        """Whether every gyro has new values."""
        return all(faults.has_gyro_data(self.t_s) for faults in self._faults)

    @property
    def has_all_accel_data(self) -> bool:
        """Whether every accelerometer has new values."""
        return all(faults.has_accel_data(self.t_s) for faults in self._faults)

    @property
    def gps(self) -> GpsReading:
        """The receiver's measurement without noise."""
        lag_s = self._schedule.number("gps-lag", self.t_s)
        motion = self._past(lag_s or 0.0)
        return faulty_gps(self._schedule, self.t_s, GpsReading(True, motion.p_n, motion.v_n))

    def gyro_bias(self, index: int) -> Vec3:
        """The true gyro bias of an IMU, rad/s."""
        return self._imus[index].gyro_bias

    def has_fault(self, name: str) -> bool:
        """Whether a fault is active now."""
        return self._schedule.acts(name, self.t_s)

    def denies(self, message_name: str) -> bool:
        """Whether a fault denies this message now."""
        return message_name in self._schedule.words("deny", self.t_s)

    def geographic(self, p_n: Vec3 | None = None) -> tuple[int, int, float]:
        """Latitude and longitude, 1e-7 deg, and altitude above sea level, m.

        Args:
            p_n: of this position; None = of the true one.
        """
        north, east, down = self.motion.p_n if p_n is None else p_n
        latitude = self.home.latitude_deg + north / EARTH_RADIUS_M / DEG
        parallel_m = EARTH_RADIUS_M * math.cos(self.home.latitude_deg * DEG)
        longitude = self.home.longitude_deg + east / parallel_m / DEG
        return round(latitude * 1e7), round(longitude * 1e7), self.home.altitude_m - down

    def _usec(self, since_boot_us: int) -> int:
        if self.has_fault("epoch"):
            return UNIX_AT_START_US + since_boot_us
        return since_boot_us % WRAP if self._has_short_clock else since_boot_us

    def _new_imu(self, sensor: ImuParameters, seed: int, index: int) -> ImuModel:
        bias = random.Random(f"bias {seed} {index}")
        x, y, z = (b + bias.gauss(0.0, LEFT_BIAS_DEG_S) for b in sensor.gyro_bias_deg_s)
        own = sensor._replace(gyro_bias_deg_s=(x, y, z), gyro_sampling=GyroSampling.INSTANT)
        return ImuModel(own, self.home.field, 1000 * seed + index)


class _SlowError:
    """The wandering error of an attitude that the autopilot estimates.

    Args:
        source: of frequencies and phases.
        sizes: of roll, pitch and yaw, rad.
    """

    def __init__(self, source: random.Random, sizes: Vec3) -> None:
        self._sizes = sizes
        self._waves = [
            [(source.uniform(0.1, 0.8), source.uniform(0.0, math.tau)) for _ in range(2)]
            for _ in sizes
        ]

    def at(self, t_s: float) -> Vec3:
        """Errors of roll, pitch and yaw, rad."""
        x, y, z = (
            size * sum(math.sin(omega * t_s + phase) for omega, phase in waves)
            for size, waves in zip(self._sizes, self._waves, strict=True)
        )
        return (x, y, z)


def _age_ns(schedule: FaultSchedule) -> int:
    """How long the autopilot has been running when the simulation starts."""
    for fault in schedule.starts("clock-wrap"):
        unit_ns = 1_000 if fault.argument == "us" else 1_000_000
        return WRAP * unit_ns - round(fault.start_s * 1e9)
    return 0
