"""Smooths an attitude after the flight: any filter run forward, backward and forward again.

The first run estimates what does not depend on the direction of time: the biases of gyro and
accelerometer, and the delays of field and velocities. All of it is removed from the inputs of the
other two runs, whose filters are new. The smoothed attitude is the mean of these two, from past and
future, weighted by the errors that each predicts.

Equations: docs/filter.md.
"""

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from h2nav.attitude.batch_driver import BatchSamples, Floats, Integers, Mask
from h2nav.attitude.filter import AttitudeFilter, InputRecord, LastingInput, TimedInput, pass_on
from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.native import compiled_step
from h2nav.attitude.record import is_in_c
from h2nav.attitude.samples import (
    TRUST_OF,
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided.batch import PreparedSamples, trust_of
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.shell import MAX_RATE_RAD_S
from h2nav.maths import columns
from h2nav.maths.columns import Quats, each, larger
from h2nav.maths.quaternion import conjugate, multiply, rotate

# After a longer gap the attitude is unknown: the parts before and after are smoothed separately.
LONGEST_GAP_US = 1_000_000
# A fix is passed this long after its time: then the filter's past covers it.
FIX_DELAY_US = 50_000
# Errors shared by the runs do not average out: 1 mg of accelerometer bias, 0.06 deg of the
# vertical. Nothing is known better than the vertical to which it refers.
MIN_SIGMA_RAD = 1e-3
# Between runs whose verticals are further apart than so many deviations of both, and than this, the
# motion has a break: a knock, a tumble beyond the gyro's range or a cut.
BREAK_SIGMAS = 5.0
MIN_BREAK_RAD = math.radians(5.0)
# A heading is tied to north for this long after the run said so; some say so only with a field.
REFERENCED_US = 1_000_000

# Of arithmetic: the root of a negative variance is a ValueError.
_FAILURES = (ArithmeticError, ValueError)
# As numbers, for columns.
_CONVERGED, _RESTARTED = int(Trust.CONVERGED), int(Trust.RESTARTED)
_REFERENCED, _REST = int(Trust.YAW_REFERENCED), int(Trust.REST)
_KNOWN_BY_EITHER = _CONVERGED | _REFERENCED

# (N,) predicted deviations, rad, and (N,) whether they are known.
_Deviation = tuple[Floats, Mask]
FilterMaker = Callable[[], AttitudeFilter]


class Given(NamedTuple):
    """A filter's inputs between two restarts.

    Attributes:
        samples: in order.
        inputs: in order, with the number of the sample that each record precedes.
    """

    samples: BatchSamples
    inputs: Sequence[tuple[int, InputRecord]]


class Smoothed(NamedTuple):
    """The smoothed attitudes of a stretch, one row per sample; NaN where there is none.

    Attributes:
        t_us: (N,) time of the sample.
        q_nb: (4, N) attitude, body to NED, scalar first.
        w_b: (3, N) angular rate corrected for bias, rad/s.
        bias_b: (3, N) gyro bias, rad/s.
        sigma_tilt_rad: (N,) predicted deviation of the tilt; also NaN where it is unknown.
        sigma_heading_rad: (N,) of the heading; the same.
        trust: (N,) `Trust` as numbers.
        is_known: (N,) whether there is an attitude.
    """

    t_us: Integers
    q_nb: Floats
    w_b: Floats
    bias_b: Floats
    sigma_tilt_rad: Floats
    sigma_heading_rad: Floats
    trust: Integers
    is_known: Mask

    def at(self, rows: Integers | Mask | slice) -> "Smoothed":
        """The rows of some samples."""
        return tuple.__new__(Smoothed, (column[..., rows] for column in self))

    def estimates(self) -> Iterator[AttitudeEstimate | None]:
        """The attitudes one by one, without an innovation."""
        numbers = np.vstack((self.q_nb, self.w_b, self.bias_b)).T.tolist()
        sigmas = np.stack((self.sigma_tilt_rad, self.sigma_heading_rad), axis=1).tolist()
        rows = zip(self.is_known.tolist(), self.t_us.tolist(), self.trust.tolist(), strict=True)
        for (is_known, t_us, trust), found, (tilt, heading) in zip(
            rows, numbers, sigmas, strict=True
        ):
            a, b, c, d, p, q, r, x, y, z = found
            yield (
                AttitudeEstimate(
                    *(t_us, (a, b, c, d), (p, q, r), (x, y, z), _NO_INNOVATION),
                    *(tilt, TRUST_OF[trust], heading),
                )
                if is_known
                else None
            )


_NO_INNOVATION = (math.nan, math.nan, math.nan)


@runtime_checkable
class KnowsSensors(Protocol):
    """A filter with estimates of its sensors' errors.

    It uses a field that is held for some samples only when it is new.
    """

    @property
    def sensor_errors(self) -> SensorErrors:
        """The errors of the sensors estimated so far."""

    def know_sensors(self, errors: SensorErrors, walked_s: float) -> None:
        """Starts with sensors whose errors are corrected, known as well as so long ago.

        Args:
            errors: with their variances.
            walked_s: time during which the errors have changed since.
        """


Input = TypeVar("Input", bound=InputRecord)
# Inputs with the number of the sample that each precedes.
Placed = list[tuple[int, Input]]


class _Piece(NamedTuple):
    """Samples without a long gap, with the other inputs.

    Attributes:
        samples: in the run's order.
        lasting: each until the next one of its kind; those of a kind are in order.
        timed: in order.
    """

    samples: BatchSamples
    lasting: Placed[LastingInput]
    timed: Placed[TimedInput]

    @property
    def inputs(self) -> Placed[InputRecord]:
        """All of them in the order in which a filter takes them."""
        return sorted((*_changes(self.lasting), *self.timed), key=lambda one: one[0])

    def lasting_of(self, kind: type[Input]) -> Placed[Input]:
        """Those of one kind."""
        return [(row, what) for row, what in self.lasting if isinstance(what, kind)]


class _Learnt(NamedTuple):
    """The result of a run for the next one.

    Attributes:
        bias_b: gyro bias, rad/s.
        errors: other errors of the sensors; None if not estimated.
    """

    bias_b: Vec3 = (0.0, 0.0, 0.0)
    errors: SensorErrors | None = None


class _Run(NamedTuple):
    """A run's results, one row per sample in the order of the samples' own times.

    Attributes:
        found: its attitudes.
        is_referenced: (N,) the heading is tied to north.
    """

    found: Smoothed
    is_referenced: Mask

    def at(self, rows: Integers) -> "_Run":
        """The rows of some samples."""
        return _Run(self.found.at(rows), self.is_referenced[rows])


def smooth(stretches: Iterable[Given], make: FilterMaker) -> list[Smoothed]:
    """The results of `smoothed`."""
    return list(smoothed(stretches, make))


def smoothed(
    stretches: Iterable[Given],
    make: FilterMaker,
    left_out: Callable[[int], object] = lambda count: None,
) -> Iterator[Smoothed]:
    """Yields the smoothed attitudes of every stretch.

    There is none where neither direction has an estimate: in stretches too short to align in, and
    in pieces whose arithmetic fails. The heading is the forward run's unless the backward run's is
    tied to north. As in the service, the attitudes are propagated by the given delay of the rates.

    Args:
        stretches: in order of time; the first run keeps its bias from one to the next.
        make: creates the filter of this vehicle; called for each run.
        left_out: takes the number of samples of a piece whose arithmetic failed.

    Source: docs/filter.md Eq. (42), (50) - (56).
    """
    first = make()
    learnt = _Learnt()
    for given in stretches:
        first.restart()
        found = [_empty(given.samples.t_us[:0])]
        for piece in _pieces(given):
            try:
                learnt = _learnt_from(first, piece, learnt)
                found.append(_extrapolated(_smooth_piece(piece, make, learnt), piece))
            except _FAILURES:
                first = make()
                left_out(len(piece.samples.t_us))
                found.append(_empty(piece.samples.t_us))
        parts = zip(*found, strict=True)
        yield tuple.__new__(Smoothed, (np.concatenate(each, axis=-1) for each in parts))


def _empty(t_us: Integers) -> Smoothed:
    """No attitudes at these times."""
    count = len(t_us)
    q_nb, w_b, bias_b = (np.full((size, count), math.nan) for size in (4, 3, 3))
    tilt, heading = np.full(count, math.nan), np.full(count, math.nan)
    trust, is_known = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    return Smoothed(t_us, q_nb, w_b, bias_b, tilt, heading, trust, is_known)


def _learnt_from(first: AttitudeFilter, piece: _Piece, learnt: _Learnt) -> _Learnt:
    """What the first run shows."""
    found = _run(first, piece)
    bias_b = _shown(_Run(found, _is_referenced(found)), learnt.bias_b)
    errors = first.sensor_errors if isinstance(first, KnowsSensors) else learnt.errors
    return _Learnt(bias_b, errors)


def _smooth_piece(piece: _Piece, make: FilterMaker, learnt: _Learnt) -> Smoothed:
    """The second and the third run, combined."""
    samples = piece.samples
    placed = piece._replace(lasting=_known_from_the_start(piece))
    chosen = _prepared(make, piece, learnt)
    turned = _run(chosen, _reversed(_without(placed, learnt))).at(slice(None, None, -1))
    found = _of_samples(turned, samples, learnt.bias_b, -1.0)
    backward = _Run(found, _is_referenced(found, is_backward=True))
    learnt = learnt._replace(bias_b=_shown(backward, learnt.bias_b, is_backward=True))
    if learnt.errors is not None and isinstance(chosen, KnowsSensors):
        learnt = learnt._replace(errors=_both(learnt.errors, chosen.sensor_errors))
    found = _run(_prepared(make, piece, learnt), _without(placed, learnt))
    found = _of_samples(found, samples, learnt.bias_b, 1.0)
    return _combined(_Run(found, _is_referenced(found)), backward)


def _prepared(make: FilterMaker, piece: _Piece, learnt: _Learnt) -> AttitudeFilter:
    """A new filter for samples with the errors removed.

    The previous run estimated the errors from the same samples, so its certainty does not count in
    full: the random walk over their whole time is added. Source: docs/filter.md Eq. (51).
    """
    chosen = make()
    if learnt.errors is not None and isinstance(chosen, KnowsSensors):
        first_us, last_us = piece.samples.t_us[[0, -1]].tolist()
        chosen.know_sensors(learnt.errors, (last_us - first_us) * 1e-6)
    return chosen


def _both(errors: SensorErrors, more: SensorErrors) -> SensorErrors:
    """The combined errors of two runs, the second one backward on the corrected samples.

    Latencies stay those of the first: the rest would be negative backward.
    """
    x, y, z = (a + b for a, b in zip(errors.force_bias_b, more.force_bias_b, strict=True))
    return more._replace(
        force_bias_b=(x, y, z),
        field_latency_s=errors.field_latency_s,
        fix_latency_s=errors.fix_latency_s,
    )


def _shown(run: _Run, before_b: Vec3, *, is_backward: bool = False) -> Vec3:
    """The gyro's bias at the end of a run as far as it was observed, rad/s.

    Gravity shows the bias that turns the vertical; a heading tied to north, or rest, shows the part
    about it. Without either that part keeps its value from before the run.

    Args:
        run: its results.
        before_b: bias before the run, rad/s.
        is_backward: it ended with the first sample.

    Source: docs/filter.md Eq. (70).
    """
    rows = np.flatnonzero(run.found.is_known)[:: -1 if is_backward else 1]
    if not len(rows):
        return before_b
    x, y, z = run.found.bias_b[:, rows[-1]].tolist()
    rests = (run.found.trust[rows] & _REST) > 0
    if rests.any() or run.is_referenced[rows].any():
        return x, y, z
    w, a, b, c = run.found.q_nb[:, rows]
    # Shorter than 1 if the vehicle has tilted: no axis was vertical throughout.
    down_b = (
        2.0 * (a * c - w * b),
        2.0 * (b * c + w * a),
        np.stack((w * w, -(a * a), -(b * b), c * c), axis=1).ravel(),
    )
    # Added one by one, in the order of the run.
    north, east, down = (float(np.cumsum(part)[-1]) / len(rows) for part in down_b)
    p, q, r = x - before_b[0], y - before_b[1], z - before_b[2]
    hidden = p * north + q * east + r * down
    return x - hidden * north, y - hidden * east, z - hidden * down


def _extrapolated(found: Smoothed, piece: _Piece) -> Smoothed:
    """The attitudes at their nominal times. Source: docs/filter.md Eq. (42)."""
    late_s, delays = np.zeros(len(found.t_us)), piece.lasting_of(SensorDelays)
    ends = [row for row, _ in delays[1:]]
    for (first, late), stop in zip(delays, [*ends, len(late_s)], strict=False):
        late_s[first:stop] = late.gyro_s
    rows = np.flatnonzero(found.is_known & (late_s != 0.0))
    x, y, z = found.w_b[:, rows] * late_s[rows]
    led = multiply(_quats(found.at(rows)), columns.exp((x, y, z)))
    found.q_nb[:, rows] = columns.normalize(led)
    return found


def _pieces(given: Given) -> Iterator[_Piece]:
    """A stretch, cut at its gaps; what lasts holds after a gap, too."""
    t_us = given.samples.t_us
    inputs = iter(given.inputs)
    following = next(inputs, None)
    lasting: Placed[LastingInput] = [(0, VehicleState())]
    starts = [0, *(1 + np.flatnonzero(np.diff(t_us) > LONGEST_GAP_US)).tolist()]
    for start, stop in zip(starts, [*starts[1:], len(t_us)], strict=True):
        if start == stop:
            return
        # the last of each kind
        lasting = [(0, what) for what in {type(what): what for _, what in lasting}.values()]
        timed: Placed[TimedInput] = []
        row = 0
        while following is not None and following[0] < stop:
            row, what = max(row, following[0] - start), following[1]
            if isinstance(what, LastingInput):
                lasting.append((row, what))
            else:
                timed.append((row, what))
            following = next(inputs, None)
        yield _Piece(given.samples.part(start, stop), lasting, timed)


def _changes(lasting: Placed[LastingInput]) -> Iterator[tuple[int, LastingInput]]:
    """The last one of each kind and row, if it differs from that before."""
    before: dict[type, LastingInput] = {}
    for (row, kind), what in {(row, type(what)): what for row, what in lasting}.items():
        if before.get(kind) != what:
            yield row, what
        before[kind] = what


def _run(chosen: AttitudeFilter, piece: _Piece) -> Smoothed:
    """A run's results."""
    step = compiled_step(VELOCITY_AIDED)
    # Filters of another kind, or in Python, are called sample by sample.
    if step is None or type(chosen) is not VelocityAidedFilter or not is_in_c(chosen.kernel_state):
        return _told(chosen, piece, None)
    before = chosen.state()
    prepared = PreparedSamples(step, chosen, piece.samples)
    found, taken = _told(chosen, piece, prepared.run), prepared.results[prepared.are_taken].T
    if not np.isfinite(taken[:4]).all():
        chosen.restore(before)
        return _told(chosen, piece, None)
    found.q_nb[:, prepared.are_taken] = taken[:4]
    found.bias_b[:, prepared.are_taken] = taken[4:7]
    found.w_b[:, prepared.are_taken] = piece.samples.gyr[prepared.are_taken].T - taken[4:7]
    found.trust[prepared.are_taken] = trust_of(taken[7])
    found.sigma_tilt_rad[prepared.are_taken] = taken[8]
    found.sigma_heading_rad[prepared.are_taken] = taken[9]
    found.is_known[prepared.are_taken] = True
    return found


def _told(chosen: AttitudeFilter, piece: _Piece, run: Callable[[int, int], int] | None) -> Smoothed:
    """Passes samples and inputs to a filter in order; the results of its own interface.

    Args:
        run: passes samples from one on, at most to another, in another way; returns the end of
            these, and the filter has to take the next one itself. None: it takes all.
    """
    samples, count = piece.samples, len(piece.samples.t_us)
    found: list[tuple[int, AttitudeEstimate]] = []
    first = 0
    for row, what in (*piece.inputs, (count, None)):
        stop = min(row, count)
        while first < stop:
            begun = first if run is None else run(first, stop)
            first = stop if run is None else min(begun + 1, stop)
            for number, sample in enumerate(samples.part(begun, first).records(), begun):
                estimate = _update(chosen, sample)
                if estimate is not None:
                    found.append((number, estimate))
        if what is not None and row < count:
            pass_on(chosen, what)
    return _in_columns(samples.t_us, found)


def _in_columns(t_us: Integers, found: Sequence[tuple[int, AttitudeEstimate]]) -> Smoothed:
    """Estimates of some samples."""
    result, rows = _empty(t_us), [row for row, _ in found]
    if rows:
        _, q_nb, w_b, bias_b, _, tilt, trust, heading = zip(*(one for _, one in found), strict=True)
        result.q_nb[:, rows], result.w_b[:, rows] = np.array(q_nb).T, np.array(w_b).T
        result.bias_b[:, rows], result.trust[rows] = np.array(bias_b).T, np.array(trust, np.int64)
        result.sigma_tilt_rad[rows], result.sigma_heading_rad[rows] = tilt, heading
        result.is_known[rows] = True
    return result


def _update(chosen: AttitudeFilter, sample: ImuSample) -> AttitudeEstimate | None:
    """A finite estimate, or None, after which the filter restarts, as in the service."""
    try:
        estimate = chosen.update(sample)
    except ArithmeticError:
        estimate = None
    else:
        if estimate is None or math.isfinite(sum(estimate.q_nb)):
            return estimate
    chosen.restart()
    return None


def _known_from_the_start(piece: _Piece) -> Placed[LastingInput]:
    """Without delays, and with the first known earth field also for the samples before it."""
    first = [(0, field) for _, field in piece.lasting_of(EarthField)[:1]]
    return [*first, *(one for one in piece.lasting if not isinstance(one[1], SensorDelays))]


def _without(piece: _Piece, learnt: _Learnt) -> _Piece:
    """The piece without biases and latencies.

    Source: docs/filter.md Eq. (50).
    """
    samples, errors = piece.samples, learnt.errors
    w_b = samples.gyr - learnt.bias_b
    if errors is None:
        return piece._replace(samples=samples._replace(gyr=w_b))
    # A force of exactly zero is no measurement, and stays.
    is_force = (samples.acc != 0.0).any(axis=1)[:, None]
    f_b = np.where(is_force, samples.acc - errors.force_bias_b, samples.acc)
    is_new, m_b_ut = samples.has_field.copy(), samples.mag.copy()
    rows = np.flatnonzero(is_new)
    fields = m_b_ut[rows]
    is_new[rows[1:]] = (fields[1:] != fields[:-1]).any(axis=1)
    rows = np.flatnonzero(is_new)
    m_b_ut[rows] = _timely(m_b_ut[rows], w_b[rows], errors.field_latency_s)
    late_us = round(errors.fix_latency_s * 1e6)
    timed = (
        what._replace(t_us=what.t_us - late_us) if isinstance(what, VelocityFix) else what
        for _, what in piece.timed
    )
    return piece._replace(
        samples=samples._replace(gyr=w_b, acc=f_b, mag=m_b_ut, has_field=is_new),
        timed=_placed(timed, samples.t_us),
    )


def _timely(m_b_ut: Floats, w_b: Floats, late_s: float) -> Floats:
    """(N, 3) fields at the times of the samples that carried them."""
    # A filter refuses what is not finite. No sensor has a rate of half a turn within the delay.
    with np.errstate(invalid="ignore"):
        is_slow = late_s * each(math.hypot, *w_b.T) < math.pi
        x, y, z = w_b[is_slow].T
        (a, b, c), turn = m_b_ut[is_slow].T, columns.exp((-late_s * x, -late_s * y, -late_s * z))
        m_b_ut[is_slow] = np.stack(rotate(turn, (a, b, c)), axis=1)
    return m_b_ut


def _placed(timed: Iterable[TimedInput], t_us: Integers) -> Placed[TimedInput]:
    """Inputs in the order of their times, each with the number of the sample that it precedes."""
    times_us = t_us.tolist()
    return [
        (bisect_left(times_us, what.t_us + FIX_DELAY_US) + 1, what)
        for what in sorted(timed, key=lambda what: what.t_us)
    ]


def _reversed(piece: _Piece) -> _Piece:
    """A piece without biases and latencies with time reversed.

    Its times are mirrored about their middle. A rate is the mean since the previous sample;
    reversed it leads to that one. Forces and fields stay as they are; each other input says how it
    looks.

    Source: docs/filter.md Eq. (52), (53).
    """
    samples = piece.samples.part(None, None, -1)
    ends_us = int(samples.t_us[0] + samples.t_us[-1])
    late = np.concatenate((samples.gyr[:1], samples.gyr[:-1]))
    are_clipped = samples.clipped.copy()
    are_clipped[1:] |= samples.clipped[:-1]
    turned = samples._replace(t_us=ends_us - samples.t_us, gyr=-late, clipped=are_clipped)
    timed = (what.backward()._replace(t_us=ends_us - what.t_us) for _, what in piece.timed)
    count = len(samples.t_us)
    lasting: Placed[LastingInput] = []
    ends: dict[type, int] = {}
    for row, what in piece.lasting[::-1]:  # each begins where it ended
        lasting.append((count - ends.get(type(what), count), what.backward()))
        ends[type(what)] = row
    return _Piece(turned, lasting, _placed(timed, turned.t_us))


def _of_samples(found: Smoothed, samples: BatchSamples, bias_b: Vec3, direction: float) -> Smoothed:
    """Converts a run's results to those of the original samples.

    Args:
        found: in the order of the samples.
        samples: with their own times and rates.
        bias_b: removed from the run's rates, rad/s.
        direction: of the run's time: 1 forward, -1 backward.
    """
    bias = np.array(bias_b)[:, None] + direction * found.bias_b
    w_b = samples.gyr.T - bias
    is_used = np.abs(w_b[0]) + np.abs(w_b[1]) + np.abs(w_b[2]) < MAX_RATE_RAD_S
    w_b = np.where(is_used, w_b, direction * found.w_b)
    return found._replace(t_us=samples.t_us, w_b=w_b, bias_b=bias)


def _is_referenced(found: Smoothed, *, is_backward: bool = False) -> Mask:
    """(N,) whether the heading of each is tied to north, at present or a moment ago in the run."""
    result = np.zeros(len(found.t_us), np.bool_)
    rows = np.flatnonzero(found.is_known)[:: -1 if is_backward else 1]
    says_so = (found.trust[rows] & _REFERENCED) > 0
    latest = np.maximum.accumulate(np.where(says_so, np.arange(len(rows)), -1))
    t_us = found.t_us[rows]
    result[rows] = (latest >= 0) & (np.abs(t_us - t_us[latest]) < REFERENCED_US)
    return result


def _combined(forward: _Run, backward: _Run) -> Smoothed:
    """Combines both runs; where one has no estimate, the other alone."""
    ahead, back = forward.found, backward.found
    parts = zip(ahead, back, strict=True)
    chosen = (np.where(ahead.is_known, one, other) for one, other in parts)
    found: Smoothed = tuple.__new__(Smoothed, chosen)
    both = np.flatnonzero(ahead.is_known & back.is_known)
    mean = _mean(forward.at(both), backward.at(both))
    for whole, part in zip(found, mean, strict=True):
        whole[..., both] = part
    begun = np.flatnonzero(ahead.is_known)[:1]
    if len(begun) and back.is_known[begun[0]] and not backward.is_referenced[begun[0]]:
        _turn_all(found, back, int(begun[0]))
    return found._replace(is_known=ahead.is_known | back.is_known)


def _turn_all(found: Smoothed, back: Smoothed, begun: int) -> None:
    """Turns the backward run's attitudes before the forward run's first to its heading.

    In the backward run alone, a heading not tied to north is arbitrary.
    """
    first = slice(begun, begun + 1)
    angle, none, _ = _apart(_quats(back.at(first)), _quats(found.at(first)))
    turn = columns.exp((0.0 * none, 0.0 * none, angle))
    found.q_nb[:, :begun] = multiply(turn, _quats(found.at(slice(begun))))


def _mean(ahead: _Run, back: _Run) -> Smoothed:
    """The weighted mean of two results of the same samples.

    Source: docs/filter.md Eq. (54) - (56).
    """
    f, b = ahead.found, back.found
    q = _quats(f)
    heading, north, east = _apart(q, _quats(b))
    ahead_tilt, back_tilt = (f.sigma_tilt_rad, _knows_tilt(f)), (b.sigma_tilt_rad, _knows_tilt(b))
    apart = each(math.hypot, north, east)
    tilt_share, tilt_sigma = _share(ahead_tilt, back_tilt, apart)
    heading_share, heading_sigma = _share(
        (f.sigma_heading_rad, ahead.is_referenced),
        (b.sigma_heading_rad, back.is_referenced),
        heading,
    )
    # What comes later is not carried across a break; the deviations keep both.
    is_broken = _is_broken(ahead_tilt, back_tilt, apart)
    tilt_share, heading_share = (
        np.where(is_broken, 0.0, share) for share in (tilt_share, heading_share)
    )
    none = np.zeros(len(f.t_us))
    tilted = multiply(columns.exp((tilt_share * north, tilt_share * east, none)), q)
    turn = columns.exp((none, none, heading_share * heading))
    return f._replace(
        q_nb=np.stack(columns.normalize(multiply(turn, tilted))),
        sigma_tilt_rad=tilt_sigma,
        sigma_heading_rad=heading_sigma,
        trust=f.trust | (b.trust & _KNOWN_BY_EITHER),
    )


def _quats(found: Smoothed) -> Quats:
    """The attitudes, by part."""
    w, x, y, z = found.q_nb
    return w, x, y, z


def _is_broken(forward: _Deviation, backward: _Deviation, apart_rad: Floats) -> Mask:
    """(N,) whether a break of the motion lies between two runs, by their verticals.

    Args:
        forward: predicted deviation of the tilt, rad, and whether it is known.
        backward: the same.
        apart_rad: angle between them.

    Source: docs/filter.md, section 12.
    """
    (sigma_f, knows_f), (sigma_b, knows_b) = forward, backward
    most = larger(BREAK_SIGMAS * each(math.hypot, sigma_f, sigma_b), MIN_BREAK_RAD)
    # False for deviations that are not predicted.
    is_broken: Mask = knows_f & knows_b & (apart_rad > most)
    return is_broken


def _knows_tilt(found: Smoothed) -> Mask:
    """False at an alignment, whose predicted deviation ignores the force's own error."""
    is_predicted = ~np.isnan(found.sigma_tilt_rad) | ((found.trust & _CONVERGED) > 0)
    knows: Mask = is_predicted & ((found.trust & _RESTARTED) == 0)
    return knows


def _apart(q: Quats, other: Quats) -> tuple[Floats, Floats, Floats]:
    """The turn in n from one attitude to another: about down, after one about north and east.

    Separate at every angle: an arbitrary heading must not mix into the tilt.
    Source: docs/filter.md Eq. (54).
    """
    difference = multiply(other, conjugate(q))
    heading = each(math.remainder, 2.0 * each(math.atan2, difference[3], difference[0]), math.tau)
    none = np.zeros(len(heading))
    north, east, _ = columns.log(multiply(columns.exp((none, none, -heading)), difference))
    return heading, north, east


def _share(forward: _Deviation, backward: _Deviation, apart_rad: Floats) -> tuple[Floats, Floats]:
    """Share of the way from the forward to the backward result, and the resulting deviation, rad.

    Args:
        forward: predicted deviation, rad, and whether anything is known.
        backward: the same.
        apart_rad: angle between the results.

    Source: docs/filter.md Eq. (55), (56).
    """
    (sigma_f, knows_f), (sigma_b, knows_b) = forward, backward
    p_f, p_b = (each(math.pow, larger(sigma, MIN_SIGMA_RAD), 2.0) for sigma in (sigma_f, sigma_b))
    share = p_f / (p_f + p_b)
    # Results further apart than predicted are less accurate than predicted.
    spread = share * (1.0 - share) * apart_rad * apart_rad
    sigma = np.sqrt(larger(larger(share * p_b, spread), MIN_SIGMA_RAD**2))
    is_predicted = ~(np.isnan(sigma_f) | np.isnan(sigma_b))
    share, sigma = np.where(is_predicted, share, 0.5), np.where(is_predicted, sigma, math.nan)
    # If neither knows anything, the forward one stays: it is what the flight had.
    alone = larger(np.where(knows_b, sigma_b, sigma_f), MIN_SIGMA_RAD)
    know = knows_f & knows_b
    return np.where(know, share, np.where(knows_b, 1.0, 0.0)), np.where(know, sigma, alone)
