"""Samples over time: rate, jitter, gaps, duplicates, late bursts, and clocks compared.

Where the recording has two clocks, arrival and the autopilot's stamp, samples that arrive late were
delayed on the way and are not lost; where both jump, samples are lost.
"""

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Array, Context, ImuTrack, Span
from h2nav.reviews.inertial import Mask, runs, within
from h2nav.reviews.tracks import TimingTrack

MAX_COLUMNS = 1000
MIN_SAMPLES = 100
# A stamp that advances by less has repeated its sample.
SAME_US = 0
# The service keeps an attitude over a gap of this length; the estimators of the autopilots (EKF3,
# EKF2: 100 ms at most in one prediction) truncate a longer one.
LONG_GAP_S = 0.1
GAP_PERIODS = 3.0
# A filter without samples for this long starts anew.
LOST_S = 1.0
LOST_SHARE = 0.01
DUPLICATE_SHARE = 0.01
# Below it a small multirotor's motions (5 Hz) have fewer than five samples a period.
# Motors and propellers shake a vehicle at 30 to 200 Hz.
ALIASING_HZ = 45.0
# LOG_BITMASK of ArduCopter, and of the others.
IMU_FAST, IMU_RAW = 1 << 18, 1 << 19
SLOW_HZ = 25.0
# Crystals of autopilots and computers: 50 ppm each, over temperature and age 100 ppm each.
DRIFT_PPM = 200.0
DRIFT_FROM_S = 60.0
# Beyond any crystal or resonator (5,000 ppm): the stamps are those of a simulation that does not
# keep real time, whose arrivals say nothing about a link.
SIMULATED_PPM = 5000.0
# Clocks that never differ by more are the same.
ONE_CLOCK_S = 2e-6
# An autopilot that restarts also restarts its clock.
REBOOT_US = -1_000_000
# On a link: 0.2 s is the worst delay of a receiver's fix.
LATE_S = 0.2
LATE_SHARE = 0.001
DRIFT_WINDOW_S = 10.0
# A clock that was set: the quickest arrivals before and after differ by the whole step.
BESIDE_S, WHOLE_SHARE = 2.0, 0.9


def pauses(context: Context) -> tuple[Span, ...]:
    """Spans without any record: logging paused, so no sensor is to blame."""
    imus = [track.t_s for track in context.imus if len(track.t_s)]
    if not imus:
        return ()
    from_s, to_s = min(t_s[0] for t_s in imus), max(t_s[-1] for t_s in imus)
    others = [*(track.t_s for track in context.attitudes), *(track.t_s for track in context.gps)]
    t_s = np.sort(np.concatenate([*imus, *others]))
    t_s = t_s[(t_s >= from_s) & (t_s <= to_s)]
    places = np.flatnonzero(np.diff(t_s) > LOST_S)
    return tuple(Span(float(t_s[i]), float(t_s[i + 1]), "paused") for i in places)


def detect_pauses(paused: tuple[Span, ...]) -> list[Finding]:
    """One finding for all of them."""
    if not paused:
        return []
    lengths = [span.to_s - span.from_s for span in paused]
    times = f"{len(paused)} times" if len(paused) > 1 else "once"
    shown = "; ".join(f"{span.from_s:.1f} to {span.to_s:.1f} s" for span in paused[:4])
    return [
        Finding(
            Kind.LOG_PAUSED,
            Sensor(SensorKind.LOG),
            Severity.INFO,
            paused[0].from_s,
            paused[-1].to_s,
            sum(lengths),
            "s",
            f"logging paused {times}, for {sum(lengths):.0f} s in all",
            f"no message of any kind from {shown}{' ...' if len(paused) > 4 else ''}",
        )
    ]


