"""When all motors have stopped in the air: just enough of it, and just too little."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins, imu_track

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import Context, Motors, Said, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.falls import falls_from_s
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED, look

G = 9.80665
DEG = np.pi / 180.0
END_S, AT_S = 40.0, 20.0
T_S = np.arange(0.0, END_S, 0.02)
OUTPUTS_S = np.arange(0.0, END_S, 0.1)


def falling(lasts_s=1.0, left_g=0.05, carried_g=1.0, later_s=0.0):
    """A force that vanishes for a while."""
    f_b = np.tile([0.0, 0.0, -carried_g * G], (len(T_S), 1))
    begun_s = AT_S + later_s
    f_b[(begun_s - 0.01 < T_S) & (begun_s + lasts_s - 0.01 > T_S)] = (left_g * G, 0.0, 0.0)
    return imu_track(T_S, f_b=f_b)


def found_in(track, disarmed_s=END_S + 1.0, share=0.5, off_share=None, off_s=2.0, bins=None,
             said=(), numbers=(1, 2, 3, 4), has_flown=True, crashed_s=(), paused=()):  # fmt: skip
    shares = np.full((len(OUTPUTS_S), len(numbers)), share)
    if off_share is not None:
        off = (OUTPUTS_S > AT_S - 0.05) & (AT_S + off_s - 0.05 > OUTPUTS_S)
        shares[off] = off_share
    motors = Motors(numbers, OUTPUTS_S, 1000.0 + 1000.0 * shares, 1000.0, 2000.0)
    return look(
        KnownEvidence(
            {
                parts.soundest_as_recorded: track,
                parts.logged_armed: (Span(1.0, disarmed_s, ""),),
                parts.recorded: Context(motors=motors if numbers else None, said=said),
                parts.bins: flying_bins(END_S) if bins is None else bins,
                parts.flown: has_flown,
                parts.paused: paused,
                parts.crashes: [SimpleNamespace(t_s=t_s) for t_s in crashed_s],
            }
        )
    )


@pytest.mark.parametrize(
    ("how", "is_fall"),
    [
        ({}, True),
        ({"lasts_s": 0.42}, True),
        ({"lasts_s": 0.30}, False),
        ({"left_g": 0.44}, True),
        ({"left_g": 0.46}, False),
        ({"carried_g": 0.62}, True),
        ({"carried_g": 0.58}, False),
        ({"later_s": 0.6}, True),
        ({"later_s": -0.6}, True),
        ({"later_s": 0.9}, False),
        ({"later_s": -0.9}, False),
    ],
)
def test_a_fall_is_a_force_that_vanishes(how, is_fall):
    found = falls_from_s(falling(**how), AT_S)
    assert np.isfinite(found) == is_fall
    if is_fall:
        assert found == pytest.approx(AT_S + how.get("later_s", 0.0), abs=0.11)


def test_few_samples_show_no_fall():
    seldom = falling()
    rows = slice(None, None, 6)
    track = imu_track(seldom.t_s[rows], f_b=seldom.f_b[rows])
    assert np.isnan(falls_from_s(track, AT_S))
    assert np.isfinite(falls_from_s(imu_track(T_S[::4], f_b=seldom.f_b[::4]), AT_S))


def test_where_a_log_pauses_nobody_disarmed_it():
    track = falling(lasts_s=0.5, later_s=-0.6)
    assert found_in(track, disarmed_s=AT_S)
    assert not found_in(track, disarmed_s=AT_S, paused=(Span(AT_S, AT_S + 1.5, ""),))


def test_disarmed_in_the_air():
    said = (
        Said(AT_S + 1.4, Severity.NOTICE, "Disarming motors"),
        Said(AT_S - 1.4, Severity.NOTICE, "by switch"),
        Said(AT_S + 1.6, Severity.NOTICE, "late"),
    )
    (found,) = found_in(falling(), disarmed_s=AT_S, said=said)
    assert (found.kind, found.severity) == (MOTORS_STOPPED, Severity.CRITICAL)
    assert (found.from_s, found.to_s) == pytest.approx((AT_S, AT_S + 0.7))
    assert found.text == "all motors stopped in the air (disarmed)"
    assert found.evidence == (
        "its force vanished then: it fell; the autopilot said 'Disarming motors'; "
        "the autopilot said 'by switch'"
    )
    assert found_in(falling(left_g=1.0), disarmed_s=AT_S) == []
    # a log that ends armed
    assert found_in(falling(), disarmed_s=T_S[-1]) == []


@pytest.mark.parametrize(
    ("off_share", "off_s", "is_told"),
    [(0.03, 2.0, True), (0.05, 2.0, False), (0.03, 0.5, True), (0.03, 0.3, False)],
)
def test_outputs_at_their_least(off_share, off_s, is_told):
    found = found_in(falling(), off_share=off_share, off_s=off_s)
    assert bool(found) == is_told
    if found:
        assert found[0].from_s == pytest.approx(AT_S)
        assert found[0].text.endswith("(all outputs at their least)")
        assert found[0].evidence == "its force vanished then: it fell"


def test_one_motor_that_goes_on_is_no_stop_of_all():
    assert found_in(falling(), off_share=(0.0, 0.0, 0.0, 0.05)) == []
    assert len(found_in(falling(), off_share=(0.0, 0.0, 0.0, np.nan))) == 1


def test_outputs_that_were_always_off_stopped_nothing():
    assert found_in(falling(later_s=-19.5), share=0.0) == []


def test_the_first_stop_is_told():
    (found,) = found_in(falling(), disarmed_s=AT_S + 0.5, off_share=0.0)
    assert found.text.endswith("(all outputs at their least)")


def unpowered(left_g=0.1, lasts=5, turning_deg_s=0.0):
    bins = flying_bins(END_S)
    first = round(AT_S / 0.1)
    bins.f_b[first : first + lasts] = (0.0, 0.0, -left_g * G)
    bins.w_b[first : first + lasts] = (0.0, 0.0, turning_deg_s * DEG)
    return bins


@pytest.mark.parametrize(
    ("how", "share", "is_told"),
    [
        ({}, 0.5, True),
        ({}, 0.46, True),
        ({}, 0.44, False),
        ({"left_g": 0.19}, 0.5, True),
        ({"left_g": 0.21}, 0.5, False),
        ({"lasts": 4}, 0.5, True),
        ({"lasts": 3}, 0.5, False),
        ({"turning_deg_s": 55.0}, 0.5, True),
        ({"turning_deg_s": 65.0}, 0.5, False),
    ],
)
def test_motors_without_power_are_asked_and_give_nothing(how, share, is_told):
    found = found_in(falling(), share=share, bins=unpowered(**how))
    assert bool(found) == is_told
    if found:
        assert found[0].from_s == pytest.approx(AT_S)
        assert "no thrust, although 50% of their range was asked for" in found[0].text


def test_what_has_not_flown_or_has_no_outputs_shows_no_loss_of_power():
    assert found_in(falling(), bins=unpowered(), has_flown=False) == []
    assert found_in(falling(), bins=unpowered(), numbers=()) == []
    assert found_in(imu_track(T_S), bins=unpowered()) == []
    assert look(KnownEvidence({parts.soundest_as_recorded: None})) == []


@pytest.mark.parametrize(
    ("how", "crashed_s", "turning_deg_s", "is_told"),
    [
        ({"lasts_s": 1.4}, AT_S + 1.4, 0.0, True),
        ({"lasts_s": 1.1}, AT_S + 1.1, 0.0, True),
        ({"lasts_s": 0.8}, AT_S + 0.8, 0.0, False),
        # it bounced
        ({"lasts_s": 1.4}, AT_S + 4.2, 0.0, True),
        ({"lasts_s": 1.4}, AT_S + 4.6, 0.0, False),
        # one motor of four is missing
        ({"lasts_s": 1.4, "left_g": 0.24}, AT_S + 1.4, 0.0, True),
        ({"lasts_s": 1.4, "left_g": 0.26}, AT_S + 1.4, 0.0, False),
        ({"lasts_s": 1.4}, AT_S + 1.4, 55.0, True),
        ({"lasts_s": 1.4}, AT_S + 1.4, 65.0, False),
        ({"lasts_s": 1.4, "carried_g": 0.5}, AT_S + 1.4, 0.0, False),
    ],
)
def test_a_fall_to_the_ground_without_outputs(how, crashed_s, turning_deg_s, is_told):
    bins = unpowered(turning_deg_s=turning_deg_s)
    found = found_in(falling(**how), bins=bins, numbers=(), crashed_s=(crashed_s,))
    assert bool(found) == is_told
    if found:
        assert found[0].from_s == pytest.approx(AT_S, abs=0.11)
        assert "(nothing carried it until the blow)" in found[0].text
    # with outputs they would show it
    assert found_in(falling(**how), bins=bins, share=0.3, crashed_s=(crashed_s,)) == []
