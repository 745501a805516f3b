"""Runs the kernels for every sample of one IMU: one call before the filter, one after it."""

from h2nav.attitude.kernel_files import SENSOR_CHECKS, SENSOR_WINDOWS
from h2nav.attitude.native import compiled_step, stepping
from h2nav.attitude.record import in_c
from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.kernel.checks import check
from h2nav.integrity.kernel.memory import Gains, Memory, Sample
from h2nav.integrity.kernel.repeats import (
    AXES,
    COMPASS,
    GYRO,
    IMU,
    LOUD_COUNTS,
    OF_COMPASS,
    OF_SENSOR,
    place,
)
from h2nav.integrity.kernel.standstill import FORCE_COUNT_M_S2, GYRO_COUNT_RAD_S
from h2nav.integrity.kernel.windows import follow

_NO_FIELD: Vec3 = (0.0, 0.0, 0.0)
# Where the checks keep how often each channel repeats its values at rest.
_AT_REST = (*range(AXES), *(place(channel, 0.0, 0.0) for channel in range(AXES, COMPASS)))


def _experiences(channel: int) -> range:
    """Where the checks keep what they know of a channel."""
    if channel < AXES:
        return range(channel, channel + 1)
    if channel == COMPASS:
        return range(OF_COMPASS, OF_COMPASS + 2)
    return range(place(channel, 0.0, 0.0), place(channel, 0.0, 0.0) + OF_SENSOR)


class Watch:
    """Memory and kernels of one IMU.

    Attributes:
        memory: of both kernels.
        gains: inputs besides the samples.
    """

    def __init__(self) -> None:
        self.memory, self.gains, sample = Memory(), Gains(), Sample()
        checks, windows = compiled_step(SENSOR_CHECKS), compiled_step(SENSOR_WINDOWS)
        if checks is not None:
            self.memory, self.gains, sample = in_c(Memory), in_c(Gains), in_c(Sample)
        records = (self.memory, self.gains, sample)
        self._check = stepping(check, checks, records, Sample, ("t_us", "clipped"))
        self._follow = stepping(follow, windows, records, Sample, ("rate", "rate"))

    def use_field_delay(self, delay_s: float) -> None:
        """Takes how much later than the rates the field is measured."""
        self.gains.field_delay_s = delay_s

    def interrupt(self) -> None:
        """Nothing of the past may be integrated with the next sample."""
        self.memory.is_running = 0.0

    def forget_rest(self) -> None:
        """Forgets how often values repeat where nothing turns; all of it was learnt in the air."""
        memory = self.memory
        for at in _AT_REST:
            memory.seen[at] = memory.longest[at] = memory.runs[at] = 0.0

    def forget_values(self) -> None:
        """Forgets how often values repeat: they come in another message.

        What is known of a sensor that moves by counts from sample to sample, in the coarsest
        message, is so in any.
        """
        memory = self.memory
        memory.has_begun = 0.0
        quiet = [
            sensor
            for sensor, count in ((0, GYRO_COUNT_RAD_S), (1, FORCE_COUNT_M_S2))
            if min(memory.usual[3 * sensor : 3 * sensor + 3]) < LOUD_COUNTS * count
        ]
        channels = [COMPASS, *((IMU,) if len(quiet) == 2 else ())]
        for sensor in quiet:
            memory.count[sensor] = memory.still_us[sensor] = 0.0
            channels += [GYRO + sensor, *range(3 * sensor, 3 * sensor + 3)]
        for channel in channels:
            for at in _experiences(channel):
                memory.seen[at] = memory.longest[at] = memory.runs[at] = 0.0
            memory.run[channel] = memory.run_us[channel] = memory.run_moved[channel] = 0.0
            memory.accused[channel] = 0.0

    def check(self, sample: ImuSample) -> int:
        """Takes a sample before the filter does; returns the bits of `kernel.checks.check`."""
        t_us, (p, q, r), (f_x, f_y, f_z), m_b_ut, clipped = sample
        m_x, m_y, m_z = m_b_ut or _NO_FIELD
        has_field = m_b_ut is not None
        return self._check(t_us, p, q, r, f_x, f_y, f_z, m_x, m_y, m_z, has_field, clipped)

    def follow(self, w_b: Vec3) -> int:
        """Continues with that sample, and the filter's rate for it, rad/s.

        Returns:
            The bits of `kernel.windows.follow`.
        """
        return self._follow(*w_b)
