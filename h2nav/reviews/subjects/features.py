"""The figures of a flight that are compared with those of the airframe's earlier flights.

Each function here measures some of `h2nav.airframes.features.FEATURES`, out of evidence that the
review has anyway. What is not known is absent. Figures of a flight end where it crashed.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from h2nav.airframes.features import FlightRow, airframe_id
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, Battery, Context
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import FlightEvidence
from h2nav.reviews.impacts import BIN_S, Bins, in_flight
from h2nav.reviews.inertial import Mask, within
from h2nav.reviews.motors import outputs_beyond_others
from h2nav.reviews.subjects import compass, receiver, touchdown, vibration

# A hover: level, without climb and speed, for this long in total.
HOVER_RAD, HOVER_CLIMB_M_S, HOVER_M_S, HOVER_S = 12.0 * DEG, 0.5, 2.0, 10.0
MIN_ROWS = 20
# The battery's resistance: by changes of the current within windows, in which its charge is the
# same, where they are large and explain those of the voltage.
SAG_WINDOW_S, SAG_MIN_A, SAG_EXPLAINED = 20.0, 1.0, 0.5
MEASURED_V = 1.0
MICRO = 1e-6
# A slower receiver stands still.
MOVING_M_S = 0.5
LONGEST_FIX_GAP_S = 5.0

Named = Iterator[tuple[str, float]]


def features(evidence: FlightEvidence) -> Mapping[str, float]:
    """All known figures by name, in order."""
    makers = (_shaken, _lines, _hover, _motors, _compasses, _biases, _receivers, _supplied, _ended)
    found = {name: value for maker in makers for name, value in maker(evidence)}
    return {name: found[name] for name in sorted(found) if math.isfinite(found[name])}


def flight_row(evidence: FlightEvidence) -> FlightRow:
    """What is remembered of this flight."""
    context = evidence.flight.context
    start = context.start_unix_s
    return FlightRow(
        evidence.flight.name,
        airframe_id(context.uid, context.system_id, context.board or context.vehicle),
        math.nan if start is None else start,
        evidence.of(features),
        evidence.of(flown_s),
        evidence.of(distance_m),
        evidence.of(landings),
        sum(not blow.is_crash for blow in evidence.of(parts.blows)),
    )


# --- in the air ---------------------------------------------------------------------------------


def flying(evidence: FlightEvidence) -> Mask:
    """(N,) of the bins: it is in the air, and has not crashed."""
    bins = evidence.of(parts.bins)
    if bins is None or not evidence.of(parts.has_times):
        return np.zeros(0, np.bool_)
    return in_flight(bins, evidence.of(parts.recorded), evidence.of(parts.crashes))


def flown_s(evidence: FlightEvidence) -> float:
    """How long it was in the air; 0 for less than what counts as a flight."""
    seconds = float(evidence.of(flying).sum()) * BIN_S
    return seconds if seconds >= parts.FLOWN_S else 0.0


def distance_m(evidence: FlightEvidence) -> float:
    """Length of its way over ground in the air, by the first receiver with a fix."""
    bins = evidence.of(parts.bins)
    tracks = [gps for gps in evidence.of(parts.receivers) if gps.has_fix.sum() > 1]
    if bins is None or not tracks:
        return 0.0
    gps = tracks[0]
    speed = np.hypot(gps.v_n[:, 0], gps.v_n[:, 1])
    flies = _at(bins, evidence.of(flying), gps.t_s) & gps.has_fix & (speed > MOVING_M_S)
    step_s = np.diff(gps.t_s, prepend=gps.t_s[0]).clip(0.0, LONGEST_FIX_GAP_S)
    return float((np.nan_to_num(speed) * step_s)[flies].sum())


def landings(evidence: FlightEvidence) -> int:
    """How often it came down: touchdowns that were measured, or flights that ended disarmed."""
    bins, flies = evidence.of(parts.bins), evidence.of(flying)
    if bins is None:
        return 0
    context = evidence.of(parts.recorded)
    ended = sum(
        bool(flies[(bins.t_s >= span.from_s) & (bins.t_s <= span.to_s)].any())
        for span in context.armed
        if span.to_s < context.duration_s - BIN_S
        and not parts.flies_on(evidence, span)
        and not any(span.from_s <= crash.t_s <= span.to_s for crash in evidence.of(parts.crashes))
    )
    return max(ended, len(evidence.of(_touchdowns)))


def _touchdowns(evidence: FlightEvidence) -> list[float]:
    """Their vertical speeds, m/s."""
    if touchdown.SUBJECT.lacks(evidence):
        return []
    return [one.size for one in touchdown.look(evidence)]


def _at(bins: Bins, mask: Mask, t_s: Array) -> Mask:
    """(M,) a mask of bins at other times."""
    if not len(bins.t_s):
        return np.zeros(len(t_s), np.bool_)
    place = np.searchsorted(bins.t_s, t_s).clip(max=len(bins.t_s) - 1)
    found: Mask = mask[place] & (np.abs(bins.t_s[place] - t_s) < 2.0 * BIN_S)
    return found


# --- the figures --------------------------------------------------------------------------------


def _shaken(evidence: FlightEvidence) -> Named:
    """Vibration and temperature by the autopilot, at the sensors' own rate."""
    bins, flies = evidence.of(parts.bins), evidence.of(flying)
    if bins is None:
        return
    context = evidence.of(parts.recorded)
    for track in context.vibrations:
        level = np.linalg.norm(track.level.reshape(len(track.t_s), -1), axis=1)
        yield (
            f"imu_{track.imu + 1}_vibration_m_s2",
            _median(level[_at(bins, flies, track.t_s)], MIN_ROWS),
        )
    for warm in context.temperatures:
        here = warm.temperature_degc[_at(bins, flies, warm.t_s)]
        yield f"imu_{warm.imu + 1}_temperature_degc", _median(here, MIN_ROWS)


