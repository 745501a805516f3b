"""Shared parts of the analyses: best attitude at any time, turns, forces, spans.

Everything works on whole arrays. Quaternions are Hamilton, body to NED, in rows.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths.rows import cross, product
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, ImuTrack, Span
from h2nav.reviews.flight import Estimates, Flight

Mask = NDArray[np.bool_]
# The attitude between two estimates further apart than this is unknown.
LONGEST_GAP_S = 0.5
# A sample that comes later than this after the previous one holds for no longer.
LONGEST_STEP_S = 0.1
SLOWED_HZ = 100.0
# No sensor is this late by itself: the shortest pause of a recording, also in usual steps.
PAUSE_S, PAUSE_PERIODS = 1.0, 3.0
# Samples slower than this do not show the motion between them.
STEADY_HZ = 45.0


class Attitudes(NamedTuple):
    """Attitudes over time; sigma is infinite where unknown."""

    t_s: Array  # (N,) increasing
    q_nb: Array  # (N, 4) continuous in sign
    sigma_tilt_rad: Array  # (N,)
    sigma_heading_rad: Array  # (N,)

    def at(self, t_s: Array) -> Array:
        """(M, 4) attitudes at other times; NaN beyond the ends and in gaps."""
        if len(self.t_s) < 2:
            return np.full((len(t_s), 4), np.nan)
        after = np.clip(np.searchsorted(self.t_s, t_s), 1, len(self.t_s) - 1)
        first, last = self.t_s[after - 1], self.t_s[after]
        share = ((t_s - first) / np.maximum(last - first, 1e-9))[:, None]
        q = (1.0 - share) * self.q_nb[after - 1] + share * self.q_nb[after]
        outside = (t_s < first - 1e-9) | (t_s > last + 1e-9) | (last - first > LONGEST_GAP_S)
        q[outside] = np.nan
        return unit(q)

    def near(self, values: Array, t_s: Array) -> Array:
        """(M,) or (M, k) values of this track's samples nearest to other times."""
        if not len(self.t_s):
            return np.full((len(t_s), *values.shape[1:]), np.nan)
        after = np.clip(np.searchsorted(self.t_s, t_s), 1, max(len(self.t_s) - 1, 1))
        nearer = t_s - self.t_s[after - 1] < self.t_s[np.minimum(after, len(self.t_s) - 1)] - t_s
        return values[np.minimum(after - nearer, len(self.t_s) - 1)]


def attitudes(t_s: Array, q_nb: Array) -> Attitudes:
    """A track of attitudes without predicted errors, in the order of time."""
    order = np.argsort(t_s, kind="stable")
    rows = order[np.isfinite(q_nb[order]).all(axis=1)]
    unknown = np.full(len(rows), np.inf)
    return Attitudes(t_s[rows], _continuous(q_nb[rows]), unknown, unknown)


def best_attitude(flight: Flight) -> Attitudes | None:
    """Our estimates, or the smoothed ones where those are more accurate; None without any."""
    if flight.estimates is None or len(flight.estimates.t_s) < 2:
        return None
    ours = _with_sigma(flight.estimates)
    if flight.smoothed is None or len(flight.smoothed.t_s) < 2:
        return ours
    smoothed = _with_sigma(flight.smoothed)
    q = smoothed.at(ours.t_s)
    tilt = smoothed.near(smoothed.sigma_tilt_rad, ours.t_s)
    heading = smoothed.near(smoothed.sigma_heading_rad, ours.t_s)
    surer = np.isfinite(q).all(axis=1)
    surer &= np.hypot(tilt, heading) <= np.hypot(ours.sigma_tilt_rad, ours.sigma_heading_rad)
    return Attitudes(
        ours.t_s,
        _continuous(np.where(surer[:, None], q, ours.q_nb)),
        np.where(surer, tilt, ours.sigma_tilt_rad),
        np.where(surer, heading, ours.sigma_heading_rad),
    )


def _with_sigma(estimates: Estimates) -> Attitudes:
    rows = np.isfinite(estimates.q_nb).all(axis=1)
    return Attitudes(
        estimates.t_s[rows],
        _continuous(estimates.q_nb[rows]),
        _known(estimates.sigma_tilt_rad[rows]),
        _known(estimates.sigma_heading_rad[rows]),
    )


def _known(sigma: Array) -> Array:
    return np.where(np.isfinite(sigma), sigma, np.inf)


def _continuous(q: Array) -> Array:
    flips = np.sign((q[1:] * q[:-1]).sum(axis=1))
    flips[flips == 0.0] = 1.0
    return q * np.concatenate(([1.0], np.cumprod(flips)))[:, None]


def unit(q: Array) -> Array:
    """Rows of length one; NaN stays NaN."""
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    found: Array = q / np.maximum(norm, 1e-12)
    return found


