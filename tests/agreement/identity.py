"""What the identity programs compute, by Python integers, for every integer filter."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from agreement.identity_constant_gain import ConstantGainSamples
from agreement.identity_velocity_aided import VelocityAidedSamples

from h2nav.apps.export_forms import FORMS, ExportedForm, step_of_any_length
from h2nav.attitude.constant_gain import memory as constant_gain
from h2nav.attitude.constant_gain.kernel import step as constant_gain_step
from h2nav.attitude.record import values
from h2nav.attitude.velocity_aided.integer import memory as velocity_aided
from h2nav.attitude.velocity_aided.integer.kernel import start as velocity_aided_start
from h2nav.files import gain_files


class Samples(Protocol):
    """Samples that depend on their number and, for fixes, on the filter's memory."""

    def next_sample(self, sample: Any, memory: Any, step: int) -> None: ...

    def next_call(self, memory: Any, gains: Any, step: int) -> None: ...


class Identity(NamedTuple):
    """An integer filter and the samples that it is compared with.

    Attributes:
        name: of the filter; its samples in C stand in ``identity_NAME.h``.
        gains: shipped gain file.
        samples: maker of the samples in Python.
        memory_type: record that the filter remembers.
        sample_type: record that it is fed with.
        begin: makes a filter of a memory of zeros, with these gains.
        step: takes one sample of any length; returns bits.
    """

    name: str
    gains: str
    samples: Callable[[], Samples]
    memory_type: type
    sample_type: type
    begin: Callable[[Any, Any], None]
    step: Callable[[Any, Any, Any], int]

    @property
    def form(self) -> ExportedForm:
        """What is exported."""
        (found,) = (form for form in FORMS if form.text.name == self.name)
        return found


IDENTITIES = {
    identity.name: identity
    for identity in (
        Identity(
            "constant_gain",
            "mpu9250_100hz",
            ConstantGainSamples,
            constant_gain.State,
            constant_gain.Sample,
            lambda memory, _gains: constant_gain_step.reset(memory),
            constant_gain_step.update,
        ),
        Identity(
            "velocity_aided",
            "handheld_100hz",
            VelocityAidedSamples,
            velocity_aided.State,
            velocity_aided.Sample,
            velocity_aided_start.reset,
            step_of_any_length,
        ),
    )
}


class Run(NamedTuple):
    """Result of a run in Python.

    Attributes:
        words: what the identity program prints.
        memory: at the end.
        bits: how often each bit of the result has been set.
    """

    words: list[str]
    memory: Any
    bits: dict[int, int]


@functools.cache  # several compilers and boards are compared with the same run
def run(identity: Identity, steps: int) -> Run:
    """The identity program in Python integers."""
    gains = identity.form.image(gain_files.load(identity.gains), identity.gains).gains
    memory, sample = identity.memory_type(), identity.sample_type()
    identity.begin(memory, gains)
    samples = identity.samples()
    next_sample, next_call, take = samples.next_sample, samples.next_call, identity.step
    mix, seen = 0, dict.fromkeys(range(256), 0)
    for step in range(steps):
        next_sample(sample, memory, step)
        bits = take(memory, gains, sample)
        seen[bits] += 1
        q_w, q_x, q_y, q_z = memory.q_nb
        mix = (mix * 16777619 + q_w + 3 * q_x + 5 * q_y + 7 * q_z + bits) & 0xFFFFFFFF
        next_call(memory, gains, step)
    counts = {1 << i: sum(n for b, n in seen.items() if b >> i & 1) for i in range(8)}
    numbers = (mix, *map(int, values(memory, type(memory))))
    return Run([f"{number & 0xFFFFFFFF:08x}" for number in numbers], memory, counts)