def _lines(evidence: FlightEvidence) -> Named:
    """What moves with the motors' rotation: an unbalanced mass moves an IMU by the same way at
    every speed, while its force grows with the square.
    """
    bins, flies = evidence.of(parts.bins), evidence.of(flying)
    if bins is None:
        return
    rates_hz = [
        _median(esc.rpm[_at(bins, flies, esc.t_s)], MIN_ROWS) / 60.0
        for esc in evidence.of(parts.recorded).escs
    ]
    known = [rate for rate in rates_hz if math.isfinite(rate) and rate > 0.0]
    if known:
        yield "rotation_hz", float(np.median(known))
    for spectrum in evidence.of(vibration.spectra)[0]:
        if spectrum.sensor != "accelerometer" or not spectrum.is_burst:
            continue
        first = next((peak for peak in spectrum.peaks if peak.harmonic == 1), None)
        if first is not None:
            way_m = first.rms / (2.0 * math.pi * first.frequency_hz) ** 2
            yield f"imu_{spectrum.imu + 1}_displacement_um", way_m / MICRO
            if not known:
                yield "rotation_hz", first.frequency_hz


def _hover(evidence: FlightEvidence) -> Named:
    """The throttle in a hover."""
    bins, context = evidence.of(parts.bins), evidence.of(parts.recorded)
    throttle, climb = context.throttle, context.climb_m_s
    if bins is None or throttle is None or context.vehicle_type not in MULTIROTORS:
        return
    tilt = np.arccos(np.clip(-bins.f_b[:, 2] / np.linalg.norm(bins.f_b, axis=1), -1.0, 1.0))
    hovers = evidence.of(flying) & (tilt < HOVER_RAD)
    if climb is not None and len(climb.t_s):
        hovers &= np.abs(np.interp(bins.t_s, climb.t_s, climb.values)) < HOVER_CLIMB_M_S
    for gps in evidence.of(parts.receivers)[:1]:
        speed = np.nan_to_num(np.hypot(gps.v_n[:, 0], gps.v_n[:, 1]), nan=math.inf)
        hovers &= np.interp(bins.t_s, gps.t_s, speed) < HOVER_M_S if len(gps.t_s) else False
    if hovers.sum() * BIN_S >= HOVER_S:
        share = np.interp(bins.t_s[hovers], throttle.t_s, throttle.values)
        yield "hover_throttle", _median(share, 1)


