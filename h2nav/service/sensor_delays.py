"""Age of the sensors' values at the time stamps of their messages, per autopilot.

A log that shows the ages passes them with the samples; otherwise the autopilot's make decides:

| autopilot | rates and forces | field |
|---|---|---|
| ArduPilot | Butterworth low-pass of INS_GYRO_FILTER, Eq. (40): 11 ms at 20 Hz | mean of 100 ms |
| PX4 | mean over 1 / IMU_INTEG_RATE, 5 ms | HIGHRES_IMU: mean of 67 ms, sent later; SCALED_IMU |
| others | unknown | unknown |

Half a period between samples does not count as age of a rate, because a filter takes it as the mean
over the step before its sample. So a younger rate makes the attitude early.

Source: docs/filter.md Eq. (40), (41).
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import SensorDelays
from h2nav.service.autopilot import Identity
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import Ages
from h2nav.wire.vehicle import ParameterValue

GYRO_FILTER = "INS_GYRO_FILTER"
DEFAULT_FILTER_HZ = 20.0
# ArduPilot's default for rovers.
DEFAULT_DRIVING_FILTER_HZ = 4.0
# A filter outside this is implausible: 2 Hz would make the rates 0.11 s old.
SLOWEST_FILTER_HZ = 2.0
FASTEST_FILTER_HZ = 1000.0
# ArduPilot reads the compass at 10 Hz and sends the mean since the previous reading.
ARDUPILOT_FIELD_S = 0.05
# PX4's default IMU_INTEG_RATE is 200 Hz; IMU_GYRO_CUTOFF filters for its controllers alone.
PX4_RATES_S = 0.0025
# Half of the 67 ms of its default SENS_MAG_RATE, and the wait for a message at 50 Hz or less.
PX4_FIELD_S = 0.04
# The raw sensor is read at 50 to 100 Hz.
PX4_RAW_FIELD_S = 0.01
# In periods of the samples: how many samples the period is averaged over.
PERIOD_SAMPLES = 50
# Smaller changes are not passed to the filter: 0.02 deg at 200 deg/s.
MIN_CHANGE_S = 1e-4


def butterworth_delay_s(cutoff_hz: float) -> float:
    """Group delay of a two-pole Butterworth low-pass at low frequencies.

    Source: docs/filter.md Eq. (40).
    """
    return math.sqrt(2.0) / (2.0 * math.pi * cutoff_hz)


class SensorTiming:
    """Known ages of one autopilot's values, and the resulting delays for the filter.

    Args:
        settings: may set the ages.
        identity: of the autopilot, of which only the make is used.
    """

    def __init__(self, settings: AutopilotSettings, identity: Identity) -> None:
        self._settings = settings
        self._identity = identity
        self._filter_age_s: float | None = None
        self._newest_us: int | None = None
        # usual time between samples; None while unknown
        self.period_s: float | None = None
        self._shown: Ages | None = None  # of the latest sample itself
        self._ages: Ages | None = None  # as last used by `sampled`
        self._field_is_raw = False
        self.delays = SensorDelays()

    def restart(self) -> None:
        """Restarts with the samples' time."""
        self._newest_us = self.period_s = None
        self.delays = SensorDelays()

    @property
    def parameter(self) -> str:
        """Name of the autopilot's parameter with the filter frequency; empty if there is none."""
        is_asked = self._identity.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return GYRO_FILTER if is_asked and self._settings.gyro_delay_s == "auto" else ""

    def take_parameter(self, parameter: ParameterValue) -> bool:
        """Takes a parameter of the autopilot; returns whether it changed an age."""
        if not self.parameter or parameter.name != self.parameter or parameter.value is None:
            return False
        cutoff_hz = parameter.value
        if cutoff_hz == 0.0:  # the low-pass is off
            age_s = 0.0
        elif SLOWEST_FILTER_HZ <= cutoff_hz <= FASTEST_FILTER_HZ:
            age_s = butterworth_delay_s(cutoff_hz)
        else:
            return False
        before, self._filter_age_s = self.ages().rates_s, age_s
        self._ages = None
        return age_s != before

    def ages(self, *, field_is_raw: bool = False) -> Ages:
        """The presently known ages.

        Args:
            field_is_raw: the fields in use are those of PX4's raw sensor.
        """
        rates_s, field_s = self._shown or self._known(field_is_raw)
        chosen = self._settings
        if not isinstance(chosen.gyro_delay_s, str):
            rates_s = chosen.gyro_delay_s
        if not isinstance(chosen.field_delay_s, str):
            field_s = chosen.field_delay_s
        return Ages(rates_s, field_s)

    def sampled(self, t_us: int, *, field_is_raw: bool, ages: Ages | None = None) -> bool:
        """Follows the period of the samples; returns whether `delays` has changed.

        Args:
            t_us: time of a sample.
            field_is_raw: as in `ages`.
            ages: carried by the sample itself.

        Source: docs/filter.md Eq. (41).
        """
        before_us, self._newest_us, period_s = self._newest_us, t_us, self.period_s
        if before_us is None:
            if period_s is None:
                return False
        else:
            step_s = (t_us - before_us) * 1e-6
            if period_s is None:
                period_s = step_s
            else:
                # A gap counts as two periods, so that it moves the mean little.
                step_s = min(step_s, 2.0 * period_s)
                period_s += (step_s - period_s) / PERIOD_SAMPLES
            self.period_s = period_s
        if field_is_raw != self._field_is_raw or self._ages is None or ages is not self._shown:
            self._shown, self._field_is_raw = ages, field_is_raw
            self._ages = self.ages(field_is_raw=field_is_raw)
        rates_s, field_s = self._ages
        gyro_s = 0.0 if rates_s is None else rates_s - 0.5 * period_s
        field_s = gyro_s if field_s is None else field_s
        was_gyro_s, was_field_s = self.delays
        if (
            -MIN_CHANGE_S < gyro_s - was_gyro_s < MIN_CHANGE_S
            and -MIN_CHANGE_S < field_s - was_field_s < MIN_CHANGE_S
        ):
            return False
        self.delays = SensorDelays(gyro_s, field_s)
        return True

    def _known(self, field_is_raw: bool) -> Ages:
        if self._identity.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            return Ages(PX4_RATES_S, PX4_RAW_FIELD_S if field_is_raw else PX4_FIELD_S)
        if self._identity.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            return Ages(None, None)
        if self._filter_age_s is not None:
            return Ages(self._filter_age_s, ARDUPILOT_FIELD_S)
        is_rover = self._identity.is_rover
        cutoff_hz = DEFAULT_DRIVING_FILTER_HZ if is_rover else DEFAULT_FILTER_HZ
        return Ages(butterworth_delay_s(cutoff_hz), ARDUPILOT_FIELD_S)
