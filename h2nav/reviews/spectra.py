"""Vibration: its level as ArduPilot's VIBE, its spectrum and lines, and a notch for them.

Only the time with turning motors counts. Bursts at the sensor's own rate show the lines at their
true frequencies. Recorded samples show nothing above half their rate, and a higher line appears
below at another frequency: it is reported as seen, and no notch is advised.
"""

import itertools
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, Burst, ImuTrack, Span, VibrationTrack
from h2nav.reviews.inertial import Mask, rate_of, within
from h2nav.reviews.tracks import Peak, Spectrum, Vibrations

MAX_BINS = 256
MAX_COLUMNS = 300
MIN_WINDOWS = 4
# A long flight is analysed in pieces with gaps between them.
MAX_WINDOWS = 1500
AT_ONCE = 64
UNITS = {"gyro": "rad/s", "accelerometer": "m/s^2"}
# Times may differ from equal steps by this share of a window.
UNEVEN_SHARE = 0.02
# Slower changes are the flight itself.
SLOWEST_LINE_HZ = 8.0
# A line: its density relative to its surroundings (10 dB in power), over this many bins.
LINE_FACTOR = 3.2
SURROUNDINGS = 21
MAX_PEAKS = 8
# Lines worth a notch: what shakes a gyro of 0.01 deg/s/sqrt(Hz) (MPU-9250 data sheet) in a
# bandwidth of 80 Hz (INS_GYRO_FILTER of small multirotors) ten times more than its noise does.
GYRO_LINE_RAD_S = 0.016
FORCE_LINE_M_S2 = 3.0
# A stream with a lower rate is not searched for motors' lines (50 to 400 Hz).
ADVISED_FROM_HZ = 390.0
HIGHEST_SHARE = 0.45
MAX_HARMONICS = 4
# ArduPilot: levels below 30 m/s^2 are normal, above 60 nearly always trouble; fewer than 100
# clipped samples may be a landing ("Measuring Vibration"). Filters of 5 Hz and 2 Hz, one pole each
# (AP_InertialSensor, calc_vibration_and_clipping).
VIBE_LIMIT_M_S2 = 30.0
VIBE_BAD_M_S2 = 60.0
VIBE_FLOOR_HZ, VIBE_LEVEL_HZ = 5.0, 2.0
MAX_CLIPPED = 100
CLIPPED_M_S2 = 15.5 * GRAVITY_M_S2
LEVELS = 2000
# A landing, or a bump, shakes it for some seconds.
MEASURED_S = 10.0
LASTING_S = 1.0
BLOCK = 128


class _Windows(NamedTuple):
    """Amplitude densities squared of equally long windows: (W,) times, (W, F, 3)."""

    t_s: Array
    power: Array
    frequency_hz: Array
    rate_hz: float


def detect_spectra(
    tracks: tuple[ImuTrack, ...], bursts: tuple[Burst, ...], armed: tuple[Span, ...]
) -> tuple[tuple[Spectrum, ...], list[Finding]]:
    """Spectra of all sensors and findings on them.

    Args:
        tracks: samples as recorded.
        bursts: at the sensors' own rates; they replace the sensor's track.
        armed: while the motors could turn; empty = unknown, and nothing is reported.
    """
    spectra, found = [], []
    imus = sorted({track.imu for track in tracks} | {burst.imu for burst in bursts})
    for imu, sensor in itertools.product(imus, UNITS):
        own = [b for b in bursts if b.imu == imu and b.sensor == sensor]
        windows = _of_bursts(own, armed)
        is_burst = windows is not None
        if windows is None:
            track = next((t for t in tracks if t.imu == imu), None)
            windows = None if track is None else _of_track(track, sensor, armed)
        if windows is None:
            continue
        spectrum = _spectrum(windows, imu, sensor, is_burst)
        spectra.append(spectrum)
        if armed:
            found += _lines(spectrum)
    return tuple(spectra), found