def detect_timing(
    track: ImuTrack, armed: tuple[Span, ...], paused: tuple[Span, ...] = ()
) -> tuple[TimingTrack, list[Finding]]:
    """Analyses rate, gaps and lateness of one IMU.

    Args:
        armed: periods in which gaps matter.
        paused: periods without any record, see `pauses`.
    """
    if len(track.t_s) < MIN_SAMPLES or not track.is_timed:
        return _empty(track), []
    imu = Sensor(SensorKind.IMU, track.imu + 1)
    stamp_s, found = _without_jumps(imu, track, stamps_s(track))
    late_s, drift_ppm = _lateness(track.t_s, stamp_s)
    timing = _columns(track, stamp_s, late_s)
    found += _gaps(imu, track, stamp_s, armed, paused)
    found += _rate(imu, track, stamp_s, paused)
    if drift_ppm is not None and abs(drift_ppm) > DRIFT_PPM:
        found.append(_drift(imu, track, drift_ppm))
    if drift_ppm is None or abs(drift_ppm) < SIMULATED_PPM:
        found += _late(imu, track, late_s)
    return timing, found


def _empty(track: ImuTrack) -> TimingTrack:
    nothing = np.zeros(0)
    return TimingTrack(track.imu, track.source, nothing, nothing, nothing, nothing)


def stamps_s(track: ImuTrack) -> Array:
    """(N,) the autopilot's clock, continuous through reboots and wraps, 0 at first."""
    steps = np.diff(track.stamp_us)
    arrival_us = np.diff(track.t_s) * 1e6
    is_new = (steps < REBOOT_US) | (steps > arrival_us + 60e6)
    steps = np.where(is_new, arrival_us, steps)
    return np.concatenate(([0.0], np.cumsum(steps))) * 1e-6


def _without_jumps(imu: Sensor, track: ImuTrack, stamp_s: Array) -> tuple[Array, list[Finding]]:
    """Stamps of a continuous clock, and the finding that it was set.

    From one sample to the next, with usual arrival, the stamp advances by another time, and the
    arrivals are shifted against it by as much from then on. For samples lost, or held back on a
    link, only one of these is true.
    """
    gap_s = np.diff(track.t_s)
    extra_s = np.diff(stamp_s) - gap_s
    least_s = max(LATE_S, GAP_PERIODS * float(np.median(gap_s)))
    places = np.flatnonzero((np.abs(extra_s) > least_s) & (gap_s < LATE_S))
    delay = track.t_s - stamp_s
    jumps = []
    for place in places.tolist():
        at_s = track.t_s[place]
        first, last = np.searchsorted(track.t_s, (at_s - BESIDE_S, at_s + BESIDE_S))
        change = delay[first : place + 1].min() - delay[place + 1 : last + 1].min()
        if WHOLE_SHARE < change / extra_s[place] < 1.0 / WHOLE_SHARE:
            jumps.append(place)
    if not jumps:
        return stamp_s, []
    steps = np.zeros(len(stamp_s))
    steps[np.array(jumps) + 1] = extra_s[jumps]
    largest = max(jumps, key=lambda place: abs(extra_s[place]))
    size = float(extra_s[largest])
    times = "" if len(jumps) == 1 else f", {len(jumps)} times"
    finding = Finding(
        Kind.CLOCK_JUMP,
        imu,
        Severity.WARNING,
        float(track.t_s[jumps[0]]),
        float(track.t_s[jumps[-1] + 1]),
        abs(size),
        "s",
        f"the autopilot's clock jumped by {size:+.2f} s{times}",
        f"the stamp of {track.source} at {track.t_s[largest + 1]:.1f} s, while the samples came as "
        "before: none is missing",
    )
    return stamp_s - np.cumsum(steps), [finding]


