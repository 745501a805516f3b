"""The samples of ``identity_flight.h``, number for number."""

from pathlib import Path

from agreement.identity_noise import Noise

from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import fixed_flight_place as place
from h2nav.attitude.kernels import fixed_flight_start as start
from h2nav.attitude.kernels import fixed_motion as motion

WORDS = {
    "RATE": motion.W_X,
    "FORCE": layout.A_X,
    "FIELD": layout.F_FIELD,
    "HAS_FIELD": layout.HAS_FIELD,
    "TIME": motion.DT_US,
    "CLIPPED": layout.CLIPPED,
    "REST": layout.REST,
    "NOSE": layout.NOSE,
    "IS_AIDED": layout.IS_AIDED,
    "HAS_FIX": layout.HAS_FIX,
    "FIX_V": layout.FIX_V,
    "FIX_C": layout.FIX_C,
    "FIX_VARIANCE": layout.FIX_VARIANCE,
    "FIX_PERIOD_US": layout.FIX_PERIOD_US,
    "SAMPLE_SIZE": layout.SAMPLE_SIZE,
    "GAINED": layout.C_N,
}


def write_words(folder: Path) -> None:
    """Writes ``identity_words.h``: places and ranges in a sample, as the kernel declares them."""
    places = "\n".join(f"#define {name} {value}" for name, value in WORDS.items())
    ranges = ", ".join(
        f"{{{low if low > -(1 << 31) else '-2147483647 - 1'}, {high}}}"
        for low, high in layout.SAMPLE_RANGES
    )
    table = f"static const int32_t SAMPLE_RANGES[SAMPLE_SIZE][2] = {{{ranges}}};"
    (folder / "identity_words.h").write_text(f"{places}\n{table}\n")


class FlightSamples:
    """Refills one sample from step to step."""

    def __init__(self) -> None:
        self._noise = Noise()
        self._turned = [6400, 0]

    def next_sample(self, words: list[int], state: list[int], step: int) -> None:
        """Writes sample number `step`; all before it must have been written."""
        noise = self._noise
        mode = (step >> 10) % (8 if (step >> 17) & 1 else 3)
        if mode == 0:
            self._still(words, 10)
            words[layout.REST] = 2 if (step >> 13) & 1 else 1
            words[layout.HAS_FIELD] = step & 1
        if mode in (1, 2):
            self._turning(words)
            words[layout.HAS_FIELD] = (step >> 1) & 1
            words[layout.NOSE] = 2048 if mode == 1 else 0
            words[layout.IS_AIDED] = int(mode == 2)
            if mode == 2 and step % 21 == 0:
                self._fix(words, state, 20)
        if mode == 3:
            words[:] = [lo if noise(4) < 0 else hi for lo, hi in layout.SAMPLE_RANGES]
        if mode == 4:
            words[:] = [noise.anywhere(lo, hi) for lo, hi in layout.SAMPLE_RANGES]
        if mode == 6:
            self._disturbed(words, step)
        if mode == 7:
            self._still(words, 17)
            words[layout.HAS_FIELD] = step & 1
            words[layout.IS_AIDED] = (step >> 6) & 1
            if step & 7 == 0:
                self._fix(words, state, 30 if step & 8 else 20)

    def next_call(self, state: list[int], params: list[int], step: int) -> None:
        """What a program asks of the filter now and then beside its steps."""
        if step % 30011 == 15000:
            place.set_place(state, params, [6400, 0, 11085])
        if step % 30011 == 14000:
            place.set_place(state, params, [self._noise(16) for _ in range(3)])
        if step % 50021 == 50020:
            start.restart(state)

    def _still(self, words: list[int], bits: int) -> None:
        noise = self._noise
        words[:] = [0] * layout.SAMPLE_SIZE
        for i, force in enumerate((0, 0, -(1 << 20))):
            words[motion.W_X + i] = noise(bits + 2)
            words[layout.A_X + i] = force + noise(bits + 2)
        for i, field in enumerate((*self._turned, 11085)):
            words[layout.F_FIELD + i] = field + noise(6)
        words[motion.DT_US] = 10000
        words[layout.FIX_VARIANCE] = 20000
        words[layout.FIX_PERIOD_US] = 210000

    def _turning(self, words: list[int]) -> None:
        self._turned[0] += self._turned[1] >> 7
        self._turned[1] -= self._turned[0] >> 7
        self._still(words, 14)
        words[motion.W_Z] += 858993

    def _fix(self, words: list[int], state: list[int], bits: int) -> None:
        for i in range(2):
            words[layout.FIX_V + i] = self._noise(bits)
            words[layout.FIX_C + i] = state[layout.C_N + i]
        words[layout.HAS_FIX] = 1

    def _disturbed(self, words: list[int], step: int) -> None:
        noise = self._noise
        self._turning(words)
        words[motion.DT_US] = noise(13) + 4096
        words[layout.HAS_FIELD] = step & 1
        words[layout.CLIPPED] = int(step & 127 > 100)
        if step & 255 == 7:
            words[motion.DT_US] = 1500000 if step & 1023 == 7 else 30000 + noise(14)
        if step & 15 == 0:
            words[layout.A_X + ((step >> 4) & 1)] = noise(25)
            words[layout.F_FIELD + ((step >> 5) & 1)] = noise(16)
            words[motion.W_X] = noise(16) * 65536
