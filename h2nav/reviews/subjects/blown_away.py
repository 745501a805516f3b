"""A multirotor that leans as far as it may, and is carried off all the same."""

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Context, GpsTrack
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.inertial import Attitudes, Mask, joined, rotate, unbroken, within
from h2nav.reviews.subjects import needs

BLOWN_AWAY = FlightKind("blown_away")
# Parameters with the largest lean, in degrees per unit: ArduPilot's old and new one, PX4's.
LIMITS = {"ANGLE_MAX": 0.01, "ATC_ANGLE_MAX": 1.0, "MPC_TILTMAX_AIR": 1.0}
LIMIT_SHARE = 0.85
# Who brakes from 25 m/s leans against his motion for as long as this, at 20 deg and more.
LASTS_S, MIN_LEAN_RAD = 8.0, 15.0 * DEG
# Gusts let it gain ground in between.
AGAINST_M_S, PAUSES_S = -1.0, 1.5
# Where it went without a fix, or on the ground, is another matter.
UNKNOWN_S = 4.0
# A wrong heading leans into any direction.
KNOWN_RAD = 15.0 * DEG

KINDS = (
    Declared(
        BLOWN_AWAY,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.WARNING,
            "m/s",
            "The vehicle leaned against the wind as far as its limit allows, and was carried off.",
            "The wind at that height, and whether the limit of the lean can be larger.",
        ),
        phrase="carried off by the wind, although it leaned all the way",
        section="attitude",
        follows=(Kind.COMPASS_STEP, Kind.COMPASS_FIELD, Kind.GPS_VELOCITY, Kind.GYRO_BIAS_STEP),
        shown_by="our attitude against the receiver's velocity: a lean at the limit that the "
        "parameters give, against the motion",
        limit="85 % of the limit, 1 m/s backward, for 8 s, with a heading known to 15 deg",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """The longest time for which it was carried off."""
    context, attitude = evidence.of(parts.unharmed), evidence.of(parts.best)
    fixes = evidence.of(parts.receivers)
    if attitude is None or not fixes:
        return []
    gps = fixes[0].part(fixes[0].has_fix & within(fixes[0].t_s, evidence.of(parts.lifted)))
    lean_rad, against_m_s = _leans(gps, attitude)
    is_so = (lean_rad > max(LIMIT_SHARE * _limit_rad(context), MIN_LEAN_RAD)) & (
        against_m_s < AGAINST_M_S
    )
    found = []
    for first, last in joined(unbroken(is_so, gps.t_s, UNKNOWN_S), gps.t_s, PAUSES_S):
        lasted_s = float(gps.t_s[last] - gps.t_s[first])
        if lasted_s < LASTS_S or np.mean(is_so[first : last + 1]) < LIMIT_SHARE:
            continue
        back_m_s = -float(np.median(against_m_s[first : last + 1]))
        lean_deg = float(np.median(lean_rad[first : last + 1])) / DEG
        found.append(
            Finding(
                BLOWN_AWAY,
                Sensor(SensorKind.VEHICLE),
                Severity.WARNING,
                float(gps.t_s[first]),
                float(gps.t_s[last]),
                back_m_s,
                "m/s",
                f"carried off at {back_m_s:.0f} m/s, leaning {lean_deg:.0f} deg against it",
                f"for {lasted_s:.0f} s; by our attitude and the receiver's velocity",
            )
        )
    return sorted(found, key=lambda one: one.from_s - one.to_s)[:1]


def _leans(gps: GpsTrack, attitude: Attitudes) -> tuple[Array, Array]:
    """(N,) lean at each fix, rad, and (N,) speed in the direction to which it pushes, m/s.

    NaN where attitude or heading is unknown.
    """
    up_n = rotate(attitude.at(gps.t_s), np.tile((0.0, 0.0, -1.0), (len(gps.t_s), 1)))
    across = np.linalg.norm(up_n[:, :2], axis=1)
    lean_rad = np.arctan2(across, -up_n[:, 2])
    speed = (up_n[:, :2] * gps.v_n[:, :2]).sum(axis=1) / np.maximum(across, 1e-9)
    is_known: Mask = attitude.near(attitude.sigma_heading_rad, gps.t_s) < KNOWN_RAD
    return lean_rad, np.where(is_known, speed, np.nan)


def _limit_rad(context: Context) -> float:
    """The largest lean; unknown, nothing reaches it."""
    limits = (context.parameters.get(name, 0.0) * unit for name, unit in LIMITS.items())
    return next((limit * DEG for limit in limits if limit > 0.0), np.inf)


SUBJECT = ReviewSubject(
    "the wind",
    KINDS,
    (*needs.ALWAYS, needs.hovers, needs.flight),
    look,
    is_told=False,
)
