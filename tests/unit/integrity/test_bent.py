"""For how long a decision about one sensor counts in those about others."""

from h2nav.integrity.bent import BENT_US, BentAttitude
from h2nav.integrity.causes import Cause


def test_an_attitude_is_bent_for_a_minute_after_a_decision_or_a_correction():
    for learn in (lambda bent: bent.decide(Cause.GYRO, 10), lambda bent: bent.bend(10)):
        bent = BentAttitude()
        assert not bent.is_bent(10)
        learn(bent)
        assert bent.is_bent(9 + BENT_US)
        assert not bent.is_bent(10 + BENT_US)
        assert not bent.is_shaken(11)


def test_a_sensor_that_is_wrong_without_a_decision_excuses_none():
    bent = BentAttitude()
    bent.bend(1_000_000)
    assert not bent.excuses(Cause.GYRO, 2_000_000)


def test_vibration_bends_nothing():
    bent = BentAttitude()
    bent.decide(Cause.VIBRATION, 10)
    assert bent.is_shaken(11)
    assert not bent.is_bent(11)


def test_only_the_other_sensor_is_excused_by_a_window_that_begins_after_the_decision():
    bent = BentAttitude()
    bent.decide(Cause.GYRO, 1_000_000)
    assert bent.excuses(Cause.ACCELEROMETER, 2_000_000)
    assert not bent.excuses(Cause.ACCELEROMETER, 900_000)
    assert not bent.excuses(Cause.ACCELEROMETER, 1_000_000 + BENT_US)
    assert not bent.excuses(Cause.GYRO, 2_000_000)
    assert not bent.excuses(Cause.VELOCITY, 2_000_000)
