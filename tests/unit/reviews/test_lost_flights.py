"""Flights that are lost in a simulation, as logs: the first sentence says what a pilot would say.

Each goes the whole way, from the bytes of a log with the default LOG_BITMASK (25 samples a second).
"""

import functools
import math
import pickle
import re

import numpy as np
import pytest
from lanes import few_rows
from lost_copter import Copter, Flown, Sticks
from lost_flights import log_of

from h2nav.apps.playback import PlaybackOptions
from h2nav.apps.reviewing import review
from h2nav.recordings.opening import open_flight
from h2nav.reviews.chain import chain
from h2nav.reviews.verdict import verdict

# Until then it hovers, 8 or 20 m up.
AT_S = 18.0
LOW_M, HIGH_M = 8.0, 20.0


def hover(copter: Copter, t_s: float, height_m: float) -> None:
    """Arms, climbs and hovers."""
    if 2.0 <= t_s < 3.0 and not copter.armed:
        copter.arm()
    is_climbing = 3.0 <= t_s < 3.0 + height_m / 2.4
    copter.sticks = Sticks(throttle=0.95 if is_climbing else 0.5 if t_s > 3.0 else 0.0)
    if 3.0 + height_m / 2.4 < t_s < AT_S - 3.0:
        copter.sticks = Sticks(0.25 * math.sin(0.9 * t_s), -0.3 * math.sin(0.7 * t_s))


@functools.cache
def hovering(height_m: float, wrong: tuple[tuple[str, float], ...]) -> bytes:
    """A copter that has begun to hover, pickled, since each flight goes on from there.

    Args:
        wrong: its attributes that are otherwise from power-up on.
    """
    copter = Copter()
    vars(copter).update(wrong)
    copter.fly(AT_S, lambda copter, t_s: hover(copter, t_s, height_m))
    return pickle.dumps(copter)


# --- what is done to it -------------------------------------------------------------------------


def disarmed(copter: Copter, t_s: float) -> None:
    """A switch on the transmitter."""
    copter.disarm(2)


def outputs_off(copter: Copter, t_s: float) -> None:
    """A motor interlock, or a landing that was none: armed, without outputs."""
    copter.stopped = True


def supply_off(copter: Copter, t_s: float) -> None:
    """The motors' supply alone: they are asked, and give nothing."""
    copter.effective[:] = 0.0


def throttle_down(copter: Copter, t_s: float) -> None:
    """STABILIZE, nose down, the throttle low: it falls at less than half of its weight."""
    copter.set_mode("STABILIZE")
    copter.sticks = Sticks(pitch=-0.9, throttle=0.18)


def propeller_slips(copter: Copter, t_s: float) -> None:
    """Motor 2 loses its thrust for parts of a second, and comes back: an ESC that loses step."""
    copter.effective[1] = 0.0 if (t_s - AT_S) % 3.0 < 0.5 + 0.12 * (t_s - AT_S) else 1.0


def motor_runs_away(copter: Copter, t_s: float) -> None:
    """Motor 1 gives full thrust, whatever its ESC is told: the one across drives against it."""
    copter.runs_away[0] = True


def storm_rises(copter: Copter, t_s: float) -> None:
    """More wind than 30 deg of lean hold."""
    copter.wind = np.array((min(max(3.0 * (t_s - AT_S), 0.0), 30.0), 0.0, 0.0))


def battery_empties(copter: Copter, t_s: float) -> None:
    """Without a failsafe, until the motors lack thrust."""
    copter.pack_v = max(12.6 - 0.55 * (t_s - AT_S), 6.8)


def into_a_tree(copter: Copter, t_s: float) -> None:
    """The pilot flies forward, and something stands there."""
    copter.sticks = Sticks(pitch=-0.8)
    if copter.obstacle is None:
        ahead = copter.R[:, 0] * np.array((1.0, 1.0, 0.0))
        copter.obstacle = (ahead, float(ahead @ copter.p) + 20.0)


def stick_down(copter: Copter, t_s: float) -> None:
    """ALT_HOLD, throttle stick down, nose down: it does what is asked."""
    copter.set_mode("ALT_HOLD")
    copter.sticks = Sticks(pitch=-1.0, throttle=0.0)


def gyro_off(copter: Copter, t_s: float) -> None:
    """Gyro 1 of two, by 25 deg/s about the roll axis."""
    copter.gyro_offset = np.radians((25.0, 0.0, 0.0))


def barometer_drifts(copter: Copter, t_s: float) -> None:
    """It sinks to the ground while it believes that it climbs."""
    copter.baro_offset_m = min(0.6 * (t_s - AT_S), 16.0)


def compasses_turn(copter: Copter, t_s: float) -> None:
    """Both, by 75 deg: it circles, and meets a wall."""
    copter.compass_turn_rad = math.radians(75.0)
    if copter.obstacle is None:
        east = np.array((0.0, 1.0, 0.0))
        copter.obstacle = (east, float(east @ copter.p) + 12.0)


def thrust_flutters(copter: Copter, t_s: float) -> None:
    """The motors to the right and left in turn, twice a second: it swings, and is not lost."""
    turn = 0.5 * math.sin(math.tau * 2.0 * t_s)
    copter.effective[:2] = 1.0 - turn, 1.0 + turn


def power_fails(copter: Copter, t_s: float) -> None:
    """The whole vehicle's: the log ends."""


