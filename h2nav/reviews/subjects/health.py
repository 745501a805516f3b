"""Sensors that the autopilot itself calls dead: it asked, and they did not answer."""

import numpy as np

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.recordings.context import SensorHealth
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.inertial import joined, unbroken, within
from h2nav.reviews.subjects import needs

SENSOR_DEAD = FlightKind("sensor_dead")
SENSORS = {
    "gyro": SensorKind.GYRO,
    "accelerometer": SensorKind.IMU,
    "IMU": SensorKind.IMU,
    "barometer": SensorKind.BAROMETER,
}
# Autopilots call a sensor unhealthy after a tenth of a second or three missed values.
MIN_DEAD_S, APART_S = 0.5, 5.0
IN_TENTHS_S = 10.0  # shorter times are told so

KINDS = (
    Declared(
        SENSOR_DEAD,
        Meaning(
            (SensorKind.GYRO, SensorKind.IMU, SensorKind.BAROMETER),
            Severity.ERROR,
            "s",
            "The autopilot itself got no values from this sensor, and said so.",
            words.SENSOR,
        ),
        phrase=lambda one: one.text,
        section="timing",
        shown_by="the autopilot's own health of each sensor (ArduPilot: GH, AH; PX4: error counts)",
        limit="0.5 s while armed",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """One finding for each sensor and each time that it was dead while armed."""
    context = evidence.of(parts.recorded)
    return [
        one
        for health in context.health
        if health.kind in SENSORS
        for one in _dead(health, evidence)
    ]


def _dead(health: SensorHealth, evidence: FlightEvidence) -> list[Finding]:
    armed = within(health.t_s, evidence.of(parts.recorded).armed)
    dead = (health.healthy == 0.0) & armed
    # One that never answered is not fitted.
    if not (health.healthy == 1.0).any():
        return []
    sensor = Sensor(SENSORS[health.kind], health.number + 1)
    found = []
    for first, last in joined(unbroken(dead, health.t_s, APART_S), health.t_s, APART_S):
        from_s, to_s = float(health.t_s[first]), float(health.t_s[last])
        dead_s = to_s - from_s
        if dead_s < MIN_DEAD_S:
            continue
        errors = health.errors[first : last + 1]
        grown = float(np.nanmax(errors) - np.nanmin(errors)) if np.isfinite(errors).any() else 0.0
        counted = f", and counted {grown:.0f} errors" if grown else ""
        found.append(
            Finding(
                SENSOR_DEAD,
                sensor,
                Severity.ERROR,
                from_s,
                to_s,
                dead_s,
                "s",
                f"{health.kind} {health.number + 1} was dead for "
                f"{dead_s:.{int(dead_s < IN_TENTHS_S)}f} s by the autopilot's own word",
                f"it reported it as not healthy from {from_s:.1f} to {to_s:.1f} s{counted}",
            )
        )
    return found


SUBJECT = ReviewSubject(
    "health of the sensors", KINDS, (needs.times, needs.armed), look, is_told=False
)
