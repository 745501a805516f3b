"""Faults are read strictly, act in their time, and do to samples what they say."""

import math

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.errors import BadInput
from h2nav.sim.faults import FAULT_KINDS, Fault, FaultSchedule, parse_fault
from h2nav.sim.sensor_faults import GpsReading, SensorFaults, faulty_gps

SAMPLE = ImuSample(0, (0.1, 0.2, 0.3), (1.0, 2.0, -9.0), (20.0, 1.0, 40.0))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("drop=0.2@10+5", Fault("drop", 0.2, 10.0, 5.0)),
        ("drop@1.5", Fault("drop", 0.1, 1.5)),
        ("reboot@8", Fault("reboot", "", 8.0)),
        ("stuck=accel-z@0", Fault("stuck", "accel-z", 0.0)),
        ("deny=HIGHRES_IMU@0", Fault("deny", "HIGHRES_IMU", 0.0)),
        ("hard-iron=-30@2", Fault("hard-iron", -30.0, 2.0)),
        ("gyro-frozen@2+3.5/3", Fault("gyro-frozen", "", 2.0, 3.5, 3)),
        ("gyro-bias=-4@2/2", Fault("gyro-bias", -4.0, 2.0, imu=2)),
    ],
)
def test_reads(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("drop", "expected NAME"),
        ("drop@", "expected NAME"),
        ("drop@-1", "expected NAME"),
        ("drop@1.2.3", "are seconds"),
        ("gyro-zero@1/4", "IMU 1, 2 or 3"),
        ("gps-lost@1/2", "gps-lost is not of an IMU; leave out /2"),
        ("gyro-zero=1@1", "expected no argument"),
        ("gyro-scale=-1@1", "a number from 0 to 100"),
        ("fire@1", "fire is not known; one of drop"),
        ("drop=2@1", "a number from 0 to 1"),
        ("drop=nan@1", "a number from 0 to 1"),
        ("drop=many@1", "a number from 0 to 1"),
        ("stuck=nose@1", "expected gyro-x, gyro-y"),
        ("reboot=5@1", "expected no argument"),
        ("deny@1", "needs an argument"),
        ("deny=NOSUCH@1", "NOSUCH is no MAVLink message"),
    ],
)
def test_refuses_with_a_reason(text, complaint):
    with pytest.raises(BadInput, match=complaint):
        parse_fault(text)


def test_every_default_argument_is_itself_allowed():
    for name, kind in FAULT_KINDS.items():
        if kind.default not in (None, ""):
            assert parse_fault(f"{name}={kind.default}@0").argument == kind.default


def test_schedule_acts_from_start_to_end():
    schedule = FaultSchedule([parse_fault("drop=0.2@10+5"), parse_fault("drop=0.4@20")])
    assert [schedule.number("drop", t) for t in (9.9, 10.0, 14.9, 15.0, 20.0, 1e9)] == [
        None, 0.2, 0.2, None, 0.4, 0.4,
    ]  # fmt: skip
    assert schedule.acts("drop", 12.0)
    assert not schedule.acts("nan", 12.0)
    assert "drop" in schedule
    assert "nan" not in schedule


def faulty(*texts):
    return SensorFaults(FaultSchedule(parse_fault(text) for text in texts))


def test_no_fault_leaves_the_sample_alone():
    assert faulty().apply(1.0, SAMPLE) is SAMPLE
    assert faulty("nan@5").apply(1.0, SAMPLE) == SAMPLE


CHANGED = {
    "gyro-zero": {"w_b": (0.0, 0.0, 0.0)},
    "gyro-scale=1.5": {"w_b": (0.15, 0.3, 0.45)},
    "gyro-swap": {"w_b": (0.2, 0.1, 0.3)},
    "gyro-deg": {"w_b": tuple(math.degrees(x) for x in SAMPLE.w_b)},
    "gyro-bias=-10": {"w_b": (0.1 - math.radians(10.0), 0.2, 0.3)},
    "accel-fixed": {"f_b": (2.0, 2.0, 2.0)},
    "accel-bias=0.3": {"f_b": (1.3, 2.0, -9.0)},
    "accel-scale=2": {"f_b": (2.0, 4.0, -18.0)},
    "clipping=0.15": {"f_b": (1.0, 0.15 * 9.80665, -0.15 * 9.80665)},
    "zero-accel": {"f_b": (0.0, 0.0, 0.0)},
    "compass-reversed": {"m_b_ut": (-20.0, -1.0, -40.0)},
    "no-mag": {"m_b_ut": (0.0, 0.0, 0.0)},
}


def near(sample):
    return [pytest.approx(field) for field in sample]


