"""An attitude smoother for after the flight: any filter run forward, backward and forward again.

The first run learns what does not change with the direction of time: the gyro's bias and the
latency of the field. Both are taken out of what the other two runs are given, whose filters are
new. Where those two know the attitude from the past and from the future, the smoothed one is their
mean, weighted by what each predicts of its own error.

Equations: docs/filter.md.
"""

import bisect
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from h2nav.attitude.filter import AttitudeFilter, tell
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.maths.quaternion import conjugate, exp, log, multiply, normalize, rotate

# A longer gap leaves nothing of the attitude: what is before and after it is smoothed apart.
LONGEST_GAP_US = 1_000_000
# Backward a fix comes so long after it was true: then the filter's past covers its time.
FIX_DELAY_US = 50_000
# What the runs share does not average out: 1 mg of accelerometer bias, 0.06 deg of the vertical.
# Nothing is known better than the vertical that it is measured about.
LEAST_SIGMA_RAD = 1e-3
# A heading is tied to north for so long after the run said so; some say it only with a field.
REFERENCED_US = 1_000_000

_KNOWN_BY_EITHER = Trust.CONVERGED | Trust.YAW_REFERENCED

FilterMaker = Callable[[], AttitudeFilter]
Record = VehicleState | EarthField | VelocityFix


class Given(NamedTuple):
    """What a filter was given between two restarts.

    Attributes:
        samples: in order.
        told: in order, with the number of the sample that each record was known before.
    """

    samples: Sequence[ImuSample]
    told: Sequence[tuple[int, Record]]


@runtime_checkable
class KnowsSensors(Protocol):
    """A filter that says how well it knows the bias, and how late the field's samples are."""

    @property
    def field_latency_s(self) -> float:
        """Latency of the magnetometer's samples, as learnt so far."""

    @property
    def bias_variance(self) -> Vec3:
        """Variances of the bias, (rad/s)^2, body."""

    def know_bias(self, variance: Vec3, walked_s: float) -> None:
        """The bias was known with these variances, (rad/s)^2, and has walked for so long since."""


class _Piece(NamedTuple):
    """Samples without a long gap, and what holds at each.

    Attributes:
        samples: in the run's order.
        vehicles: the vehicle's state at each.
        fields: the earth field at each; None where none is known.
        fixes: velocities with the number of the sample that each is given before.
    """

    samples: list[ImuSample]
    vehicles: list[VehicleState]
    fields: list[EarthField | None]
    fixes: list[tuple[int, VelocityFix]]


class _Learnt(NamedTuple):
    """What a run leaves to the next one.

    Attributes:
        bias_b: gyro bias, rad/s.
        variance: of the bias, (rad/s)^2; None where the filter has no figure.
        latency_s: of the field.
    """

    bias_b: Vec3 = (0.0, 0.0, 0.0)
    variance: Vec3 | None = None
    latency_s: float = 0.0


class _Known(NamedTuple):
    """What a run knows of one sample.

    Attributes:
        estimate: in forward time.
        is_referenced: the heading is tied to north.
    """

    estimate: AttitudeEstimate
    is_referenced: bool


def smooth(stretches: Sequence[Given], make: FilterMaker) -> list[list[AttitudeEstimate | None]]:
    """The smoothed estimate of every sample of every stretch.

    None stands where neither direction has an estimate: in stretches too short to align in. The
    heading is the forward run's wherever the backward run's is not tied to north.

    Args:
        stretches: in order of time; the first run keeps its bias from one to the next.
        make: makes the filter of this vehicle; called for each run.

    Source: docs/filter.md Eq. (33) - (38).
    """
    first = make()
    smoothed = []
    learnt = _Learnt()
    for given in stretches:
        first.restart()
        found: list[AttitudeEstimate | None] = []
        for piece in _pieces(given):
            learnt = learnt._replace(bias_b=_last_bias(_run(first, piece), learnt.bias_b))
            if isinstance(first, KnowsSensors):
                learnt = _Learnt(learnt.bias_b, first.bias_variance, first.field_latency_s)
            found += _smooth_piece(piece, make, learnt)
        smoothed.append(found)
    return smoothed


