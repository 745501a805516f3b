"""Smooths an attitude after the flight: any filter run forward, backward and forward again.

The first run estimates what does not depend on the direction of time: the biases of gyro and
accelerometer, and the delays of field and velocities. All of it is removed from the inputs of the
other two runs, whose filters are new. The smoothed attitude is the mean of these two, from past and
future, weighted by the errors that each predicts.

Equations: docs/filter.md.
"""

import bisect
import itertools
import math
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from h2nav.attitude.filter import AttitudeFilter, pass_on
from h2nav.attitude.lead import extrapolated
from h2nav.attitude.samples import (
    TRUST_OF,
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    SensorDelays,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.maths.quaternion import conjugate, exp, log, multiply, normalize, rotate

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
# As numbers: an operation on an IntFlag costs more than the rest of a test.
_CONVERGED, _RESTARTED = int(Trust.CONVERGED), int(Trust.RESTARTED)
_REFERENCED, _REST = int(Trust.YAW_REFERENCED), int(Trust.REST)
_KNOWN_BY_EITHER = _CONVERGED | _REFERENCED

FilterMaker = Callable[[], AttitudeFilter]
Record = VehicleState | EarthField | SensorDelays | VelocityFix


class Given(NamedTuple):
    """A filter's inputs between two restarts.

    Attributes:
        samples: in order.
        inputs: in order, with the number of the sample that each record precedes.
    """

    samples: Sequence[ImuSample]
    inputs: Sequence[tuple[int, Record]]


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


class _Piece(NamedTuple):
    """Samples without a long gap, and the conditions at each.

    Attributes:
        samples: in the run's order.
        vehicles: the vehicle's state at each.
        fields: the earth field at each; None if unknown.
        delays: of the sensors at each; None if not given.
        fixes: velocities with the number of the sample that each precedes.
    """

    samples: list[ImuSample]
    vehicles: list[VehicleState]
    fields: list[EarthField | None]
    delays: list[SensorDelays | None]
    fixes: list[tuple[int, VelocityFix]]


class _Learnt(NamedTuple):
    """The result of a run for the next one.

    Attributes:
        bias_b: gyro bias, rad/s.
        errors: other errors of the sensors; None if not estimated.
    """

    bias_b: Vec3 = (0.0, 0.0, 0.0)
    errors: SensorErrors | None = None


class _Known(NamedTuple):
    """A run's result for one sample.

    Attributes:
        estimate: in forward time.
        is_referenced: the heading is tied to north.
    """

    estimate: AttitudeEstimate
    is_referenced: bool


class _BiasRun:
    """The gyro's bias as shown by a run.

    Gravity shows the bias that turns the vertical; a heading tied to north, or rest, shows the part
    about it. Without either that part keeps its value from before the run.

    Args:
        bias_b: before the run, rad/s.

    Source: docs/filter.md Eq. (70).
    """

    def __init__(self, bias_b: Vec3) -> None:
        self._before_b = self._last_b = bias_b
        self._is_shown = False
        self._count = 0
        self._down_b = (0.0, 0.0, 0.0)

    def add(self, known: _Known | None) -> None:
        """Adds the run's result for its next sample."""
        if known is None:
            return
        _, (w, x, y, z), _, self._last_b, _, _, trust, _ = known.estimate
        self._is_shown = self._is_shown or known.is_referenced or bool(int(trust) & _REST)
        self._count += 1
        a, b, c = self._down_b
        self._down_b = (
            a + 2.0 * (x * z - w * y),
            b + 2.0 * (y * z + w * x),
            c + w * w - x * x - y * y + z * z,
        )

    @property
    def shown_b(self) -> Vec3:
        """The bias at the end of the run as far as it was observed, rad/s."""
        if self._is_shown or self._count == 0:
            return self._last_b
        # Shorter than 1 if the vehicle has tilted: no axis was vertical throughout.
        x, y, z = (part / self._count for part in self._down_b)
        p, q, r = _less(self._last_b, self._before_b)
        hidden = p * x + q * y + r * z
        return _less(self._last_b, (hidden * x, hidden * y, hidden * z))


class _Backward:
    """The backward run's results, packed: a long flight has millions of samples."""

    _ROW = struct.Struct("<q15dH2?")
    _NOTHING = bytes(_ROW.size)

    def __init__(self) -> None:
        self._rows = bytearray()

    def add(self, known: _Known | None) -> None:
        """Adds the result for the sample before that of the last call."""
        if known is None:
            self._rows += self._NOTHING
            return
        t_us, q_nb, w_b, bias_b, innovation_n, sigma_tilt, trust, sigma_heading = known.estimate
        self._rows += self._ROW.pack(
            t_us, *q_nb, *w_b, *bias_b, *innovation_n, sigma_tilt, sigma_heading,
            trust, known.is_referenced, True,
        )  # fmt: skip

    def in_order(self) -> Iterator[_Known | None]:
        """Yields the result for each sample, from the first one on."""
        size = self._ROW.size
        for place in range(len(self._rows) - size, -1, -size):
            t_us, *values, trust, is_referenced, is_known = self._ROW.unpack_from(self._rows, place)
            if not is_known:
                yield None
                continue
            a, b, c, d, p, q, r, x, y, z, u, v, w, sigma_tilt, sigma_heading = values
            # Bypasses the constructors, here and below, which would double the cost.
            estimate = tuple.__new__(
                AttitudeEstimate,
                (
                    *(t_us, (a, b, c, d), (p, q, r), (x, y, z), (u, v, w)),
                    *(sigma_tilt, TRUST_OF[trust], sigma_heading),
                ),
            )
            yield tuple.__new__(_Known, (estimate, is_referenced))


def smooth(stretches: Sequence[Given], make: FilterMaker) -> list[list[AttitudeEstimate | None]]:
    """The results of `smoothed`, by stretch."""
    found = smoothed(stretches, make)
    return [list(itertools.islice(found, len(given.samples))) for given in stretches]


def smoothed(
    stretches: Iterable[Given],
    make: FilterMaker,
    left_out: Callable[[int], object] = lambda count: None,
) -> Iterator[AttitudeEstimate | None]:
    """Yields the smoothed estimate of every sample of every stretch.

    It is None where neither direction has an estimate: in stretches too short to align in, and in
    pieces whose arithmetic fails. The heading is the forward run's unless the backward run's is
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
        for piece in _pieces(given):
            count = len(piece.samples)
            done = 0
            try:
                learnt = _learnt_from(first, piece, learnt)
                for estimate in _extrapolated(_smooth_piece(piece, make, learnt), piece.delays):
                    done += 1
                    yield estimate
            except _FAILURES:
                first = make()
                left_out(count - done)
                yield from itertools.repeat(None, count - done)


def _learnt_from(first: AttitudeFilter, piece: _Piece, learnt: _Learnt) -> _Learnt:
    """What the first run shows."""
    ahead = _BiasRun(learnt.bias_b)
    for known in _known(_run(first, piece)):
        ahead.add(known)
    errors = first.sensor_errors if isinstance(first, KnowsSensors) else learnt.errors
    return _Learnt(ahead.shown_b, errors)


def _smooth_piece(
    piece: _Piece, make: FilterMaker, learnt: _Learnt
) -> Iterator[AttitudeEstimate | None]:
    """The second and the third run, combined."""
    placed = piece._replace(
        fields=_known_from_the_start(piece.fields), delays=[None] * len(piece.delays)
    )
    chosen = _prepared(make, piece, learnt)
    run = _run(chosen, _reversed(_without(placed, learnt)))
    backward, back = _Backward(), _BiasRun(learnt.bias_b)
    for known in _known(_of_samples(run, reversed(piece.samples), learnt.bias_b, -1.0)):
        backward.add(known)
        back.add(known)
    learnt = learnt._replace(bias_b=back.shown_b)
    if learnt.errors is not None and isinstance(chosen, KnowsSensors):
        learnt = learnt._replace(errors=_both(learnt.errors, chosen.sensor_errors))
    run = _run(_prepared(make, piece, learnt), _without(placed, learnt))
    forward = _of_samples(run, piece.samples, learnt.bias_b, 1.0)
    return _combined(_known(forward), backward.in_order())


def _prepared(make: FilterMaker, piece: _Piece, learnt: _Learnt) -> AttitudeFilter:
    """A new filter for samples with the errors removed.

    The previous run estimated the errors from the same samples, so its certainty does not count in
    full: the random walk over their whole time is added. Source: docs/filter.md Eq. (51).
    """
    chosen = make()
    if learnt.errors is not None and isinstance(chosen, KnowsSensors):
        walked_s = (piece.samples[-1].t_us - piece.samples[0].t_us) * 1e-6
        chosen.know_sensors(learnt.errors, walked_s)
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


def _extrapolated(
    estimates: Iterable[AttitudeEstimate | None], delays: list[SensorDelays | None]
) -> Iterator[AttitudeEstimate | None]:
    """The attitudes at their nominal times. Source: docs/filter.md Eq. (42)."""
    for estimate, late in zip(estimates, delays, strict=True):
        yield estimate if estimate is None or late is None else extrapolated(estimate, late.gyro_s)


def _pieces(given: Given) -> Iterator[_Piece]:
    """A stretch, cut at its gaps; conditions from before a gap hold after it."""
    samples, inputs = given.samples, iter(given.inputs)
    following = next(inputs, None)
    vehicle, field, delays = VehicleState(), None, None
    piece = _Piece([], [], [], [], [])
    for row, sample in enumerate(samples):
        if piece.samples and sample.t_us - piece.samples[-1].t_us > LONGEST_GAP_US:
            yield piece
            piece = _Piece([], [], [], [], [])
        while following is not None and following[0] <= row:
            what = following[1]
            if isinstance(what, VelocityFix):
                piece.fixes.append((len(piece.samples), what))
            elif isinstance(what, EarthField):
                field = what
            elif isinstance(what, SensorDelays):
                delays = what
            else:
                vehicle = what
            following = next(inputs, None)
        piece.samples.append(sample)
        piece.vehicles.append(vehicle)
        piece.fields.append(field)
        piece.delays.append(delays)
    if piece.samples:
        yield piece


def _run(chosen: AttitudeFilter, piece: _Piece) -> Iterator[AttitudeEstimate | None]:
    """Runs a filter over a piece, passing on conditions when they change."""
    vehicle: VehicleState | None = None
    field: EarthField | None = None
    delays: SensorDelays | None = None
    fixes = iter(piece.fixes)
    coming = next(fixes, None)
    # Conditions are mostly the same record as before.
    each = enumerate(zip(piece.samples, piece.vehicles, piece.fields, piece.delays, strict=True))
    for row, (sample, now, known, late) in each:
        if now is not vehicle and now != vehicle:
            vehicle = now
            pass_on(chosen, vehicle)
        if known is not None and known is not field and known != field:
            field = known
            pass_on(chosen, field)
        if late is not None and late is not delays and late != delays:
            delays = late
            pass_on(chosen, delays)
        while coming is not None and coming[0] <= row:
            chosen.use_velocity(coming[1])
            coming = next(fixes, None)
        yield _update(chosen, sample)


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


def _known_from_the_start(fields: list[EarthField | None]) -> list[EarthField | None]:
    """Extends the first known earth field to the samples before it."""
    first = next((field for field in fields if field is not None), None)
    return [first if field is None else field for field in fields]


def _without(piece: _Piece, learnt: _Learnt) -> _Piece:
    """The piece without biases and latencies.

    Source: docs/filter.md Eq. (50).
    """
    if learnt.errors is None:
        samples = [
            tuple.__new__(ImuSample, (t_us, _less(w_b, learnt.bias_b), f_b, m_b_ut, clipped))
            for t_us, w_b, f_b, m_b_ut, clipped in piece.samples
        ]
        return piece._replace(samples=samples)
    errors = learnt.errors
    samples = []
    held: Vec3 | None = None
    for t_us, rate_b, force_b, field_b, clipped in piece.samples:
        w_b = _less(rate_b, learnt.bias_b)
        m_b_ut = None if field_b == held else field_b
        if field_b is not None:
            held = field_b
        if m_b_ut is not None:
            m_b_ut = _timely(m_b_ut, w_b, errors.field_latency_s)
        f_b = _without_bias(force_b, errors.force_bias_b)
        samples.append(tuple.__new__(ImuSample, (t_us, w_b, f_b, m_b_ut, clipped)))
    late_us = round(errors.fix_latency_s * 1e6)
    fixes = (fix._replace(t_us=fix.t_us - late_us) for _, fix in piece.fixes)
    return piece._replace(samples=samples, fixes=_placed(fixes, samples))


def _without_bias(f_b: Vec3, bias_b: Vec3) -> Vec3:
    """Removes the bias; a force of exactly zero is no measurement, and stays."""
    return _less(f_b, bias_b) if any(f_b) else f_b


def _timely(m_b_ut: Vec3, w_b: Vec3, late_s: float) -> Vec3:
    """The field at the time of the sample that carried it."""
    x, y, z = w_b
    if not late_s * math.hypot(x, y, z) < math.pi:
        return m_b_ut  # no sensor has such a rate
    return rotate(exp((-late_s * x, -late_s * y, -late_s * z)), m_b_ut)


def _placed(
    fixes: Iterable[VelocityFix], samples: Sequence[ImuSample]
) -> list[tuple[int, VelocityFix]]:
    """Fixes in the order of their times, each with the number of the sample that it precedes."""
    times_us = [sample.t_us for sample in samples]
    return [
        (bisect.bisect_left(times_us, fix.t_us + FIX_DELAY_US) + 1, fix)
        for fix in sorted(fixes, key=lambda fix: fix.t_us)
    ]


def _reversed(piece: _Piece) -> _Piece:
    """A piece without biases and latencies with time reversed; it is consumed.

    Its times are mirrored about their middle. A rate is the mean since the previous sample;
    reversed it leads to that one. Forces, fields and the earth stay as they are. Velocities change
    their sign, and the nose trails.

    Source: docs/filter.md Eq. (52), (53).
    """
    samples = piece.samples
    ends_us = samples[0].t_us + samples[-1].t_us
    turned, later = [], samples[-1]
    while samples:  # consumed, because there are millions of them
        sample = samples.pop()
        t_us, _, f_b, m_b_ut, clipped = sample
        _, (x, y, z), _, _, later_clipped = later
        clipped = clipped or later_clipped
        turned.append(
            tuple.__new__(ImuSample, (ends_us - t_us, (-x, -y, -z), f_b, m_b_ut, clipped))
        )
        later = sample
    fixes = []
    for _, fix in piece.fixes:
        north, east, down = fix.v_n
        fixes.append(fix._replace(t_us=ends_us - fix.t_us, v_n=(-north, -east, -down)))
    return _Piece(
        turned,
        _backward(piece.vehicles),
        piece.fields[::-1],
        piece.delays[::-1],
        _placed(fixes, turned),
    )


def _backward(vehicles: Sequence[VehicleState]) -> list[VehicleState]:
    """The vehicle's states in reversed time; one record as long as one holds."""
    turned: list[VehicleState] = []
    for vehicle, group in itertools.groupby(reversed(vehicles)):
        turned += [vehicle._replace(is_backward=True)] * len(list(group))
    return turned


def _of_samples(
    run: Iterable[AttitudeEstimate | None],
    samples: Iterable[ImuSample],
    bias_b: Vec3,
    direction: float,
) -> Iterator[AttitudeEstimate | None]:
    """Converts a run's estimates to estimates of the original samples.

    Args:
        run: in its own order.
        samples: with their own times and rates, in the run's order.
        bias_b: removed from the run's rates, rad/s.
        direction: of the run's time: 1 forward, -1 backward.
    """
    a, b, c = bias_b
    for sample, estimate in zip(samples, run, strict=True):
        if estimate is None:
            yield None
            continue
        _, q_nb, rate_b, (u, v, w), innovation_n, sigma_tilt, trust, sigma_heading = estimate
        bias = x, y, z = a + direction * u, b + direction * v, c + direction * w
        p, q, r = sample.w_b
        w_b = w_x, w_y, w_z = p - x, q - y, r - z
        if not math.isfinite(abs(w_x) + abs(w_y) + abs(w_z)):
            p, q, r = rate_b
            w_b = direction * p, direction * q, direction * r
        numbers = sample.t_us, q_nb, w_b, bias, innovation_n, sigma_tilt, trust, sigma_heading
        yield tuple.__new__(AttitudeEstimate, numbers)


def _known(estimates: Iterable[AttitudeEstimate | None]) -> Iterator[_Known | None]:
    """Adds whether the heading of each is tied to north; in the order of the run."""
    at_us: int | None = None
    for estimate in estimates:
        if estimate is None:
            yield None
            continue
        t_us = estimate.t_us
        if int(estimate.trust) & _REFERENCED:
            at_us = t_us
        is_referenced = at_us is not None and abs(t_us - at_us) < REFERENCED_US
        yield tuple.__new__(_Known, (estimate, is_referenced))


def _combined(
    forward: Iterable[_Known | None], backward: Iterable[_Known | None]
) -> Iterator[AttitudeEstimate | None]:
    """Combines both runs; where one has no estimate, the other alone."""
    before: list[AttitudeEstimate | None] = []
    waiting = True  # for the forward run's first estimate
    for ahead, back in zip(forward, backward, strict=True):
        if ahead is None or back is None:
            alone = ahead or back
            found = None if alone is None else alone.estimate
        else:
            found = _mean(ahead, back)
            if waiting:
                _turn_all(before, found, back)
        waiting = waiting and ahead is None
        before.append(found)
        if not waiting:
            yield from before
            before.clear()
    yield from before


def _turn_all(alone: list[AttitudeEstimate | None], both: AttitudeEstimate, back: _Known) -> None:
    """Turns the backward run's estimates before the forward run's first to its heading.

    In the backward run alone, a heading not tied to north is arbitrary.
    """
    if back.is_referenced:
        return
    angle, _, _ = _apart(back.estimate.q_nb, both.q_nb)
    turn = exp((0.0, 0.0, angle))
    for row, estimate in enumerate(alone):
        if estimate is not None:
            alone[row] = estimate._replace(q_nb=multiply(turn, estimate.q_nb))


def _mean(ahead: _Known, back: _Known) -> AttitudeEstimate:
    """The weighted mean of two estimates of one sample.

    Source: docs/filter.md Eq. (54) - (56).
    """
    f, b = ahead.estimate, back.estimate
    heading, north, east = _apart(f.q_nb, b.q_nb)
    ahead_tilt = (f.sigma_tilt_rad, _knows_tilt(f))
    back_tilt = (b.sigma_tilt_rad, _knows_tilt(b))
    tilt_share, tilt_sigma = _share(ahead_tilt, back_tilt, math.hypot(north, east))
    heading_share, heading_sigma = _share(
        (f.sigma_heading_rad, ahead.is_referenced),
        (b.sigma_heading_rad, back.is_referenced),
        heading,
    )
    if _is_broken(ahead_tilt, back_tilt, math.hypot(north, east)):
        # What comes later is not carried across a break; the deviations keep both.
        tilt_share = heading_share = 0.0
    tilted = multiply(exp((tilt_share * north, tilt_share * east, 0.0)), f.q_nb)
    q_nb = normalize(multiply(exp((0.0, 0.0, heading_share * heading)), tilted))
    trust = TRUST_OF[int(f.trust) | (int(b.trust) & _KNOWN_BY_EITHER)]
    return tuple.__new__(
        AttitudeEstimate,
        (f.t_us, q_nb, f.w_b, f.bias_b, f.innovation_n, tilt_sigma, trust, heading_sigma),
    )


def _is_broken(forward: tuple[float, bool], backward: tuple[float, bool], apart_rad: float) -> bool:
    """Whether a break of the motion lies between two runs, by their verticals.

    Args:
        forward: predicted deviation of the tilt, rad, and whether it is known.
        backward: the same.
        apart_rad: angle between them.

    Source: docs/filter.md, section 12.
    """
    (sigma_f, knows_f), (sigma_b, knows_b) = forward, backward
    if not (knows_f and knows_b):
        return False
    # False for deviations that are not predicted.
    return apart_rad > max(BREAK_SIGMAS * math.hypot(sigma_f, sigma_b), MIN_BREAK_RAD)


def _knows_tilt(estimate: AttitudeEstimate) -> bool:
    """False at an alignment, whose predicted deviation ignores the force's own error."""
    trust = int(estimate.trust)
    if trust & _RESTARTED:
        return False
    return not math.isnan(estimate.sigma_tilt_rad) or bool(trust & _CONVERGED)


def _apart(q: Quat, other: Quat) -> tuple[float, float, float]:
    """The turn in n from one attitude to another: about down, after one about north and east.

    Separate at every angle: an arbitrary heading must not mix into the tilt.
    Source: docs/filter.md Eq. (54).
    """
    difference = multiply(other, conjugate(q))
    heading = math.remainder(2.0 * math.atan2(difference[3], difference[0]), 2.0 * math.pi)
    north, east, _ = log(multiply(exp((0.0, 0.0, -heading)), difference))
    return heading, north, east


def _share(
    forward: tuple[float, bool], backward: tuple[float, bool], apart_rad: float
) -> tuple[float, float]:
    """Share of the way from the forward to the backward estimate, and the resulting deviation, rad.

    Args:
        forward: predicted deviation, rad, and whether anything is known.
        backward: the same.
        apart_rad: angle between the estimates.

    Source: docs/filter.md Eq. (55), (56).
    """
    (sigma_f, knows_f), (sigma_b, knows_b) = forward, backward
    if not knows_b or not knows_f:
        # If neither knows anything, the forward one stays: it is what the flight had.
        share, sigma = (1.0, sigma_b) if knows_b else (0.0, sigma_f)
        return share, sigma if math.isnan(sigma) else max(sigma, MIN_SIGMA_RAD)
    if math.isnan(sigma_f) or math.isnan(sigma_b):
        return 0.5, math.nan
    p_f = max(sigma_f, MIN_SIGMA_RAD) ** 2
    p_b = max(sigma_b, MIN_SIGMA_RAD) ** 2
    share = p_f / (p_f + p_b)
    # Estimates further apart than predicted are less accurate than predicted.
    spread = share * (1.0 - share) * apart_rad * apart_rad
    return share, math.sqrt(max(share * p_b, spread, MIN_SIGMA_RAD**2))


def _less(v: Vec3, w: Vec3) -> Vec3:
    return (v[0] - w[0], v[1] - w[1], v[2] - w[2])