def _lateness(t_s: Array, stamp_s: Array) -> tuple[Array | None, float | None]:
    """Lateness of each arrival (N,), and the drift of the stamps against the arrivals, ppm."""
    delay = t_s - stamp_s
    if np.ptp(delay) < ONE_CLOCK_S:
        return None, None
    edges = np.arange(t_s[0], t_s[-1] + DRIFT_WINDOW_S, DRIFT_WINDOW_S)
    place = np.unique(np.searchsorted(t_s, edges[:-1]).clip(max=len(t_s) - 1))
    quickest = np.minimum.reduceat(delay, place)
    centres = t_s[place] + 0.5 * DRIFT_WINDOW_S
    drift = None
    if t_s[-1] - t_s[0] < DRIFT_FROM_S or len(place) < 4:
        return delay - delay.min(), drift
    # The quickest arrivals of each window show the clocks; the median of slopes ignores outliers.
    apart = len(place) // 2
    slopes = (quickest[apart:] - quickest[:-apart]) / (centres[apart:] - centres[:-apart])
    slope = float(np.median(slopes))
    offset = float(np.median(quickest - slope * centres))
    late: Array = np.maximum(delay - slope * t_s - offset, 0.0)
    return late, -slope * 1e6


def _columns(track: ImuTrack, stamp_s: Array, late_s: Array | None) -> TimingTrack:
    t_s = track.t_s
    count = int(np.clip((t_s[-1] - t_s[0]) / 0.5, 1, MAX_COLUMNS))
    edges = np.linspace(t_s[0], t_s[-1], count + 1)
    place = np.searchsorted(t_s, edges)
    rate = np.diff(place) / max(edges[1] - edges[0], 1e-9)
    steps = np.append(np.diff(stamp_s), 0.0)
    longest = _largest(steps, place)
    lateness = np.full(count, np.nan) if late_s is None else _largest(late_s, place)
    centres = 0.5 * (edges[1:] + edges[:-1])
    return TimingTrack(track.imu, track.source, centres, rate, longest, lateness)


def _largest(values: Array, place: np.ndarray) -> Array:
    """Largest value of each column; NaN where it is empty."""
    first = place[:-1].clip(max=len(values) - 1)
    largest: Array = np.maximum.reduceat(values, first)
    return np.where(np.diff(place) > 0, largest, np.nan)


def _gaps(
    imu: Sensor,
    track: ImuTrack,
    stamp_s: Array,
    armed: tuple[Span, ...],
    paused: tuple[Span, ...],
) -> list[Finding]:
    """Samples that never came, while the motors could turn."""
    steps = np.diff(stamp_s)
    period = float(np.median(steps))
    flying = within(track.t_s[:-1], armed) & ~_is_paused(track.t_s, paused)
    is_gap = (steps > GAP_PERIODS * period) & (steps > 0.5 * LONG_GAP_S) & flying
    if period <= 0.0 or not is_gap.any():
        return []
    lost = np.round(steps[is_gap] / period) - 1.0
    share = float(lost.sum()) / max(float(flying.sum() + lost.sum()), 1.0)
    longest = float(steps[is_gap].max())
    if longest < LONG_GAP_S and share < LOST_SHARE:
        return []
    places = np.flatnonzero(is_gap)
    text = f"{len(places)} gaps in the samples, the longest {longest:.2f} s"
    if len(places) == 1:
        text = f"a gap of {longest:.2f} s in the samples"
    return [
        Finding(
            Kind.IMU_GAPS,
            imu,
            Severity.WARNING if longest >= LOST_S else Severity.NOTICE,
            float(track.t_s[places[0]]),
            float(track.t_s[places[-1] + 1]),
            longest,
            "s",
            text,
            f"the autopilot's stamps jump: {int(lost.sum())} samples ({share:.1%}) are missing "
            f"in {track.source}; usual is one every {period * 1e3:.1f} ms",
        )
    ]


def _is_paused(t_s: Array, paused: tuple[Span, ...]) -> Mask:
    """(N - 1,) whether a pause lies between two samples."""
    middles = np.array([0.5 * (span.from_s + span.to_s) for span in paused])
    found: Mask = np.diff(np.searchsorted(middles, t_s)) > 0
    return found


