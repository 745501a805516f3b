"""An attitude that was told before is brought to the present with our own motion."""

import pytest

from h2nav.live import track as live_track
from h2nav.live.track import LiveTrack
from h2nav.maths.quaternion import angle, conjugate, exp, from_euler, multiply
from h2nav.maths.units import DEG

STEP_NS = 100_000_000
RATE_RAD_S = 90.0 * DEG


def ours(t_ns):
    """A roll of 90 deg/s, nose to the north-east and up."""
    return multiply(from_euler(0.0, 0.3, 0.8), exp((RATE_RAD_S * t_ns * 1e-9, 0.0, 0.0)))


@pytest.fixture
def track():
    made = LiveTrack()
    for number in range(11):
        made.add(number * STEP_NS, ours(number * STEP_NS))
    return made


@pytest.mark.parametrize("t_ns", [0, 730_000_000, 1_000_000_000])
def test_it_turns_as_we_have_turned(track, t_ns):
    apart = from_euler(0.02, -0.03, 0.1)  # in NED
    carried = track.carried(t_ns, multiply(apart, ours(t_ns)))
    assert angle(carried, multiply(apart, ours(10 * STEP_NS))) < 0.1 * DEG


def test_the_sign_of_a_quaternion_does_not_matter(track):
    w, x, y, z = ours(11 * STEP_NS)
    track.add(11 * STEP_NS, (-w, -x, -y, -z))
    then = ours(1_050_000_000)
    assert angle(track.carried(1_050_000_000, then), ours(11 * STEP_NS)) < 0.1 * DEG


def test_what_we_do_not_know_is_not_made_up(track):
    told = from_euler(0.1, 0.2, 0.3)
    assert LiveTrack().carried(0, told) is None
    assert track.carried(-1, told) is None  # before all that is remembered
    track.add(10 * STEP_NS + live_track.LONGEST_GAP_NS + 1, ours(0))
    assert track.carried(10 * STEP_NS + 1, told) is None  # in a gap


def test_after_our_newest_it_stands_still(track):
    told = from_euler(0.1, 0.2, 0.3)
    assert angle(track.carried(10 * STEP_NS + 1, told), told) < 1e-6


def test_it_forgets(track):
    newest_ns = 10 * STEP_NS
    for _ in range(10 * live_track.MAX_TRACK_POINTS):
        newest_ns += 1000
        track.add(newest_ns, ours(newest_ns))
    kept_ns = live_track.MAX_TRACK_POINTS * 1000
    assert track.carried(newest_ns - kept_ns, conjugate(ours(0))) is None
    track.add(newest_ns + live_track.LENGTH_NS + 1, ours(0))
    assert track.carried(newest_ns, ours(newest_ns)) is None


def test_attitudes_of_the_last_two_seconds_are_remembered():
    track, level = LiveTrack(), from_euler(0.0, 0.0, 0.0)
    track.add(0, level)
    for t_ns in range(STEP_NS, 2_000_000_001, STEP_NS):
        track.add(t_ns, level)
    assert track.carried(0, level) is not None
    track.add(2_000_000_001, level)
    assert track.carried(0, level) is None
    assert track.carried(STEP_NS, level) is not None


@pytest.mark.parametrize(("gap_ns", "is_known"), [(300_000_000, True), (300_000_001, False)])
def test_a_gap_of_three_tenths_of_a_second_is_bridged(gap_ns, is_known):
    track, level = LiveTrack(), from_euler(0.0, 0.0, 0.0)
    track.add(0, level)
    track.add(gap_ns, level)
    assert (track.carried(1, level) is not None) is is_known
