"""The samples of ``identity_lean.h``, number for number."""

from agreement.identity_noise import Noise

from h2nav.attitude.kernels import fixed_lean as kernel

_STILL = (0, 0, 16384, 8192, 0, 14189)


class LeanSamples:
    """Refills one sample from step to step."""

    def __init__(self) -> None:
        self._noise = Noise()

    def next_sample(self, words: list[int], _state: list[int], step: int) -> None:
        """Writes sample number `step`; all before it must have been written."""
        noise = self._noise
        mode = (step >> 10) % 5
        if mode in (0, 4):
            words[:3] = [noise(21) for _ in range(3)]
            words[3:9] = [still + noise(9) for still in _STILL]
            words[9] = noise(1)
            words[10] = 10000
        if mode == 1:
            words[:] = [lo if noise(4) < 0 else hi for lo, hi in kernel.SAMPLE_RANGES]
        if mode == 2:
            words[:3] = [noise(16) * 65536 for _ in range(3)]
            words[3:9] = [noise(16) for _ in range(6)]
            words[9] = noise(1)
            words[10] = noise(13) + 4096
        if mode == 4 and step & 15 == 0:
            words[3:9] = [noise(16) for _ in range(6)]

    def next_call(self, state: list[int], params: list[int], step: int) -> None:
        """Nothing beside the steps."""