def _rate(imu: Sensor, track: ImuTrack, stamp_s: Array, paused: tuple[Span, ...]) -> list[Finding]:
    """Too low a rate, or duplicate samples."""
    steps = np.diff(stamp_s)
    from_s, to_s = float(track.t_s[0]), float(track.t_s[-1])
    found = []
    is_logged = ~_is_paused(track.t_s, paused)
    logged_s = float(np.diff(track.t_s)[is_logged].sum())
    rate = np.count_nonzero(is_logged) / max(logged_s, 1e-9)
    if rate < SLOW_HZ:
        text = f"only {rate:.0f} samples a second were recorded"
        evidence = f"{len(track.t_s)} of {track.source} in {logged_s:.0f} s"
        found.append(
            Finding(Kind.IMU_SLOW, imu, Severity.NOTICE, from_s, to_s, rate, "Hz", text, evidence)
        )
    share = float(np.mean(steps <= SAME_US))
    if share > DUPLICATE_SHARE:
        text = f"{share:.0%} of the samples came twice"
        evidence = "the same time stamp as the sample before"
        size = 100.0 * share
        found.append(
            Finding(Kind.IMU_TWICE, imu, Severity.NOTICE, from_s, to_s, size, "%", text, evidence)
        )
    return found


def detect_slow_log(track: ImuTrack, context: Context) -> list[Finding]:
    """Samples of an autopilot's own log that alias a vibration, so that integrated rates are wrong.

    Args:
        context: parameters, for the advised setting.
    """
    steps = np.diff(track.stamp_us)
    period_us = float(np.median(steps)) if len(steps) else 0.0
    if len(track.t_s) < MIN_SAMPLES or period_us <= 1e6 / ALIASING_HZ:
        return []
    rate = 1e6 / period_us
    mask = context.parameters.get("LOG_BITMASK")
    setting = "SDLOG_PROFILE with high rates (bit 2)"
    if mask is not None:
        bit = IMU_FAST if context.motors is not None else IMU_RAW
        setting = f"LOG_BITMASK {int(mask) | bit} (now {int(mask)})"
    return [
        Finding(
            Kind.IMU_TOO_SLOW,
            Sensor(SensorKind.IMU, track.imu + 1),
            Severity.NOTICE,
            float(track.t_s[0]),
            float(track.t_s[-1]),
            rate,
            "Hz",
            f"logged {rate:.0f} times a second: too seldom for an attitude of our own",
            f"vibration between two samples is taken for a turn; set {setting}",
        )
    ]


def _drift(imu: Sensor, track: ImuTrack, ppm: float) -> Finding:
    from_s, to_s = float(track.t_s[0]), float(track.t_s[-1])
    text = f"the autopilot's clock runs {abs(ppm):.0f} ppm {'fast' if ppm > 0 else 'slow'}"
    evidence = (
        f"against the recorder's clock over {to_s - from_s:.0f} s, by the quickest arrivals of "
        f"each {DRIFT_WINDOW_S:.0f} s; two crystals differ by {DRIFT_PPM:.0f} ppm at most"
    )
    severity = Severity.NOTICE
    if abs(ppm) > SIMULATED_PPM:
        severity = Severity.INFO
        evidence += ": a simulation that did not keep to real time"
    return Finding(Kind.CLOCK_DRIFT, imu, severity, from_s, to_s, abs(ppm), "ppm", text, evidence)


def _late(imu: Sensor, track: ImuTrack, late_s: Array | None) -> list[Finding]:
    """Bursts that the link held back."""
    if late_s is None:
        return []
    is_late = late_s > LATE_S
    share = float(is_late.mean())
    if share < LATE_SHARE:
        return []
    bursts = runs(is_late)
    worst = float(late_s.max())
    text = f"samples up to {worst:.2f} s late on the link"
    evidence = (
        f"{share:.1%} of the arrivals more than {LATE_S * 1e3:.0f} ms later than the quickest "
        f"ones by their stamps, in {len(bursts)} burst{'s' * (len(bursts) > 1)}"
    )
    from_s, to_s = float(track.t_s[bursts[0][0]]), float(track.t_s[bursts[-1][1]])
    return [
        Finding(Kind.LATE_BURSTS, imu, Severity.NOTICE, from_s, to_s, worst, "s", text, evidence)
    ]