@pytest.mark.parametrize("fault", CHANGED)
def test_a_fault_changes_what_it_says_and_nothing_else_from_its_beginning_to_its_end(fault):
    faults = faulty(f"{fault}@2+1")
    wrong = SAMPLE._replace(**CHANGED[fault])
    assert wrong != SAMPLE
    for t_s, expected in ((1.99, SAMPLE), (2.0, wrong), (2.99, wrong), (3.0, SAMPLE)):
        assert list(faults.apply(t_s, SAMPLE)) == near(expected)


@pytest.mark.parametrize(
    ("fault", "sensors"),
    [
        ("imu-frozen", {"w_b", "f_b", "m_b_ut"}),
        ("gyro-frozen", {"w_b"}),
        ("accel-frozen", {"f_b"}),
        ("compass-frozen", {"m_b_ut"}),
    ],
)
def test_a_frozen_sensor_repeats_its_values_and_the_others_go_on(fault, sensors):
    faults = faulty(f"{fault}@1+2")
    samples = {
        t: SAMPLE._replace(w_b=(t, 1.0, 2 * t), f_b=(t, t, 1.0), m_b_ut=(7.0, t, t))
        for t in (0.5, 1.0, 1.5, 2.5, 3.0)
    }
    for t, sample in samples.items():
        begun = samples[1.0] if 1.0 <= t < 3.0 else sample
        held = {name: getattr(begun, name) for name in sensors}
        assert faults.apply(t, sample) == sample._replace(**held)


def test_the_faults_of_an_imu_are_its_own():
    schedule = FaultSchedule(
        parse_fault(text) for text in ("gyro-zero@0/2", "accel-fixed@0", "gps-lost@0", "drop@0")
    )
    assert SensorFaults(schedule.of_imu(1)).apply(0.0, SAMPLE).w_b == SAMPLE.w_b
    assert SensorFaults(schedule.of_imu(2)).apply(0.0, SAMPLE).f_b == SAMPLE.f_b
    assert SensorFaults(schedule.of_imu(2)).apply(0.0, SAMPLE).w_b == (0.0, 0.0, 0.0)
    assert SensorFaults(schedule.of_imu(3)).apply(0.0, SAMPLE) == SAMPLE
    assert "gps-lost" not in schedule.of_imu(1)


@pytest.mark.parametrize(
    ("fault", "t_s", "expected"),
    [
        ("gps-step=-5@10+5", 9.9, (True, 100.0, 3.0)),
        ("gps-step=-5@10+5", 12.0, (True, 90.0, -2.0)),
        ("gps-step=-5@10+5", 15.0, (True, 100.0, 3.0)),
        ("gps-ramp=3@10", 14.0, (True, 124.0, 15.0)),
        ("gps-lost@10", 14.0, (False, 100.0, 3.0)),
    ],
)
def test_what_a_receiver_makes_of_a_fix(fault, t_s, expected):
    reading = GpsReading(True, (100.0, 20.0, -5.0), (3.0, 4.0, 0.5))
    has_fix, p_n, v_n = faulty_gps(FaultSchedule([parse_fault(fault)]), t_s, reading)
    assert (has_fix, p_n[0], v_n[0]) == expected
    assert (p_n[1:], v_n[1:]) == (reading.p_n[1:], reading.v_n[1:])


def test_stuck_axis_repeats_its_value_and_comes_back():
    faults = faulty("stuck=gyro-y@1+2", "stuck=mag-z@1+2")
    values = [
        faults.apply(t, SAMPLE._replace(w_b=(0.0, t, 0.0), m_b_ut=(1.0, 2.0, 10 * t)))
        for t in (0.5, 1.0, 1.5, 2.9, 3.1)
    ]
    assert [sample.w_b[1] for sample in values] == [0.5, 1.0, 1.0, 1.0, 3.1]
    assert [sample.m_b_ut[2] for sample in values] == [5.0, 10.0, 10.0, 10.0, 31.0]


def test_values_that_are_no_measurement():
    sample = faulty("nan=accel-x@0").apply(0.0, SAMPLE)
    assert math.isnan(sample.f_b[0])
    assert sample.f_b[1:] == SAMPLE.f_b[1:]
    assert faulty("zero-accel@0").apply(0.0, SAMPLE).f_b == (0.0, 0.0, 0.0)
    assert faulty("no-mag@0").apply(0.0, SAMPLE).m_b_ut == (0.0, 0.0, 0.0)
    assert faulty("saturate=accel-z@0").apply(0.0, SAMPLE).f_b[2] < -1e6


def test_disturbance_of_the_surroundings():
    faults = faulty("hard-iron=12@1+1", "vibration=9@2")
    assert faults.disturbance(0.0) == ((0.0, 0.0, 0.0), 0.0)
    assert faults.disturbance(1.5) == ((12.0, 0.0, 0.0), 0.0)
    assert faults.disturbance(2.5) == ((0.0, 0.0, 0.0), 9.0)