def conjugate(q: Array) -> Array:
    """The inverse rotations."""
    other: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return other


def rotate(q: Array, v: Array) -> Array:
    """(N, 3) vectors turned by (N, 4) attitudes: body to NED."""
    axis = q[:, 1:]
    twice = 2.0 * cross(axis, v)
    turned: Array = v + q[:, :1] * twice + cross(axis, twice)
    return turned


def exponential(phi: Array) -> Array:
    """(N, 4) quaternions of (N, 3) rotation vectors, rad."""
    half = 0.5 * np.linalg.norm(phi, axis=1, keepdims=True)
    return np.hstack((np.cos(half), 0.5 * np.sinc(half / np.pi) * phi))


def logarithm(q: Array) -> Array:
    """(N, 3) rotation vectors of (N, 4) quaternions, the short way, rad."""
    q = q * np.where(q[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[:, :1])
    phi: Array = q[:, 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 2.0)
    return phi


def held_s(t_s: Array) -> Array:
    """(N,) for how long each sample holds: since the one before, unless that is long ago."""
    held: Array = np.clip(np.diff(t_s, prepend=t_s[:1]), 0.0, LONGEST_STEP_S)
    return held


def turns(t_s: Array, w_b: Array, edges_s: Array) -> Array:
    """(M - 1, 4) turn of the body between successive times, by the gyro alone.

    Args:
        w_b: (N, 3) rad/s; each sample is the mean rate since the previous one.
        edges_s: (M,) increasing times, rounded down to samples.
    """
    place = np.clip(np.searchsorted(t_s, edges_s, side="right"), 1, len(t_s))
    counts = np.diff(place)
    dt = held_s(t_s)
    found = np.tile([1.0, 0.0, 0.0, 0.0], (len(counts), 1))
    # Spans of similar length together: products of pairs, then of pairs of pairs, and so on.
    doublings = np.ceil(np.log2(np.maximum(counts, 1))).astype(np.intp)
    for doubling in np.unique(doublings[counts > 0]):
        own = np.flatnonzero((doublings == doubling) & (counts > 0))
        column = np.arange(1 << doubling)
        inside = column < counts[own, None]
        rows = np.where(inside, place[own, None] + column, 0)
        q = exponential((w_b[rows] * (dt[rows] * inside)[:, :, None]).reshape(-1, 3))
        for _ in range(doubling):
            q = product(q[0::2], q[1::2])
        found[own] = q
    return found


class VelocityTrack(NamedTuple):
    """The integral of the acceleration, whose constant is unknown."""

    t_s: Array  # (N,) of the samples
    # (N, 5) NED, m/s; time until then without sample or attitude, s; variance added by slow
    # samples of a vibration, (m/s)^2
    values: Array

    def between(self, from_s: Array, to_s: Array) -> Array:
        """(M, 3) changes from one time to another; NaN where anything in between is unknown."""
        change = interpolated(to_s, self.t_s, self.values) - interpolated(
            from_s, self.t_s, self.values
        )
        moved: Array = change[:, :3]
        moved[~(change[:, 3] < 0.5 * LONGEST_STEP_S)] = np.nan
        return moved

    def variance(self, from_s: Array, to_s: Array) -> Array:
        """(M,) variance of the changes, (m/s)^2, from vibration alone."""
        change = interpolated(to_s, self.t_s, self.values) - interpolated(
            from_s, self.t_s, self.values
        )
        known: Array = np.maximum(np.nan_to_num(change[:, 4]), 0.0)
        return known


def interpolated(at_s: Array, t_s: Array, values: Array) -> Array:
    """(M, k) values between those of the samples; NaN beyond the ends."""
    after = np.clip(np.searchsorted(t_s, at_s), 1, len(t_s) - 1)
    first, last = t_s[after - 1], t_s[after]
    share = ((at_s - first) / np.maximum(last - first, 1e-9))[:, None]
    found: Array = values[after - 1] + share * (values[after] - values[after - 1])
    found[~((at_s >= t_s[0]) & (at_s <= t_s[-1]))] = np.nan
    return found


def inertial_velocity(track: ImuTrack, q_nb: Array) -> VelocityTrack:
    """Integrates the specific force, rotated by the attitude, plus gravity.

    Args:
        track: at least two samples.
        q_nb: (N, 4) attitude at each of them; NaN if unknown.
    """
    is_known = ~np.isnan(q_nb.sum(axis=1))
    acceleration = rotate(np.where(is_known[:, None], q_nb, 0.0), track.f_b)
    acceleration[:, 2] += GRAVITY_M_S2
    gap = np.diff(track.t_s, prepend=track.t_s[:1])
    dt = np.clip(gap, 0.0, LONGEST_STEP_S)
    acceleration[1:] = 0.5 * (acceleration[1:] + acceleration[:-1])
    unknown_s = np.cumsum(np.where(is_known, gap - dt, gap))
    v_n = np.cumsum(acceleration * dt[:, None], axis=0)
    return VelocityTrack(track.t_s, np.column_stack((v_n, unknown_s, noise(track.f_b, dt))))


def noise(values: Array, dt_s: Array) -> Array:
    """(N,) variance of the integral until each sample, if differences of samples are noise.

    Slow samples of a vibration behave like noise.
    """
    apart = np.diff(values, axis=0, prepend=values[:1])
    variance: Array = np.cumsum(0.5 * (apart**2).sum(axis=1) * dt_s**2)
    return variance


def within(t_s: Array, spans: Iterable[Span]) -> Mask:
    """Whether each time is in any of the spans."""
    inside = np.zeros(len(t_s), dtype=bool)
    for span in spans:
        inside |= (t_s >= span.from_s) & (t_s <= span.to_s)
    return inside


def runs(is_so: Mask) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_so, [False])).astype(np.int8)))
    return [(int(first), int(after) - 1) for first, after in edges.reshape(-1, 2)]


