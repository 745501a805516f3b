"""Runs the kernels for every sample of one IMU: one call before the filter, one after it."""

from h2nav.attitude.kernel_files import SENSOR_CHECKS, SENSOR_WINDOWS
from h2nav.attitude.native import compiled_step, stepping
from h2nav.attitude.record import in_c
from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.kernel.checks import check
from h2nav.integrity.kernel.memory import Gains, Memory, Sample
from h2nav.integrity.kernel.repeats import AXES, COMPASS, place
from h2nav.integrity.kernel.windows import follow

_NO_FIELD: Vec3 = (0.0, 0.0, 0.0)
# Where the checks keep how often each channel repeats its values at rest.
_AT_REST = (*range(AXES), *(place(channel, 0.0, 0.0) for channel in range(AXES, COMPASS)))


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
        """Forgets the resolution of the values and how often they repeat: others follow."""
        memory = self.memory
        memory.has_begun = 0.0
        for learnt in (memory.count, memory.usual, memory.still_us, memory.seen, memory.longest):
            learnt[:] = [0.0] * len(learnt)
        for run in (memory.runs, memory.run, memory.run_us, memory.run_moved, memory.accused):
            run[:] = [0.0] * len(run)

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
