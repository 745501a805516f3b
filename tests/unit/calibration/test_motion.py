"""Samples and fixes of a simulated flight with a known attitude: IMU and receiver."""

import numpy as np
import pytest

from h2nav.calibration.imu import calibrate_accelerometer, calibrate_gyro, tracks_of
from h2nav.calibration.receiver import calibrate_receiver
from h2nav.maths.units import DEG
from h2nav.recordings.context import Context, GpsTrack, Span
from h2nav.reviews.flight import Estimates
from h2nav.reviews.inertial import rotate
from h2nav.sim.rigid_motion import specific_force
from h2nav.sim.scenarios import scenario
from tests.unit.calibration.logs import evidence_of_log, imu_track

SECONDS, RATE_HZ, FIX_HZ = 180.0, 100.0, 5.0
OFFSET, SCALE_Z = (0.35, -0.28, 0.25), 1.04
DELAY_S, ANTENNA_M = 0.22, (0.5, -0.4, 0.0)
PARAMETERS = {
    **{f"INS_ACCOFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"INS_ACCSCAL_{axis}": 1.0 for axis in "XYZ"},
    **{f"INS_GYROFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"GPS1_POS_{axis}": 0.0 for axis in "XYZ"},
    **{f"INS_POS1_{axis}": 0.0 for axis in "XYZ"},
    "GPS1_DELAY_MS": 100.0,
}


def flown(*, name="aggressive", gyro_deg_s=(0.0, 0.0, 0.0), step_m_s2=0.0, **parameters):
    """An autopilot's own log; the accelerometer's offset may step in the middle of it."""
    rng = np.random.default_rng(1)
    t_s = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    motions = [scenario(name).motion(t) for t in t_s]
    q_nb = np.array([m.q_nb for m in motions])
    w_b, v_n = np.array([m.w_b for m in motions]), np.array([m.v_n for m in motions])
    f_b = np.array([specific_force(m) for m in motions]) * (1.0, 1.0, SCALE_Z) + OFFSET
    f_b += step_m_s2 * (t_s > 0.5 * SECONDS)[:, None] + 0.05 * rng.standard_normal(f_b.shape)
    antenna = v_n + rotate(q_nb, np.cross(w_b, ANTENNA_M))
    fix_s = np.arange(1.0, SECONDS, 1.0 / FIX_HZ)
    fixes = np.stack([np.interp(fix_s - DELAY_S, t_s, axis) for axis in antenna.T], axis=1)
    fixes += 0.03 * rng.standard_normal(fixes.shape)
    zeros = np.zeros(len(fix_s))
    shown = w_b + np.array(gyro_deg_s) * DEG + 1e-3 * rng.standard_normal(w_b.shape)
    context = Context(
        imus=(imu_track(shown, f_b, rate_hz=RATE_HZ),),
        gps=(GpsTrack(0, fix_s, zeros == 0.0, zeros, zeros, zeros, fixes, zeros + 0.1, zeros),),
        armed=(Span(0.0, SECONDS, "armed"),),
    )
    sigma = np.full(len(t_s), 0.2 * DEG)
    free = Estimates(t_s, q_nb, np.zeros(w_b.shape), sigma, sigma)
    own = PARAMETERS | parameters
    return tracks_of([evidence_of_log(context, own, free=free)], 0)


def changes_of(outcome):
    return {change.name: change for change in outcome.changes}


def test_offset_and_scale_of_a_vehicle_that_pulls():
    found = calibrate_accelerometer(flown())
    changes = changes_of(found.outcome)
    true = {"INS_ACCOFFS_X": 0.35, "INS_ACCOFFS_Y": -0.28, "INS_ACCSCAL_Z": 1.0 / SCALE_Z}
    for name, value in true.items():
        assert abs(changes[name].new - value) < 3.0 * changes[name].sigma
    assert not set(changes) & {"INS_ACCSCAL_X", "INS_ACCSCAL_Y"}
    assert found.outcome.shown
    assert found.sigma < 0.1


def test_an_offset_that_stepped_in_flight_is_none():
    outcome = calibrate_accelerometer(flown(step_m_s2=0.8)).outcome
    assert not set(changes_of(outcome)) & {"INS_ACCOFFS_X", "INS_ACCOFFS_Y"}
    assert outcome.left


def test_delay_and_antenna_of_a_receiver():
    outcome = calibrate_receiver(flown(), 0)
    changes = changes_of(outcome)
    assert outcome.shown.startswith("changes of velocity in ")
    assert changes["GPS1_DELAY_MS"].new == pytest.approx(1e3 * DELAY_S, abs=10.0)
    for axis, true in zip("XY", ANTENNA_M, strict=False):
        change = changes[f"GPS1_POS_{axis}"]
        assert abs(change.new - true) < 3.0 * change.sigma + 0.02
    assert "GPS1_POS_Z" not in changes


@pytest.mark.parametrize(
    ("kind", "name", "in_use", "is_set"),
    [
        ("ulog", "EKF2_GPS_DELAY", 110.0, True),
        ("ulog", "EKF2_GPS_DELAY", 200.0, False),
        # 0: ArduPilot takes the usual delay of the kind of receiver.
        ("dataflash", "GPS1_DELAY_MS", 0.0, False),
        ("dataflash", "GPS_DELAY_MS", 120.0, True),
    ],
)
def test_a_delay_is_set_where_it_is_another(kind, name, in_use, is_set):
    tracks = flown()
    ((evidence, track),) = tracks.pairs
    flight = evidence.flight._replace(kind=kind)
    other = evidence._replace(flight=flight, parameters={name: in_use})
    outcome = calibrate_receiver(tracks._replace(pairs=((other, track),)), 0)
    assert (name in changes_of(outcome)) is is_set


def test_telemetry_shows_no_delay():
    tracks = flown()
    ((evidence, track),) = tracks.pairs
    log = evidence._replace(flight=evidence.flight._replace(kind="tlog"))
    outcome = calibrate_receiver(tracks._replace(pairs=((log, track),)), 0)
    assert not outcome.changes
    assert "telemetry" in outcome.left[0]


def test_a_gyro_that_is_not_learnt_anew_gets_its_offset():
    tracks = flown(name="flight", gyro_deg_s=(0.8, -0.6, 0.5), INS_GYR_CAL=0.0)
    changes = changes_of(calibrate_gyro(tracks))
    for axis, true in zip("XYZ", (0.8, -0.6, 0.5), strict=True):
        change = changes[f"INS_GYROFFS_{axis}"]
        assert abs(change.new - true * DEG) < 3.0 * change.sigma


def test_a_gyro_that_is_learnt_at_every_start_is_only_reported():
    tracks = flown(name="flight", gyro_deg_s=(0.8, -0.6, 0.5), INS_GYR_CAL=1.0)
    outcome = calibrate_gyro(tracks)
    assert not outcome.changes
    assert "INS_GYR_CAL" in outcome.left[0]
