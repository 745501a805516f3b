"""The samples of ``identity_constant_gain.h``, number for number."""

from agreement.identity_noise import Noise

from h2nav.attitude.constant_gain.memory import Gains, Sample, State


class ConstantGainSamples:
    """Refills one sample from step to step."""

    def __init__(self) -> None:
        self._noise = Noise()

    def next_sample(self, sample: Sample, _state: State, step: int) -> None:
        """Writes sample number `step`; all before it must have been written."""
        noise = self._noise
        mode = (step >> 9) % 5
        if mode in (0, 4):
            sample.gyro[:] = [noise(21) for _ in range(3)]
            sample.gravity[:] = [part + noise(9) for part in (0, 0, 16384)]
            sample.mag[:] = [part + noise(9) for part in (8192, 0, 14189)]
            sample.has_mag = noise(1)
            sample.dt_us = 10000
        if mode == 1:
            noise.corners(sample, Sample)
        if mode == 2:
            sample.gyro[:] = [noise(16) * 65536 for _ in range(3)]
            self._spikes(sample)
            sample.has_mag = noise(1)
            sample.dt_us = noise(13) + 4096
        if mode == 4 and step & 15 == 0:
            self._spikes(sample)

    def next_call(self, memory: State, gains: Gains, step: int) -> None:
        """Nothing beside the steps."""

    def _spikes(self, sample: Sample) -> None:
        sample.gravity[:] = [self._noise(16) for _ in range(3)]
        sample.mag[:] = [self._noise(16) for _ in range(3)]