def _smooth_piece(
    piece: _Piece, make: FilterMaker, learnt: _Learnt
) -> list[AttitudeEstimate | None]:
    """The second run, the third, and both together."""
    placed = piece._replace(fields=_known_from_the_start(piece.fields))
    chosen = _prepared(make, piece, learnt)
    run = _run(chosen, _reversed(placed, learnt))
    backward = _of_samples(run[::-1], piece.samples, learnt.bias_b, -1.0)
    learnt = learnt._replace(bias_b=_last_bias(backward[::-1], learnt.bias_b))
    if isinstance(chosen, KnowsSensors):
        learnt = learnt._replace(variance=chosen.bias_variance)
    run = _run(_prepared(make, piece, learnt), _without(placed, learnt))
    forward = _of_samples(run, piece.samples, learnt.bias_b, 1.0)
    return _combined(_known(forward), _known(backward[::-1])[::-1])


def _prepared(make: FilterMaker, piece: _Piece, learnt: _Learnt) -> AttitudeFilter:
    """A new filter for rates whose bias was taken out.

    What the run before knew of the bias came from the same samples, so that it does not count in
    full: what the bias may walk in all their time is added. Source: docs/filter.md Eq. (33).
    """
    chosen = make()
    if learnt.variance is not None and isinstance(chosen, KnowsSensors):
        walked_s = (piece.samples[-1].t_us - piece.samples[0].t_us) * 1e-6
        chosen.know_bias(learnt.variance, walked_s)
    return chosen


def _pieces(given: Given) -> Iterator[_Piece]:
    """A stretch, cut at its gaps; what was told before a gap holds after it."""
    samples, told = given.samples, iter(given.told)
    following = next(told, None)
    vehicle, field = VehicleState(), None
    piece = _Piece([], [], [], [])
    for row, sample in enumerate(samples):
        if piece.samples and sample.t_us - piece.samples[-1].t_us > LONGEST_GAP_US:
            yield piece
            piece = _Piece([], [], [], [])
        while following is not None and following[0] <= row:
            what = following[1]
            if isinstance(what, VelocityFix):
                piece.fixes.append((len(piece.samples), what))
            elif isinstance(what, EarthField):
                field = what
            else:
                vehicle = what
            following = next(told, None)
        piece.samples.append(sample)
        piece.vehicles.append(vehicle)
        piece.fields.append(field)
    if piece.samples:
        yield piece


def _run(chosen: AttitudeFilter, piece: _Piece) -> list[AttitudeEstimate | None]:
    """A filter over a piece; it is told what holds where that changes."""
    estimates: list[AttitudeEstimate | None] = []
    vehicle: VehicleState | None = None
    field: EarthField | None = None
    fixes = iter(piece.fixes)
    coming = next(fixes, None)
    for row, sample in enumerate(piece.samples):
        if piece.vehicles[row] != vehicle:
            vehicle = piece.vehicles[row]
            tell(chosen, vehicle)
        known = piece.fields[row]
        if known is not None and known != field:
            field = known
            tell(chosen, field)
        while coming is not None and coming[0] <= row:
            chosen.use_velocity(coming[1])
            coming = next(fixes, None)
        estimates.append(_update(chosen, sample))
    return estimates


def _update(chosen: AttitudeFilter, sample: ImuSample) -> AttitudeEstimate | None:
    """An estimate of finite numbers, or none; then the filter begins anew, as in the service."""
    try:
        estimate = chosen.update(sample)
    except ArithmeticError:
        estimate = None
    else:
        if estimate is None or all(map(math.isfinite, estimate.q_nb)):
            return estimate
    chosen.restart()
    return None


def _last_bias(estimates: Sequence[AttitudeEstimate | None], otherwise: Vec3) -> Vec3:
    """What a run knew of the bias at its end."""
    last = next((each for each in reversed(estimates) if each is not None), None)
    return otherwise if last is None else last.bias_b


def _known_from_the_start(fields: list[EarthField | None]) -> list[EarthField | None]:
    """The earth's field was there before the position that names it was known."""
    first = next((field for field in fields if field is not None), None)
    return [first if field is None else field for field in fields]


