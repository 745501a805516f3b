"""The samples of ``identity_velocity_aided.h``, number for number."""

from agreement.identity_noise import Noise

from h2nav.attitude.record import assign, values
from h2nav.attitude.velocity_aided.integer.kernel import start, told
from h2nav.attitude.velocity_aided.integer.memory import Gains, Sample, State

_REST = values(Sample(dt_us=10000, parts=1, fix_variance=20000, fix_period_us=210000), Sample)


class VelocityAidedSamples:
    """Refills one sample from step to step."""

    def __init__(self) -> None:
        self._noise = Noise()
        self._turned = [6400, 0]

    def next_sample(self, sample: Sample, memory: State, step: int) -> None:
        """Writes sample number `step`; all before it must have been written."""
        mode = (step >> 9) % (8 if (step >> 16) & 1 else 3)
        if mode == 0:
            self._still(sample, 10)
            sample.rest_prior = 2 if (step >> 13) & 1 else 1
            sample.has_mag = step & 1
        if mode in (1, 2):
            self._turning(sample)
            sample.has_mag = (step >> 1) & 1
            sample.forward_speed = 2048 if mode == 1 else 0
            sample.aided = int(mode == 2)
            if mode == 2 and step % 21 == 0:
                self._fix(sample, memory, 20)
        if mode == 3:
            self._noise.corners(sample, Sample)
        if mode == 4:
            self._noise.anything(sample, Sample)
        if mode == 6:
            self._disturbed(sample, step)
        if mode == 7:
            self._still(sample, 17)
            sample.has_mag = step & 1
            sample.aided = (step >> 6) & 1
            if step & 7 == 0:
                self._fix(sample, memory, 30 if step & 8 else 20)

    def next_call(self, memory: State, gains: Gains, step: int) -> None:
        """What a program asks of the filter now and then beside its steps."""
        if step % 10007 == 5003:
            told.set_place(memory, gains, 6400, 0, 11085)
        if step % 10007 == 4503:
            north, east, down = (self._noise(16) for _ in range(3))
            told.set_place(memory, gains, north, east, down)
        if step % 10501 == 10500:
            start.restart(memory)

    def _still(self, sample: Sample, bits: int) -> None:
        noise = self._noise
        assign(sample, Sample, _REST)
        for i, force in enumerate((0, 0, -(1 << 20))):
            sample.gyro[i] = noise(bits + 2)
            sample.accel[i] = force + noise(bits + 2)
        sample.mag[:] = [part + noise(6) for part in (*self._turned, 11085)]

    def _turning(self, sample: Sample) -> None:
        self._turned[0] += self._turned[1] >> 7
        self._turned[1] -= self._turned[0] >> 7
        self._still(sample, 14)
        sample.gyro[2] += 858993

    def _fix(self, sample: Sample, memory: State, bits: int) -> None:
        sample.fix_velocity_n = self._noise(bits)
        sample.fix_velocity_e = self._noise(bits)
        sample.fix_accel_n = self._noise(24)
        sample.fix_accel_e = self._noise(24)
        sample.fix_gained_n = memory.gained_n
        sample.fix_gained_e = memory.gained_e
        sample.has_fix = 1

    def _disturbed(self, sample: Sample, step: int) -> None:
        noise = self._noise
        self._turning(sample)
        sample.dt_us = noise(13) + 4096
        sample.has_mag = step & 1
        sample.clipped = int(step & 127 > 100)
        if step & 255 == 7:
            sample.dt_us = 1500000 if step & 1023 == 7 else 30000 + noise(14)
        if step & 15 == 0:
            sample.accel[(step >> 4) & 1] = noise(25)
            sample.mag[(step >> 5) & 1] = noise(16)
            sample.gyro[0] = noise(16) * 65536
