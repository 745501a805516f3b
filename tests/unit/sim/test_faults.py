"""Faults are read strictly, act in their time, and do to samples what they say."""

import math

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.errors import BadInput
from h2nav.sim.faults import FAULT_KINDS, Fault, FaultSchedule, parse_fault
from h2nav.sim.sensor_faults import SensorFaults

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