def _without(piece: _Piece, learnt: _Learnt) -> _Piece:
    """The piece without bias and latency.

    Source: docs/filter.md Eq. (33).
    """
    samples = [
        sample._replace(w_b=_less(sample.w_b, learnt.bias_b), m_b_ut=_timely(sample, learnt))
        for sample in piece.samples
    ]
    return piece._replace(samples=samples)


def _timely(sample: ImuSample, learnt: _Learnt) -> Vec3 | None:
    """The field at the sample's own time."""
    x, y, z = _less(sample.w_b, learnt.bias_b)
    late_s = learnt.latency_s
    if sample.m_b_ut is None or not late_s * math.hypot(x, y, z) < math.pi:
        return sample.m_b_ut  # that rate is no sensor's
    return rotate(exp((-late_s * x, -late_s * y, -late_s * z)), sample.m_b_ut)


def _reversed(piece: _Piece, learnt: _Learnt) -> _Piece:
    """The piece as it looks when time runs backward; its times are mirrored about their middle.

    A rate is the mean since the sample before: backward it leads to that one. Forces, fields and
    the earth stay as they are. Velocities change their sign, and the nose trails.

    Source: docs/filter.md Eq. (34), (35).
    """
    samples = piece.samples
    ends_us = samples[0].t_us + samples[-1].t_us
    x, y, z = learnt.bias_b
    turned = []
    for sample, later in itertools.pairwise((*samples, samples[-1])):
        w = later.w_b
        turned.append(
            ImuSample(
                ends_us - sample.t_us,
                (x - w[0], y - w[1], z - w[2]),
                sample.f_b,
                _timely(sample, learnt),
                sample.clipped or later.clipped,
            )
        )
    turned.reverse()
    times_us = [sample.t_us for sample in turned]
    fixes = []
    for _, fix in sorted(piece.fixes, key=lambda placed: -placed[1].t_us):
        north, east, down = fix.v_n
        t_us = ends_us - fix.t_us
        row = bisect.bisect_left(times_us, t_us + FIX_DELAY_US) + 1
        fixes.append((row, fix._replace(t_us=t_us, v_n=(-north, -east, -down))))
    return _Piece(
        turned,
        [_backward(vehicle) for vehicle in reversed(piece.vehicles)],
        piece.fields[::-1],
        fixes,
    )


def _backward(vehicle: VehicleState) -> VehicleState:
    return vehicle._replace(is_backward=True)


def _of_samples(
    run: list[AttitudeEstimate | None],
    samples: list[ImuSample],
    bias_b: Vec3,
    direction: float,
) -> list[AttitudeEstimate | None]:
    """A run's estimates as estimates of the samples that were given.

    Args:
        run: in the samples' order.
        samples: with their own times and rates.
        bias_b: what the run's rates were without, rad/s.
        direction: of the run's time: 1 forward, -1 backward.
    """
    found: list[AttitudeEstimate | None] = []
    for sample, estimate in zip(samples, run, strict=True):
        if estimate is None:
            found.append(None)
            continue
        x, y, z = (b + direction * more for b, more in zip(bias_b, estimate.bias_b, strict=True))
        w_b = _less(sample.w_b, (x, y, z))
        if not all(map(math.isfinite, w_b)):
            w_x, w_y, w_z = estimate.w_b
            w_b = (direction * w_x, direction * w_y, direction * w_z)
        found.append(estimate._replace(t_us=sample.t_us, w_b=w_b, bias_b=(x, y, z)))
    return found


def _known(estimates: Sequence[AttitudeEstimate | None]) -> list[_Known | None]:
    """Whether the heading of each is tied to north; in the order of the run."""
    known: list[_Known | None] = []
    at_us: int | None = None
    for estimate in estimates:
        if estimate is None:
            known.append(None)
            continue
        if estimate.trust & Trust.YAW_REFERENCED:
            at_us = estimate.t_us
        is_referenced = at_us is not None and abs(estimate.t_us - at_us) < REFERENCED_US
        known.append(_Known(estimate, is_referenced))
    return known


