"""The samples of ``identity_samples.h``, number for number."""

from collections.abc import Iterator

from h2nav.attitude.kernels import fixed_lean as kernel

_STILL = (0, 0, 16384, 8192, 0, 14189)


def samples(count: int) -> Iterator[list[int]]:
    """The first `count` samples; the same list object, refilled."""
    seed = 1

    def noise(bits: int) -> int:
        nonlocal seed
        seed = (seed * 1664525 + 1013904223) & 0xFFFFFFFF
        return ((seed >> 8) & ((1 << bits) - 1)) - (1 << (bits - 1))

    words = [0] * kernel.SAMPLE_SIZE
    for step in range(count):
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
        yield words