def _motors(evidence: FlightEvidence) -> Named:
    """Each motor's output beyond the mean of the others, wind and motion taken out."""
    bins, context = evidence.of(parts.bins), evidence.of(parts.in_order)
    if bins is None:
        return
    own = outputs_beyond_others(bins, context, evidence.of(parts.crashes))
    for number, beyond_us in own.items():
        yield f"motor_{number}_us", beyond_us
    if own:
        yield "motor_spread_us", max(own.values()) - min(own.values())


def _compasses(evidence: FlightEvidence) -> Named:
    if compass.SUBJECT.lacks(evidence) or not evidence.of(parts.has_times):
        return
    for _, fit, _ in evidence.of(compass.compasses):
        if fit is not None:
            yield f"compass_{fit.compass + 1}_residual_ut", _median(fit.residual_ut, 1)


def _biases(evidence: FlightEvidence) -> Named:
    if not evidence.of(parts.has_times):
        return
    for bias in evidence.of(parts.biases)[0]:
        for axis, values in zip("xyz", bias.gyro_b.T, strict=True):
            name = f"imu_{bias.imu + 1}_gyro_bias_{axis}_deg_s"
            yield name, _median(values, 3) / DEG
        yield (
            f"imu_{bias.imu + 1}_force_at_rest_m_s2",
            _median(bias.force_norm, 3) - GRAVITY_M_S2,
        )


def _receivers(evidence: FlightEvidence) -> Named:
    if receiver.SUBJECT.lacks(evidence):
        return
    for shown, _ in evidence.of(receiver.receivers):
        # The change of a velocity has the noise of two, in two axes: their median length.
        size = np.linalg.norm(shown.difference_n[:, :2], axis=1)
        noise = _median(size, MIN_ROWS) / math.sqrt(2.0 * 2.0 * math.log(2.0))
        yield f"gps_{shown.receiver + 1}_velocity_noise_m_s", noise
        yield f"gps_{shown.receiver + 1}_delay_s", shown.lag_s


def _supplied(evidence: FlightEvidence) -> Named:
    """The battery, and the link of telemetry."""
    context = evidence.of(parts.recorded)
    for battery in context.batteries[:1]:
        yield "battery_resistance_ohm", resistance_ohm(battery, context)
    lost = context.link_loss_share
    if lost is not None:
        yield "link_loss_share", lost


def resistance_ohm(battery: Battery, context: Context) -> float:
    """Sag of the voltage per ampere while armed; NaN where the current does not show it."""
    good = np.isfinite(battery.current_a) & (battery.voltage_v > MEASURED_V)
    good &= within(battery.t_s, context.armed)
    window = np.floor(battery.t_s[good] / SAG_WINDOW_S).astype(np.int64)
    if len(window) < MIN_ROWS:
        return math.nan
    _, place = np.unique(window, return_inverse=True)
    counts = np.bincount(place)
    apart = [
        values - (np.bincount(place, values) / counts)[place]
        for values in (battery.voltage_v[good], battery.current_a[good])
    ]
    volts, amperes = apart
    if float(np.std(amperes)) < SAG_MIN_A:
        return math.nan
    sag = -float(volts @ amperes) / float(amperes @ amperes)
    explained = sag * -float(volts @ amperes) / max(float(volts @ volts), 1e-12)
    return sag if sag > 0.0 and explained >= SAG_EXPLAINED else math.nan


def _ended(evidence: FlightEvidence) -> Named:
    speeds = evidence.of(_touchdowns)
    if speeds and not evidence.of(parts.crashes):
        yield "touchdown_m_s", max(speeds)


def _median(values: Array, fewest: int) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) >= fewest else math.nan
