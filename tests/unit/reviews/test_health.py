"""What the autopilot itself says of its sensors."""

import numpy as np
import pytest
from known_evidence import KnownEvidence
from reviewed_flights import DURATION_S, flight

from h2nav.recordings.context import Context, SensorHealth, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.analysis import analyse
from h2nav.reviews.subjects.health import SENSOR_DEAD, look

T_S = np.arange(0.0, DURATION_S, 0.1)


def told(healthy, kind="gyro"):
    health = SensorHealth(kind, 0, T_S, healthy, np.cumsum(1.0 - healthy))
    found = analyse(flight(health=(health,))).findings
    return [one for one in found if one.kind == SENSOR_DEAD]


def test_a_gyro_that_the_autopilot_calls_dead_is_dead_for_that_time():
    (found,) = told(np.where((T_S > 50.0) & (T_S < 69.0), 0.0, 1.0))
    assert (found.from_s, found.to_s) == pytest.approx((50.1, 68.9), abs=0.11)
    assert found.sensor.name == "gyro 1"
    assert "counted 188 errors" in found.evidence


@pytest.mark.parametrize(
    ("lasts_s", "missing_s", "dead_s"),
    [
        (0.5, (0.0, 0.0), ["0.5"]),  # half a second is no 0 s
        (30.0, (55.0, 59.0), ["30"]),
        (30.0, (55.0, 61.0), ["5.0", "19"]),  # nothing is known of the time between two flights
    ],
)
def test_how_long_it_was_dead(lasts_s, missing_s, dead_s):
    t_s = T_S[(missing_s[0] + 0.05 > T_S) | (missing_s[1] + 0.05 < T_S)]
    healthy = np.where((t_s > 49.95) & (t_s < 50.05 + lasts_s), 0.0, 1.0)
    health = (SensorHealth("gyro", 0, t_s, healthy, 0.0 * t_s),)
    armed = (Span(0.0, DURATION_S, ""),)
    found = look(KnownEvidence({parts.recorded: Context(armed=armed, health=health)}))
    assert [one.text.split("dead for ")[1].split(" ")[0] for one in found] == dead_s


@pytest.mark.parametrize("said", [1.0, 0.0, np.nan])
def test_a_sound_sensor_one_that_is_not_fitted_and_an_unknown_one_are_not_accused(said):
    assert not told(np.full(len(T_S), said))


def test_a_hiccup_is_none():
    assert not told(np.where((T_S > 50.0) & (T_S < 50.3), 0.0, 1.0))