def _of_bursts(bursts: list[Burst], armed: tuple[Span, ...]) -> _Windows | None:
    """Windows of bursts, those with the usual length and rate."""
    if armed:
        bursts = [b for b in bursts if within(np.array([b.t_s]), armed)[0]]
    bursts = [b for b in bursts if len(b.values) >= 64 and np.isfinite(b.values).all()]
    if len(bursts) < MIN_WINDOWS:
        return None
    rate = float(np.median([b.rate_hz for b in bursts]))
    length = min(int(np.median([len(b.values) for b in bursts])), 2 * MAX_BINS)
    fitting = [b for b in bursts if len(b.values) >= length and abs(b.rate_hz - rate) < 0.05 * rate]
    if len(fitting) < MIN_WINDOWS:
        return None
    pieces, times = [], []
    for burst in fitting:
        for first in range(0, len(burst.values) - length + 1, max(length // 2, 1)):
            pieces.append(burst.values[first : first + length])
            times.append(burst.t_s + (first + 0.5 * length) / rate)
    return _densities(np.array(times), np.array(pieces).transpose(0, 2, 1), rate)


def _of_track(track: ImuTrack, sensor: str, armed: tuple[Span, ...]) -> _Windows | None:
    """Windows of a stream without gaps, overlapping by half up to a limit of windows."""
    values = track.w_b if sensor == "gyro" else track.f_b
    t_s = track.t_s
    length = 2 * MAX_BINS
    if len(t_s) < length:
        return None
    stamp_s = track.stamp_us * 1e-6
    period = float(np.median(np.diff(stamp_s)))
    if period <= 0.0:
        return None
    step = max(length // 2, (len(t_s) - length) // MAX_WINDOWS)
    starts = np.arange(0, len(t_s) - length + 1, step)
    nominal = (length - 1) * period
    span = stamp_s[starts + length - 1] - stamp_s[starts]
    good = np.abs(span - nominal) < UNEVEN_SHARE * nominal
    if armed:
        good &= within(t_s[starts], armed) & within(t_s[starts + length - 1], armed)
    starts = starts[good]
    if len(starts) < MIN_WINDOWS:
        return None
    times = t_s[starts + length // 2]
    windows = np.lib.stride_tricks.sliding_window_view(values, length, axis=0)
    rate_hz = (length - 1) / float(np.mean(span[good]))
    return _densities(times, windows[starts], rate_hz)


def _densities(t_s: Array, pieces: Array, rate_hz: float) -> _Windows:
    """Densities of (W, 3, n) pieces: Hann windows, with mean and slope removed."""
    length = pieces.shape[2]
    slope = np.linspace(-1.0, 1.0, length)
    hann = np.hanning(length + 1)[:-1]
    power = np.empty((len(pieces), min(length // 2, MAX_BINS), 3))
    # As many at a time as fit into a processor's cache.
    for first in range(0, len(pieces), AT_ONCE):
        part = pieces[first : first + AT_ONCE].astype(float)
        part -= part.mean(axis=2, keepdims=True)
        part = part - (part @ slope / float(slope @ slope))[:, :, None] * slope
        spectrum = np.fft.rfft(part * hann, axis=2)[:, :, 1 : power.shape[1] + 1]
        power[first : first + AT_ONCE] = (spectrum.real**2 + spectrum.imag**2).transpose(0, 2, 1)
    power *= 2.0 / (rate_hz * float(hann @ hann))
    frequency = np.arange(1, power.shape[1] + 1) * (rate_hz / length)
    return _Windows(t_s, power, frequency, rate_hz)


def _spectrum(windows: _Windows, imu: int, sensor: str, is_burst: bool) -> Spectrum:
    order = np.argsort(windows.t_s, kind="stable")
    power = windows.power[order]
    columns = min(MAX_COLUMNS, len(order))
    place = np.linspace(0, len(order), columns + 1).astype(np.intp)[:-1]
    counts = np.diff(np.append(place, len(order)))
    total = np.add.reduceat(power.sum(axis=2), place, axis=0) / counts[:, None]
    mean = power.mean(axis=0)
    return Spectrum(
        imu,
        sensor,
        UNITS[sensor],
        windows.rate_hz,
        is_burst,
        windows.frequency_hz,
        np.sqrt(mean),
        _peaks(windows.frequency_hz, mean.sum(axis=1)),
        np.add.reduceat(windows.t_s[order], place) / counts,
        np.sqrt(total).astype(np.float32),
    )


def _peaks(frequency_hz: Array, power: Array) -> tuple[Peak, ...]:
    """Lines above their surroundings, strongest first, with their harmonics numbered."""
    padded = np.pad(power, SURROUNDINGS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * SURROUNDINGS + 1)
    floor = np.median(windows, axis=1)
    over = power > LINE_FACTOR**2 * floor
    highest = np.r_[False, (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]), False]
    step = float(frequency_hz[1] - frequency_hz[0])
    found: list[Peak] = []
    taken = np.zeros(len(power), dtype=bool)
    for place in sorted(np.flatnonzero(over & highest).tolist(), key=lambda i: -power[i]):
        if taken[place] or frequency_hz[place] < SLOWEST_LINE_HZ or len(found) == MAX_PEAKS:
            continue
        low, high = _reach(power, 2.0 * floor, place)
        taken[low : high + 1] = True
        excess = np.maximum(power[low : high + 1] - floor[low : high + 1], 0.0)
        centre = float((excess * frequency_hz[low : high + 1]).sum() / excess.sum())
        half_low, half_high = _reach(power, np.full(len(power), 0.5 * power[place]), place)
        width = (half_high - half_low + 1) * step
        found.append(Peak(centre, width, float(np.sqrt(excess.sum() * step)), 0))
    return _families(found, step)


def _reach(power: Array, least: Array, place: int) -> tuple[int, int]:
    """The first and last index around a peak that stay above a level."""
    low = high = place
    while low > 0 and power[low - 1] > least[low - 1]:
        low -= 1
    while high < len(power) - 1 and power[high + 1] > least[high + 1]:
        high += 1
    return low, high


def _families(peaks: list[Peak], step_hz: float) -> tuple[Peak, ...]:
    """Numbers the harmonics of the fundamental that explains most of the lines' power."""
    best: tuple[float, dict[int, int]] = (0.0, {})
    for fundamental in peaks:
        members: dict[int, int] = {}
        for number, peak in enumerate(peaks):
            harmonic = round(peak.frequency_hz / fundamental.frequency_hz)
            apart = abs(peak.frequency_hz - harmonic * fundamental.frequency_hz)
            if 1 <= harmonic <= MAX_HARMONICS and apart <= harmonic * 1.5 * step_hz:
                members[number] = harmonic
        power = sum(peaks[number].rms ** 2 for number in members)
        if len(members) > 1 and power > best[0]:
            best = (power, members)
    return tuple(p._replace(harmonic=best[1].get(i, 0)) for i, p in enumerate(peaks))


def _lines(spectrum: Spectrum) -> list[Finding]:
    """Findings on the lines of one sensor."""
    least = GYRO_LINE_RAD_S if spectrum.sensor == "gyro" else FORCE_LINE_M_S2
    strong = [peak for peak in spectrum.peaks if peak.rms >= least]
    if not strong:
        return []
    peak = strong[0]
    seen = ", ".join(
        f"{p.frequency_hz:.0f} Hz ({p.rms:.2g} {spectrum.unit} rms{_order(p)})" for p in strong[:4]
    )
    text = f"{spectrum.sensor} vibrates at {peak.frequency_hz:.0f} Hz"
    if spectrum.is_burst:
        evidence = f"lines at {seen}; from bursts at {spectrum.rate_hz:.0f} Hz"
    else:
        text += " or an alias of it"
        evidence = (
            f"lines at {seen}; samples at {spectrum.rate_hz:.0f} Hz show nothing above "
            f"{0.5 * spectrum.rate_hz:.0f} Hz, and a line f above it as |f - n "
            f"{spectrum.rate_hz:.0f}|"
        )
    if spectrum.sensor == "gyro":
        evidence += f"; {_notch(spectrum)}"
    return [
        Finding(
            Kind.VIBRATION_LINE,
            Sensor(SensorKind.IMU, spectrum.imu + 1),
            Severity.INFO,
            float(spectrum.t_s[0]),
            float(spectrum.t_s[-1]),
            peak.rms,
            spectrum.unit,
            text,
            evidence,
        )
    ]


def _order(peak: Peak) -> str:
    return f", harmonic {peak.harmonic}" if peak.harmonic else ""


class Family(NamedTuple):
    """A family of lines for a notch."""

    base_hz: float  # the fundamental
    mask: int  # bit 0 for the fundamental, bit 1 for twice as much, and so on
    lines: tuple[Peak, ...]  # the peaks, by harmonic


def family_of(spectrum: Spectrum) -> Family | None:
    """The strongest lines of a gyro; None if the samples do not show their frequencies."""
    strong = [peak for peak in spectrum.peaks if peak.rms >= GYRO_LINE_RAD_S]
    if not strong or spectrum.rate_hz < ADVISED_FROM_HZ:
        return None
    family = sorted((p for p in spectrum.peaks if p.harmonic), key=lambda p: p.harmonic)
    lines = family if strong[0].harmonic else strong[:1]
    base = lines[0].frequency_hz / max(lines[0].harmonic, 1)
    mask = sum({1 << (max(p.harmonic, 1) - 1) for p in lines})
    return Family(base, mask, tuple(lines)) if base <= HIGHEST_SHARE * spectrum.rate_hz else None


def _notch(spectrum: Spectrum) -> str:
    """Parameters of a notch, if the samples show the line's frequency."""
    if spectrum.rate_hz < ADVISED_FROM_HZ:
        return "no notch can be advised: record bursts (INS_LOG_BAT_MASK) or the raw gyro"
    family = family_of(spectrum)
    if family is None:
        return "the line is too near half the rate for a notch to be advised"
    base, mask, lines = family
    # ArduPilot's bandwidth at half the frequency; PX4's default of 20 Hz, or what the line needs.
    width = max(20.0, 2.0 * lines[0].width_hz)
    advice = (
        f"ArduPilot: INS_HNTCH_ENABLE 1, INS_HNTCH_FREQ {base:.0f}, INS_HNTCH_BW {base / 2:.0f}, "
        f"INS_HNTCH_HMNCS {mask}; PX4: IMU_GYRO_NF0_FRQ {lines[0].frequency_hz:.0f}, "
        f"IMU_GYRO_NF0_BW {width:.0f}"
    )
    if len(lines) > 1:
        advice += f", IMU_GYRO_NF1_FRQ {lines[1].frequency_hz:.0f}, IMU_GYRO_NF1_BW {width:.0f}"
    return advice


def detect_vibration(
    track: ImuTrack, armed: tuple[Span, ...], *, is_reported: bool
) -> tuple[Vibrations, list[Finding]]:
    """The level of one accelerometer, and its clipped samples.

    Args:
        armed: while the motors could turn.
        is_reported: a check in flight has reported this IMU's vibration already.
    """
    t_s = track.t_s
    clipped = (np.abs(track.f_b) >= CLIPPED_M_S2) @ np.ones(3) > 0.0
    rate_hz = rate_of(t_s) if len(t_s) > 1 else 0.0
    level = vibe(track.f_b, rate_hz)
    flying = within(t_s, armed)
    found = [] if is_reported else _level(track, level, flying, rate_hz)
    count = int((clipped & flying).sum())
    if count > MAX_CLIPPED:
        found.append(_clipped(track, clipped & flying, count))
    place = np.linspace(0, max(len(t_s) - 1, 0), min(LEVELS, len(t_s))).astype(np.intp)
    shown = Vibrations(track.imu, t_s[place], level[place], VIBE_LIMIT_M_S2, int(clipped.sum()))
    return shown, found


def vibe(f_b: Array, rate_hz: float) -> Array:
    """(N, 3) ArduPilot's VIBE of each sample: above 5 Hz, the squares smoothed by 2 Hz."""
    if rate_hz <= 0.0 or len(f_b) < 2:
        return np.zeros_like(f_b)
    shaken = f_b - _low_pass(f_b, VIBE_FLOOR_HZ, rate_hz)
    level: Array = np.sqrt(np.maximum(_low_pass(shaken**2, VIBE_LEVEL_HZ, rate_hz), 0.0))
    return level


def _low_pass(values: Array, cutoff_hz: float, rate_hz: float) -> Array:
    """A one-pole filter, started at the first value, computed in blocks by matrix products."""
    step = 2.0 * np.pi * cutoff_hz / rate_hz
    share = step / (step + 1.0)
    powers = (1.0 - share) ** np.arange(BLOCK + 1)
    apart = np.arange(BLOCK)[:, None] - np.arange(BLOCK)
    inner = np.where(apart >= 0, share * powers[np.clip(apart, 0, BLOCK)], 0.0)
    count = -(-len(values) // BLOCK)
    padded = np.vstack((values, np.zeros((count * BLOCK - len(values), 3))))
    columns = padded.reshape(count, BLOCK, 3).transpose(1, 0, 2).reshape(BLOCK, -1)
    inside = (inner @ columns).reshape(BLOCK, count, 3)
    states = np.empty((count, 3))
    state = values[0]
    for number, own in enumerate(inside[-1]):
        states[number] = state
        state = own + powers[BLOCK] * state
    blocks = inside + powers[1:, None, None] * states
    smooth: Array = blocks.transpose(1, 0, 2).reshape(-1, 3)[: len(values)]
    return smooth


def _level(track: ImuTrack, level: Array, flying: Mask, rate_hz: float) -> list[Finding]:
    worst = np.maximum(np.maximum(level[:, 0], level[:, 1]), level[:, 2])
    is_high = (worst > VIBE_LIMIT_M_S2) & flying
    if is_high.sum() < LASTING_S * rate_hz:
        return []
    places = np.flatnonzero(is_high)
    size = float(worst[is_high].max())
    evidence = (
        f"above {VIBE_LIMIT_M_S2:.0f} m/s^2 for {is_high.sum() / rate_hz:.0f} s, by ArduPilot's "
        f"VIBE of samples at {rate_hz:.0f} Hz; {VIBE_BAD_M_S2:.0f} is nearly always trouble"
    )
    return [
        Finding(
            Kind.VIBRATION_LEVEL,
            Sensor(SensorKind.IMU, track.imu + 1),
            Severity.WARNING,
            float(track.t_s[places[0]]),
            float(track.t_s[places[-1]]),
            size,
            "m/s^2",
            f"vibration up to {size:.0f} m/s^2",
            evidence,
        )
    ]


def is_measured(measured: VibrationTrack) -> Mask:
    """(N,) rows with a level."""
    return np.asarray(np.isfinite(measured.level).any(axis=1))


def detect_measured(measured: VibrationTrack, armed: tuple[Span, ...]) -> list[Finding]:
    """The level that the autopilot measured, where its log has too few samples to show it.

    Args:
        measured: at the sensor's own rate.
        armed: while the motors could turn.
    """
    known = is_measured(measured)
    t_s, level = measured.t_s[known], measured.level[known]
    if len(t_s) < 2:
        return []
    worst = np.nanmax(level, axis=1)
    period_s = float(np.median(np.diff(t_s)))
    places = np.flatnonzero((worst > VIBE_LIMIT_M_S2) & within(t_s, armed))
    if len(places) * period_s < MEASURED_S:
        return []
    size = float(worst[places].max())
    return [
        Finding(
            Kind.VIBRATION_LEVEL,
            Sensor(SensorKind.IMU, measured.imu + 1),
            Severity.WARNING,
            float(t_s[places[0]]),
            float(t_s[places[-1]]),
            size,
            "m/s^2",
            f"vibration up to {size:.0f} m/s^2",
            f"above {VIBE_LIMIT_M_S2:.0f} m/s^2 for {len(places) * period_s:.0f} s, as the "
            f"autopilot measured it; {VIBE_BAD_M_S2:.0f} is nearly always trouble",
        )
    ]


def _clipped(track: ImuTrack, clipped: Mask, count: int) -> Finding:
    places = np.flatnonzero(clipped)
    return Finding(
        Kind.CLIPPED_SAMPLES,
        Sensor(SensorKind.IMU, track.imu + 1),
        Severity.WARNING,
        float(track.t_s[places[0]]),
        float(track.t_s[places[-1]]),
        float(count),
        "",
        f"{count} samples of the accelerometer clipped",
        f"beyond {CLIPPED_M_S2 / GRAVITY_M_S2:.1f} g while armed; a few may be the landing",
    )
