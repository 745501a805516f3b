"""The numbers of ``identity_noise.h``."""


class Noise:
    """A generator that every machine can repeat."""

    def __init__(self) -> None:
        self._seed = 1

    def __call__(self, bits: int) -> int:
        """From -2^(bits-1) to 2^(bits-1) - 1."""
        self._seed = (self._seed * 1664525 + 1013904223) & 0xFFFFFFFF
        shift = 32 - bits if bits > 24 else 8
        return ((self._seed >> shift) & ((1 << bits) - 1)) - (1 << (bits - 1))

    def anywhere(self, low: int, high: int) -> int:
        """From low to high."""
        self._seed = (self._seed * 1664525 + 1013904223) & 0xFFFFFFFF
        return low + ((self._seed * (high - low + 1)) >> 32)
