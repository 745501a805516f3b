"""Rates and forces of samples that do not come evenly, as filters take them.

A filter takes a rate as the mean over the step before its sample, and a force likewise. Of a step
that is as long as all others that is half a step early, which the lead of the attitude allows for
(docs/filter.md Eq. 41). Of a step twice as long it is the rate at the wrong time: a loop of 50 Hz
that is asked for 40 messages a second sends steps of 20, 20, 20 and 40 ms, and links lose samples.
"""

from h2nav.attitude.samples import ImuSample, Vec3

# Of the usual step: one that differs by less is even. Stamps in whole milliseconds, and those of
# the time of sending, differ by as much while the sensor does not.
EVEN_SHARE = 0.25
# Within a shorter step hardly anything changes but the noise.
SHORTEST_SHARE = 0.5
# A longer step is a gap, over which filters have means of their own.
LONGEST_STEP_S = 0.15
NO_FORCE: Vec3 = (0.0, 0.0, 0.0)


class UnevenSteps:
    """Replaces the values of samples at the ends of uneven steps."""

    def __init__(self) -> None:
        self._before: ImuSample | None = None

    def restart(self) -> None:
        """Forgets the sample before."""
        self._before = None

    def as_even(self, sample: ImuSample, period_s: float | None) -> ImuSample:
        """The sample with rate and force for its step, half a usual step ahead of its mean.

        Args:
            sample: the next one.
            period_s: the usual step, s; None while unknown.

        Returns:
            The same sample where the step is even, or nothing is known of it.

        Source: docs/filter.md Eq. (77).
        """
        before, self._before = self._before, sample
        if before is None or period_s is None:
            return sample
        step_s = (sample.t_us - before.t_us) * 1e-6
        excess_s = step_s - period_s
        if -EVEN_SHARE * period_s < excess_s < EVEN_SHARE * period_s:
            return sample
        if not SHORTEST_SHARE * period_s < step_s <= LONGEST_STEP_S:
            return sample
        if sample.clipped or before.clipped:
            return sample
        share = 0.5 * excess_s / step_s
        force = sample.f_b
        if NO_FORCE not in (force, before.f_b):
            force = _towards(force, before.f_b, share)
        return sample._replace(w_b=_towards(sample.w_b, before.w_b, share), f_b=force)


def _towards(now: Vec3, before: Vec3, share: float) -> Vec3:
    (x, y, z), (u, v, w) = now, before
    return x - share * (x - u), y - share * (y - v), z - share * (z - w)