def battery_collapses(copter: Copter, t_s: float) -> None:
    """A volt every two seconds, before the autopilot's ten seconds are over: the log ends."""
    copter.pack_v = max(12.6 - 0.5 * (t_s - AT_S), 6.0)


def compasses_wander(copter: Copter, t_s: float) -> None:
    """Both, slowly, up to 63 deg: it circles about its place, ever wider."""
    copter.compass_turn_rad = min(0.1 * (t_s - AT_S), 1.1)
    copter.sticks = Sticks(pitch=-0.3 if t_s < AT_S + 4.0 else 0.0)


def compasses_back_to_front(copter: Copter, t_s: float) -> None:
    """Both, from power-up on: what holds the position drives it away."""


def throttle_too_low(copter: Copter, t_s: float) -> None:
    """STABILIZE: it comes down at more than landing gear is made for, and stays upright."""
    copter.set_mode("STABILIZE")
    if copter.p[2] > -0.5:
        copter.once("down")
    copter.sticks = Sticks(throttle=0.0 if "down" in copter.warned else 0.36)


def fence_is_met(copter: Copter, t_s: float) -> None:
    """It returns by itself."""
    copter.sticks = Sticks(pitch=-0.8 if t_s < AT_S + 5.0 else 0.0)
    if t_s > AT_S + 5.0 and copter.once("fence"):
        copter.error(9, 1)
        copter.say("Max Radius fence breached")
        copter.set_mode("RTL", 10)


# What is so from power-up on.
BEFORE = {
    battery_empties: (("sag_ohm", 0.03),),
    battery_collapses: (("sag_ohm", 0.03),),
    compasses_back_to_front: (("compass_turn_rad", 0.95 * math.pi),),
}


def flown(script, height_m: float, end_s: float) -> Flown:
    """A flight in which a script does its part from `AT_S` on."""

    def fly(copter: Copter, t_s: float) -> None:
        hover(copter, t_s, height_m)
        if t_s > AT_S:
            script(copter, t_s)

    copter = pickle.loads(hovering(height_m, BEFORE.get(script, ())))
    return copter.fly(end_s, fly)


def sentence(tmp_path, script, height_m: float, end_s: float) -> str:
    path = tmp_path / "lost.BIN"
    path.write_bytes(log_of(flown(script, height_m, end_s)))
    found = review(open_flight(path), PlaybackOptions())
    return verdict(*found, chain(*found)).text


STOPPED = r"All motors stopped in the air "
LOST = (
    (disarmed, HIGH_M, 30.0, STOPPED + r"\(disarmed\) at 17 s, then it crashed at [12]\d s"),
    (into_a_tree, LOW_M, 32.0, r"It struck something at 2\d s, .*then it crashed at 2\d s"),
    (
        stick_down,
        LOW_M,
        28.0,
        r"Flown into the ground by the pilot's demand at 2\d s with \d m/s\.",
    ),
    (gyro_off, HIGH_M, 30.0, r"A gyro's bias jumped at 17 s, .*then it crashed"),
    (
        throttle_down,
        HIGH_M,
        28.0,
        r"Flown into the ground by the pilot's demand at [12]\d s with \d+ m/s\.",
    ),
    (power_fails, HIGH_M, AT_S, r"The log ends in the air, [12]\d m above where it began\."),
    (propeller_slips, HIGH_M, 40.0, r"Motor 2 gave no thrust at 17 s, .*then it crashed at"),
    (
        battery_empties,
        HIGH_M,
        40.0,
        r"The battery was low \(\d\.\d V\) at 2\d s, .*then it crashed at",
    ),
    (supply_off, HIGH_M, 28.0, STOPPED + r"\(no thrust, although .*\) at 17 s, then it crashed"),
    (
        outputs_off,
        HIGH_M,
        30.0,
        STOPPED + r"\(all outputs .*\) at 17 s, then it crashed at [12]\d s",
    ),
    (compasses_turn, LOW_M, 50.0, r"Compasses 1 and 2 changed together at 17 s, .*then it crashed"),
    (
        barometer_drifts,
        LOW_M,
        62.0,
        r"No crash\. The barometer drifted by \+1\d m from [12]\d s on",
    ),
    (
        motor_runs_away,
        HIGH_M,
        30.0,
        r"Motor 1 gave more thrust than it was asked for\. The log ends in",
    ),
    (storm_rises, HIGH_M, 50.0, r"Carried off by the wind, although it leaned all the way\."),
    (
        battery_collapses,
        HIGH_M,
        30.0,
        r"The battery was low \(\d\.\d V\), then thrust was lacking\. The",
    ),
    (compasses_wander, HIGH_M, 50.0, r"(No crash\. )?The autopilot's heading was wrong\."),
    (
        compasses_back_to_front,
        LOW_M,
        34.0,
        r"The autopilot's heading was wrong at \d s, then it crashed",
    ),
    (throttle_too_low, LOW_M, 28.0, r"No crash\. It landed hard: at [45]\.\d m/s, .* at 20 s\."),
    (fence_is_met, LOW_M, 40.0, r"(No crash\. )?The autopilot said: fence breached\."),
    (thrust_flutters, HIGH_M, 30.0, r"Roll oscillated at 2\.0 Hz by \d+ deg/s\."),
)


@pytest.mark.parametrize(("script", "height_m", "end_s", "says"), few_rows(3, LOST))
def test_the_first_sentence_says_what_began_it(tmp_path, script, height_m, end_s, says):
    said = sentence(tmp_path, script, height_m, end_s)
    assert re.match(says, said), said
