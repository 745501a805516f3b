"""What is measured of a flight for its airframe: made evidence, and when a figure is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins, receiver_track

from h2nav.airframes.features import airframe_id
from h2nav.recordings.context import Battery, Context, Esc, Series, Span, TemperatureTrack
from h2nav.reviews import evidence as parts
from h2nav.reviews.impacts import Impact
from h2nav.reviews.subjects import features as module
from h2nav.reviews.subjects.features import (
    distance_m,
    features,
    flight_row,
    flown_s,
    flying,
    landings,
    resistance_ohm,
)

G = 9.80665
DEG = math.pi / 180.0
END_S = 60.0
T_S = np.arange(0.0, END_S, 0.1)
SLOW_S = np.arange(0.0, END_S, 0.5)
QUAD = 2  # MAV_TYPE_QUADROTOR
LACKING = SimpleNamespace(SUBJECT=SimpleNamespace(lacks=lambda _evidence: "it is not there"))


def crash(t_s):
    return Impact(t_s, t_s + 1.0, 9.0, 9.0, 1.0, 0.0, t_s, is_crash=True)


def bins(tilt_deg=0.0, driven=0.5):
    made = flying_bins(END_S, driven)
    made.f_b[:] = (G * math.sin(tilt_deg * DEG), 0.0, -G * math.cos(tilt_deg * DEG))
    return made


def evidence(flies=(0.0, END_S), context=None, own_bins=None, crashes=(), receivers=(),
             biases=(), spectra=(), touchdowns=(), has_times=True, paused=()):  # fmt: skip
    """Of a flight in some span."""
    made = bins() if own_bins is None else own_bins
    mask = (made.t_s >= flies[0]) & (made.t_s < flies[1])
    context = context or Context(armed=(Span(0.0, END_S, ""),), duration_s=END_S)
    known = {
        parts.bins: made,
        parts.recorded: context,
        parts.in_order: context,
        parts.crashes: [crash(t_s) for t_s in crashes],
        parts.receivers: receivers,
        parts.biases: (biases, ()),
        parts.has_times: has_times,
        parts.paused: paused,
        module.vibration.spectra: (spectra, ()),
        module._touchdowns: list(touchdowns),
        flying: mask,
    }
    return KnownEvidence(known)


@pytest.fixture(autouse=True)
def only_what_is_made(monkeypatch):
    """Compasses and receivers have evidence of their own."""
    monkeypatch.setattr(module, "compass", LACKING)
    monkeypatch.setattr(module, "receiver", LACKING)


def figures(**how):
    return dict(features(evidence(**how)))


# --- in the air -----------------------------------------------------------------------------------


def test_it_flies_until_it_crashes_and_not_where_there_are_no_times():
    assert flying(evidence()).all()
    mask = flying(evidence(crashes=(30.0,)))
    assert mask[:290].all()
    assert not mask[291:310].any()
    assert not flying(evidence(has_times=False)).any()
    nothing = KnownEvidence({parts.bins: None, parts.has_times: True})
    assert len(flying(nothing)) == 0


@pytest.mark.parametrize(("lasts_s", "counted_s"), [(1.9, 0.0), (2.0, 2.0), (35.0, 35.0)])
def test_less_than_two_seconds_are_no_flight(lasts_s, counted_s):
    assert flown_s(evidence(flies=(10.0, 10.0 + lasts_s))) == pytest.approx(counted_s)


def moving(speed_m_s, t_s=SLOW_S, has_fix=True):
    return receiver_track(t_s, (0.6 * speed_m_s, -0.8 * speed_m_s, 3.0), has_fix)


@pytest.mark.parametrize(
    ("receivers", "way_m"),
    [
        ((), 0.0),
        ((moving(5.0),), 100.0),
        ((moving(0.6),), 12.0),
        ((moving(0.4),), 0.0),
        ((moving(5.0, has_fix=False),), 0.0),
        ((moving(3.0, has_fix=False), moving(5.0)), 100.0),
        ((moving(3.0), moving(5.0)), 60.0),
        ((moving(math.nan),), 0.0),
        # a step of at most five seconds counts for each fix
        ((moving(5.0, np.array([0.0, 10.0, 24.9, 50.0])),), 25.0),
    ],
)
def test_the_way_over_ground(receivers, way_m):
    found = distance_m(evidence(flies=(19.9, 39.8), receivers=receivers))
    assert found == pytest.approx(way_m)


@pytest.mark.parametrize(("driven", "count"), [(0.5, 1), (0.1, 2)])
def test_a_pause_of_the_log_in_the_air_is_no_landing(driven, count):
    own_bins = bins()
    own_bins.driven[(own_bins.t_s > 25.0) & (own_bins.t_s < 35.0)] = driven
    context = Context(armed=(Span(5.0, 30.0, ""), Span(31.2, 50.0, "")), duration_s=END_S)
    paused = (Span(30.0, 31.2, ""),)
    assert landings(evidence(context=context, own_bins=own_bins, paused=paused)) == count


@pytest.mark.parametrize(
    ("armed", "crashes", "touchdowns", "count"),
    [
        (((5.0, 50.0),), (), (), 1),
        (((5.0, 30.0), (35.0, 50.0)), (), (), 2),
        (((5.0, 30.0), (35.0, END_S)), (), (), 1),  # it ends armed
        (((5.0, 30.0), (35.0, 50.0)), (29.0,), (), 1),
        (((5.0, 50.0),), (), (1.0, 1.5), 2),
        (((0.0, 1.0),), (), (), 0),  # on the ground
    ],
)
def test_how_often_it_came_down(armed, crashes, touchdowns, count):
    context = Context(armed=tuple(Span(*one, "") for one in armed), duration_s=END_S)
    how = {"context": context, "crashes": crashes, "touchdowns": touchdowns}
    assert landings(evidence(flies=(2.0, 55.0), **how)) == count
    assert landings(KnownEvidence({parts.bins: None, flying: np.zeros(0, bool)})) == 0


# --- the figures ----------------------------------------------------------------------------------


def test_what_is_not_known_is_absent():
    assert figures() == {}


@pytest.mark.parametrize(("count", "is_known"), [(19, False), (20, True)])
def test_vibration_and_temperature_in_the_air(count, is_known):
    t_s = np.linspace(20.1, 39.5, count)
    level = np.tile([3.0, 4.0, 12.0], (count, 1))
    on_ground = np.full((9, 3), 100.0)
    all_s = np.concatenate((np.linspace(0.0, 9.0, 9), t_s))
    shaken = SimpleNamespace(imu=1, t_s=all_s, level=np.concatenate((on_ground, level)))
    warm = TemperatureTrack(0, all_s, np.where(all_s > 10.0, 41.0, 7.0))
    context = Context(vibrations=(shaken,), temperatures=(warm,))
    found = figures(flies=(20.0, 40.0), context=context)
    expected = {"imu_1_temperature_degc": 41.0, "imu_2_vibration_m_s2": 13.0}
    assert found == (pytest.approx(expected) if is_known else {})


def spectrum(imu, sensor, is_burst, *peaks):
    made = [SimpleNamespace(harmonic=h, frequency_hz=hz, rms=rms) for h, hz, rms in peaks]
    return SimpleNamespace(imu=imu, sensor=sensor, is_burst=is_burst, peaks=made)


def test_the_way_of_an_unbalanced_mass_is_the_same_at_every_speed():
    for hz in (50.0, 100.0):
        rms = 4e-6 * (2.0 * math.pi * hz) ** 2
        found = figures(
            spectra=(
                spectrum(0, "gyro", True, (1, 9.0, 9.0)),
                spectrum(1, "accelerometer", False, (1, 9.0, 9.0)),
                spectrum(2, "accelerometer", True, (2, 2.0 * hz, 9.0), (1, hz, rms)),
                spectrum(3, "accelerometer", True, (2, 2.0 * hz, 9.0)),
            )
        )
        assert found == pytest.approx({"imu_3_displacement_um": 4.0, "rotation_hz": hz})
    rpm = [np.full(len(SLOW_S), each) for each in (6000.0, 6600.0, 0.0, math.nan)]
    nothing = np.zeros(len(SLOW_S))
    escs = tuple(Esc(n, SLOW_S, each, nothing, nothing) for n, each in enumerate(rpm, 1))
    peaks = spectrum(2, "accelerometer", True, (1, 50.0, 1.0))
    found = figures(context=Context(escs=escs), spectra=(peaks,))
    assert found["rotation_hz"] == pytest.approx(105.0)
    assert found["imu_3_displacement_um"] > 0.0


def hover(tilt_deg=0.0, climb_m_s=0.0, speed_m_s=0.0, lasts_s=30.0, vehicle_type=QUAD, fixes=True):
    throttle = np.where(T_S < 10.0, 0.2, 0.4)
    context = Context(
        throttle=Series(T_S, throttle),
        climb_m_s=Series(T_S, 0.0 * T_S + climb_m_s),
        vehicle_type=vehicle_type,
    )
    receivers = (moving(speed_m_s),) if fixes else (moving(1.0, SLOW_S[:0]),)
    return figures(
        flies=(20.0, 20.0 + lasts_s),
        context=context,
        own_bins=bins(tilt_deg),
        receivers=receivers,
    ).get("hover_throttle")


@pytest.mark.parametrize(
    ("how", "is_known"),
    [
        ({}, True),
        ({"tilt_deg": 11.9}, True),
        ({"tilt_deg": 12.1}, False),
        ({"climb_m_s": -0.49}, True),
        ({"climb_m_s": 0.51}, False),
        ({"speed_m_s": 1.9}, True),
        ({"speed_m_s": 2.1}, False),
        ({"speed_m_s": math.nan}, False),
        ({"lasts_s": 10.0}, True),
        ({"lasts_s": 9.9}, False),
        ({"vehicle_type": 1}, False),
        ({"fixes": False}, False),
    ],
)
def test_the_throttle_of_a_hover(how, is_known):
    assert hover(**how) == (pytest.approx(0.4) if is_known else None)


def test_zeros_of_gyros_and_the_force_at_rest():
    gyro_b = np.tile(np.array([0.1, -0.2, 0.3]) * DEG, (3, 1))
    bias = SimpleNamespace(imu=0, gyro_b=gyro_b, force_norm=np.full(3, G + 0.05))
    found = figures(biases=(bias,))
    assert found == pytest.approx(
        {
            "imu_1_force_at_rest_m_s2": 0.05,
            "imu_1_gyro_bias_x_deg_s": 0.1,
            "imu_1_gyro_bias_y_deg_s": -0.2,
            "imu_1_gyro_bias_z_deg_s": 0.3,
        }
    )
    few = SimpleNamespace(imu=0, gyro_b=gyro_b[:2], force_norm=np.full(2, G))
    assert figures(biases=(few,)) == {}
    assert figures(biases=(bias,), has_times=False) == {}


def test_motors_beyond_the_others(monkeypatch):
    monkeypatch.setattr(module, "outputs_beyond_others", lambda *_: {1: -30.0, 2: 12.0, 4: 20.0})
    assert figures() == {
        "motor_1_us": -30.0,
        "motor_2_us": 12.0,
        "motor_4_us": 20.0,
        "motor_spread_us": 50.0,
    }


def test_the_fastest_touchdown_of_a_flight_that_did_not_crash():
    assert figures(touchdowns=(1.0, 1.5, 0.5)) == {"touchdown_m_s": 1.5}
    assert figures(touchdowns=(1.0,), crashes=(50.0,)) == {}


def test_the_link_is_a_share():
    assert figures(context=Context(link_loss_share=0.25)) == {"link_loss_share": 0.25}


def battery(ohm=0.05, swing_a=3.0, noise_v=0.0, drain_v=0.0, count=600, current_a=20.0):
    t_s = np.arange(count) * 0.1
    swing = swing_a * np.sign(np.sin(t_s))
    noise = noise_v * np.sign(np.sin(7.3 * t_s))
    # each window of 20 s has another charge
    open_v = 12.0 - drain_v * np.floor(t_s / 20.0)
    current = current_a + swing
    return Battery(0, t_s, open_v - ohm * current + noise, current, 0.0 * t_s)


ARMED = Context(armed=(Span(0.0, END_S, ""),))


@pytest.mark.parametrize(
    ("made", "is_known"),
    [
        (battery(), True),
        (battery(drain_v=0.4), True),
        (battery(swing_a=1.1), True),
        (battery(swing_a=0.9), False),
        (battery(noise_v=0.12), True),
        (battery(noise_v=0.18), False),
        (battery(ohm=-0.05), False),
        (battery(count=20), True),
        (battery(count=19), False),
        (battery()._replace(voltage_v=np.full(600, 0.9)), False),
    ],
)
def test_the_resistance_of_a_battery(made, is_known):
    if len(made.t_s) <= 20:  # a swing within two seconds
        swing = np.where(np.arange(len(made.t_s)) % 2, 3.0, -3.0)
        made = made._replace(current_a=20.0 + swing, voltage_v=12.0 - 0.05 * swing)
    found = resistance_ohm(made, ARMED)
    assert found == pytest.approx(0.05 if is_known else math.nan, rel=0.06, nan_ok=True)


def test_it_is_measured_while_armed():
    sound, other = battery(), battery(0.2)
    later = np.arange(600) >= 400
    both = sound._replace(voltage_v=np.where(later, other.voltage_v, sound.voltage_v))
    armed = Context(armed=(Span(0.0, 39.9, ""),))
    assert resistance_ohm(both, armed) == pytest.approx(0.05)
    assert figures(context=armed._replace(batteries=(both, other))) == pytest.approx(
        {"battery_resistance_ohm": 0.05}
    )


def test_the_noise_of_a_receiver_is_found_in_differences_of_two_velocities(monkeypatch):
    noise = np.random.default_rng(4).normal(0.0, 0.2, (8001, 3))
    shown = SimpleNamespace(receiver=1, difference_n=np.diff(noise, axis=0), lag_s=0.15)
    few = SimpleNamespace(receiver=2, difference_n=np.diff(noise[:20], axis=0), lag_s=0.1)
    of_receivers = SimpleNamespace(
        SUBJECT=SimpleNamespace(lacks=lambda _evidence: ""), receivers="receivers"
    )
    monkeypatch.setattr(module, "receiver", of_receivers)
    made = evidence()
    made._parts["receivers"] = ((shown, ()), (few, ()))
    found = dict(features(made))
    assert found.pop("gps_2_velocity_noise_m_s") == pytest.approx(0.2, rel=0.03)
    assert found == {"gps_2_delay_s": 0.15, "gps_3_delay_s": 0.1}


@pytest.mark.parametrize(("start", "begun"), [(None, math.nan), (1.8e9, 1.8e9)])
@pytest.mark.parametrize(("board", "of"), [("CubeOrange", "CubeOrange"), ("", "quadrotor")])
def test_what_is_remembered_of_a_flight(start, begun, board, of):
    context = Context(
        uid="", system_id=7, board=board, vehicle="quadrotor", start_unix_s=start, duration_s=END_S
    )
    made = evidence()
    made.flight = SimpleNamespace(name="flight 3", context=context)
    blow = crash(9.0)
    made._parts |= {
        parts.blows: [blow, blow._replace(is_crash=False)],
        features: {"link_loss_share": 0.5},
        flown_s: 44.0,
        distance_m: 300.0,
        landings: 2,
    }
    row = flight_row(made)
    assert tuple(row[:1]) == ("flight 3",)
    assert row[1] == airframe_id("", 7, of)
    assert row[2] == pytest.approx(begun, nan_ok=True)
    assert tuple(row[3:]) == ({"link_loss_share": 0.5}, 44.0, 300.0, 2, 1)
