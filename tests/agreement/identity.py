"""What the identity programs compute, by Python integers, for every form of the integer filter."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, Protocol

from agreement import identity_flight, identity_lean

from h2nav.apps.export_forms import FORMS, ExportedForm
from h2nav.attitude.kernels import fixed_flight_layout, fixed_lean
from h2nav.io import gain_files


class Samples(Protocol):
    """Samples that depend on their number and, for fixes, on the filter's memory."""

    def next_sample(self, words: list[int], state: list[int], step: int) -> None: ...

    def next_call(self, state: list[int], params: list[int], step: int) -> None: ...


class Identity(NamedTuple):
    """A form of the filter and the samples that it is compared with.

    Attributes:
        name: of the form.
        gains: shipped gain file.
        samples: maker of the samples in Python.
        header: of the same samples in C.
        layout: of the kernel.
        write_header: writes what the header includes beside the filter.
    """

    name: str
    gains: str
    samples: Callable[[], Samples]
    header: str
    layout: ModuleType
    write_header: Callable[[Path], None]

    @property
    def form(self) -> ExportedForm:
        """What is exported."""
        (found,) = (form for form in FORMS if form.text.name == self.name)
        return found


IDENTITIES = {
    "lean": Identity(
        "lean",
        "mpu9250_100hz",
        identity_lean.LeanSamples,
        "identity_lean.h",
        fixed_lean,
        lambda _folder: None,
    ),
    "flight": Identity(
        "flight",
        "handheld_100hz",
        identity_flight.FlightSamples,
        "identity_flight.h",
        fixed_flight_layout,
        identity_flight.write_words,
    ),
}


class Run(NamedTuple):
    """Result of a run in Python.

    Attributes:
        words: what the identity program prints.
        state: memory at the end.
        bits: how often each bit of the result has been set.
    """

    words: list[str]
    state: list[int]
    bits: dict[int, int]


def run(identity: Identity, steps: int) -> Run:
    """The identity program in Python integers."""
    form = identity.form
    image = form.image(gain_files.load(identity.gains), identity.gains)
    params, state = list(image.params), form.start(image.params)
    samples, words = identity.samples(), [0] * identity.layout.SAMPLE_SIZE
    next_sample, next_call, take = samples.next_sample, samples.next_call, form.step
    mix, seen = 0, dict.fromkeys(range(256), 0)
    for step in range(steps):
        next_sample(words, state, step)
        bits = take(state, params, words)
        seen[bits] += 1
        q_w, q_x, q_y, q_z = state[:4]
        mix = (mix * 16777619 + q_w + 3 * q_x + 5 * q_y + 7 * q_z + bits) & 0xFFFFFFFF
        next_call(state, params, step)
    counts = {1 << i: sum(n for b, n in seen.items() if b >> i & 1) for i in range(8)}
    return Run([f"{word & 0xFFFFFFFF:08x}" for word in (mix, *state)], state, counts)