def _combined(
    forward: Sequence[_Known | None], backward: Sequence[_Known | None]
) -> list[AttitudeEstimate | None]:
    """Both runs together; where one has nothing, the other alone."""
    smoothed: list[AttitudeEstimate | None] = []
    waiting = True  # for the forward run's first estimate
    for ahead, back in zip(forward, backward, strict=True):
        if ahead is not None and back is not None:
            both = _mean(ahead, back)
            if waiting:
                _turn_all(smoothed, both, back)
            smoothed.append(both)
        else:
            alone = ahead or back
            smoothed.append(None if alone is None else alone.estimate)
        waiting = waiting and ahead is None
    return smoothed


def _turn_all(alone: list[AttitudeEstimate | None], both: AttitudeEstimate, back: _Known) -> None:
    """Turns the backward run's estimates before the forward run's first to its heading.

    Backward alone, a heading that is not tied to north is an arbitrary one.
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

    Source: docs/filter.md Eq. (36) - (38).
    """
    f, b = ahead.estimate, back.estimate
    heading, north, east = _apart(f.q_nb, b.q_nb)
    tilt_share, tilt_sigma = _share(
        (f.sigma_tilt_rad, _knows_tilt(f)),
        (b.sigma_tilt_rad, _knows_tilt(b)),
        math.hypot(north, east),
    )
    heading_share, heading_sigma = _share(
        (f.sigma_heading_rad, ahead.is_referenced),
        (b.sigma_heading_rad, back.is_referenced),
        heading,
    )
    tilted = multiply(exp((tilt_share * north, tilt_share * east, 0.0)), f.q_nb)
    return f._replace(
        q_nb=normalize(multiply(exp((0.0, 0.0, heading_share * heading)), tilted)),
        sigma_tilt_rad=tilt_sigma,
        trust=f.trust | (b.trust & _KNOWN_BY_EITHER),
        sigma_heading_rad=heading_sigma,
    )


def _knows_tilt(estimate: AttitudeEstimate) -> bool:
    """False at an alignment, whose predicted deviation does not count the force's own error."""
    if estimate.trust & Trust.RESTARTED:
        return False
    return not math.isnan(estimate.sigma_tilt_rad) or bool(estimate.trust & Trust.CONVERGED)


def _apart(q: Quat, other: Quat) -> tuple[float, float, float]:
    """The turn in n from one attitude to another: about down, after one about north and east.

    Apart at every angle: a heading that is arbitrary must not mix into the tilt.
    Source: docs/filter.md Eq. (36).
    """
    difference = multiply(other, conjugate(q))
    heading = math.remainder(2.0 * math.atan2(difference[3], difference[0]), 2.0 * math.pi)
    north, east, _ = log(multiply(exp((0.0, 0.0, -heading)), difference))
    return heading, north, east


def _share(
    forward: tuple[float, bool], backward: tuple[float, bool], apart_rad: float
) -> tuple[float, float]:
    """How far to go from the forward estimate to the backward one, and the deviation then, rad.

    Args:
        forward: predicted deviation, rad, and whether anything is known at all.
        backward: the same.
        apart_rad: angle between the estimates.

    Source: docs/filter.md Eq. (37), (38).
    """
    (sigma_f, knows_f), (sigma_b, knows_b) = forward, backward
    if not knows_b or not knows_f:
        # Of two that know nothing the forward one is kept: it is what the flight had.
        share, sigma = (1.0, sigma_b) if knows_b else (0.0, sigma_f)
        return share, sigma if math.isnan(sigma) else max(sigma, LEAST_SIGMA_RAD)
    if math.isnan(sigma_f) or math.isnan(sigma_b):
        return 0.5, math.nan
    p_f = max(sigma_f, LEAST_SIGMA_RAD) ** 2
    p_b = max(sigma_b, LEAST_SIGMA_RAD) ** 2
    share = p_f / (p_f + p_b)
    # Estimates that lie further apart than they predict are not as good as they predict.
    spread = share * (1.0 - share) * apart_rad * apart_rad
    return share, math.sqrt(max(share * p_b, spread, LEAST_SIGMA_RAD**2))


def _less(v: Vec3, w: Vec3) -> Vec3:
    return (v[0] - w[0], v[1] - w[1], v[2] - w[2])
