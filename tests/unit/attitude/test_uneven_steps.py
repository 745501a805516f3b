"""Samples that do not come evenly, as filters take them."""

import itertools
import math

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.attitude.uneven_steps import LONGEST_STEP_S, UnevenSteps

PERIOD_S = 0.02
# A loop of 50 Hz that is asked for 40 messages a second.
STEPS_US = (20_000, 20_000, 20_000, 40_000)
SWAY_RAD_S, SWAY_HZ = 0.6, 2.5


def swaying(t_us, **changed):
    """A sample of a body that sways about y, with a force along z that does too."""
    phase = 2.0 * math.pi * SWAY_HZ * t_us * 1e-6
    rate, force = SWAY_RAD_S * math.sin(phase), -10.0 + 5.0 * math.cos(phase)
    return ImuSample(t_us, (0.0, rate, 0.0), (0.0, 0.0, force))._replace(**changed)


def flown(count):
    """Samples as they come, and as a filter takes them."""
    times = itertools.accumulate(itertools.islice(itertools.cycle(STEPS_US), count), initial=0)
    came, uneven = [swaying(t_us) for t_us in times], UnevenSteps()
    return came, [uneven.as_even(sample, PERIOD_S) for sample in came]


def summed(samples, part):
    """What a filter integrates of them, at each."""
    steps = itertools.pairwise(samples)
    return list(itertools.accumulate((b.t_us - a.t_us) * 1e-6 * part(b) for a, b in steps))


@pytest.mark.parametrize("part", [lambda s: s.w_b[1], lambda s: s.f_b[2]], ids=["rate", "force"])
def test_what_is_integrated_is_always_half_a_step_ahead(part):
    """Of the straight lines between the samples, whatever the steps."""
    came, taken = flown(200)
    lines = itertools.accumulate(
        0.5 * (b.t_us - a.t_us) * 1e-6 * (part(a) + part(b)) for a, b in itertools.pairwise(came)
    )
    ahead = [0.5 * PERIOD_S * (part(sample) - part(came[0])) for sample in came[1:]]
    expected = [line + more for line, more in zip(lines, ahead, strict=True)]
    assert summed(taken, part) == pytest.approx(expected, abs=1e-12)


def test_a_sway_between_long_and_short_steps_drifts_less():
    came, taken = flown(400)
    turn_rad = [
        SWAY_RAD_S / (2.0 * math.pi * SWAY_HZ) * (1.0 - math.cos(2e-6 * math.pi * SWAY_HZ * t_us))
        for t_us in (sample.t_us for sample in came[1:])
    ]

    def worst_rad(samples):
        ahead = [0.5 * PERIOD_S * sample.w_b[1] for sample in came[1:]]
        sums = summed(samples, lambda sample: sample.w_b[1])
        return max(abs(a - b - c) for a, b, c in zip(sums, turn_rad, ahead, strict=True))

    assert worst_rad(taken) < 0.4 * worst_rad(came)


@pytest.mark.parametrize(
    ("before", "after", "period_s"),
    [
        (swaying(0), swaying(24_500), PERIOD_S),
        (swaying(0), swaying(40_000), None),
        (swaying(0), swaying(1_000), PERIOD_S),
        (swaying(0), swaying(round((LONGEST_STEP_S + 0.01) * 1e6)), PERIOD_S),
        (swaying(0, clipped=True), swaying(40_000), PERIOD_S),
        (swaying(0), swaying(40_000, clipped=True), PERIOD_S),
    ],
    ids=["even", "no-period", "at-once", "gap", "clipped-before", "clipped"],
)
def test_left_as_it_is(before, after, period_s):
    uneven = UnevenSteps()
    assert uneven.as_even(before, period_s) is before
    assert uneven.as_even(after, period_s) is after


def test_after_a_restart_nothing_is_known_of_the_step():
    uneven = UnevenSteps()
    uneven.as_even(swaying(0), PERIOD_S)
    uneven.restart()
    assert uneven.as_even(swaying(40_000), PERIOD_S) == swaying(40_000)


@pytest.mark.parametrize("missing", [0, 1], ids=["before", "now"])
def test_a_force_that_is_none_is_not_mixed(missing):
    forces = [{}, {}]
    forces[missing] = {"f_b": (0.0, 0.0, 0.0)}
    uneven = UnevenSteps()
    uneven.as_even(swaying(0, **forces[0]), PERIOD_S)
    sample = swaying(40_000, **forces[1])
    taken = uneven.as_even(sample, PERIOD_S)
    assert taken.f_b == sample.f_b
    assert taken.w_b != sample.w_b