def unbroken(is_so: Mask, t_s: Array, longest_s: float) -> list[tuple[int, int]]:
    """The same, each ending where nothing was logged for longer than this."""
    found: list[tuple[int, int]] = []
    for first, last in runs(is_so):
        cuts = first + 1 + np.flatnonzero(np.diff(t_s[first : last + 1]) > longest_s)
        edges = [first, *cuts.tolist(), last + 1]
        found += [(one, after - 1) for one, after in pairwise(edges)]
    return found


def widened(is_so: Mask, count: int) -> Mask:
    """(N,) whether it is true in any of the neighbours, so many to either side."""
    sums = np.cumsum(np.concatenate(([0], is_so.astype(int))))
    places = np.arange(len(is_so))
    first, after = np.maximum(places - count, 0), np.minimum(places + count + 1, len(is_so))
    found: Mask = sums[after] > sums[first]
    return found


def joined(pieces: Iterable[tuple[int, int]], t_s: Array, least_s: float) -> list[tuple[int, int]]:
    """Merges runs that are separated by less than `least_s`."""
    merged: list[tuple[int, int]] = []
    for first, last in pieces:
        if merged and t_s[first] - t_s[merged[-1][1]] < least_s:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged


def means(t_s: Array, values: Array, edges_s: Array) -> Array:
    """(M - 1, k) means of the values between successive times; NaN without values."""
    place = np.searchsorted(t_s, edges_s)
    counts = np.diff(place)
    found = np.full((len(counts), values.shape[1]), np.nan)
    filled = counts > 0
    if filled.any():
        used = values[: place[-1]]
        found[filled] = np.add.reduceat(used, place[:-1][filled], axis=0) / counts[filled, None]
    return found


def slowed(track: ImuTrack) -> ImuTrack:
    """Averages samples in groups that leave 100 a second or more, at the time of their last one.

    This keeps the motion of a vehicle and removes its vibration. Of the field, the newest value
    stays.
    """
    count = len(track.t_s)
    together = int((count - 1) / max(float(track.t_s[-1] - track.t_s[0]), 1e-3) / SLOWED_HZ)
    if together < 2 or count < 2 * together:
        return track._replace(w_b=track.w_b.astype(float), f_b=track.f_b.astype(float))
    whole = count // together * together
    last = slice(together - 1, whole, together)
    fields = track.m_b_ut[:whole].reshape(-1, together, 3)
    newest = together - 1 - np.isfinite(fields[:, ::-1, 0]).argmax(axis=1)
    return track._replace(
        t_s=track.t_s[last],
        stamp_us=track.stamp_us[last],
        w_b=track.w_b[:whole].reshape(-1, together, 3).mean(axis=1, dtype=float),
        f_b=track.f_b[:whole].reshape(-1, together, 3).mean(axis=1, dtype=float),
        m_b_ut=fields[np.arange(len(fields)), newest],
    )


def rate_of(t_s: Array) -> float:
    """Samples a second of at least two, without the pauses in which nothing was logged."""
    steps_s = np.diff(t_s)
    is_pause = steps_s > max(PAUSE_S, PAUSE_PERIODS * float(np.median(steps_s)))
    logged_s = float(t_s[-1] - t_s[0]) - float(steps_s[is_pause].sum())
    return float(np.count_nonzero(~is_pause)) / max(logged_s, 1e-9)


def thinned(length: int, most: int) -> NDArray[np.intp]:
    """Indices of at most `most` rows out of `length`, evenly spaced."""
    if length <= most:
        return np.arange(length)
    return np.linspace(0, length - 1, most).astype(np.intp)
