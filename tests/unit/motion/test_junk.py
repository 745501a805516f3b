"""Whatever comes in: no exception, nothing but finite numbers out, bounded memory."""

import math
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.motion import odometry_records
from h2nav.motion.samples import (
    InertialSample,
    PoseFrame,
    PoseSample,
    TwistSample,
    WheelSample,
)
from h2nav.motion.settings import OdometrySettings, TwistObserverSettings
from h2nav.motion.twist_observer import TwistObserver
from h2nav.motion.wheel_odometry import WheelOdometry

# One in five values is junk; more would let hardly any estimate come out.
SMALL_STEP = st.integers(1, 2_000_000)
TIME = st.one_of(*[SMALL_STEP] * 4, st.integers(-(2**63), 2**64))
NUMBER = st.one_of(st.floats(-20.0, 20.0), st.floats())
SOUND = st.tuples(*[st.floats(-20.0, 20.0)] * 3)
VECTOR = st.one_of(*[SOUND] * 4, st.tuples(NUMBER, NUMBER, NUMBER))
TURNS = st.sampled_from([(1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.6, 0.0, -0.8, 0.0)])
ROTATION = st.one_of(
    *[TURNS] * 4,
    st.tuples(NUMBER, NUMBER, NUMBER, NUMBER),
)
POSE = st.builds(PoseSample, TIME, ROTATION, VECTOR, st.sampled_from(PoseFrame), st.integers(0, 2))
WAYS = st.one_of(*[SOUND] * 4, st.lists(NUMBER, max_size=4).map(tuple))
junk = settings(derandomize=True, deadline=None, max_examples=150)


def in_order(events):
    """The events with mostly rising times: junk times stay, others become small steps."""
    now_us = 0
    for event in events:
        if 0 <= event.t_us <= 2_000_000:
            now_us += event.t_us % 20_000
            yield event._replace(t_us=now_us)
        else:
            yield event


def numbers(record):
    for value in record:
        if isinstance(value, tuple):
            yield from numbers(value)
        elif isinstance(value, float):
            yield value


def check(estimate, make_record):
    if estimate is not None:
        assert all(map(math.isfinite, numbers(estimate))), estimate
        assert all(map(math.isfinite, numbers(make_record(estimate))))


@junk
@given(
    st.lists(st.one_of(POSE, st.builds(InertialSample, TIME, VECTOR, VECTOR, VECTOR)), min_size=10)
)
@pytest.mark.thorough
def test_observer_with_integrated_velocity(events):
    run_observer(TwistObserver(), events)


@junk
@given(st.lists(st.one_of(POSE, st.builds(TwistSample, TIME, VECTOR, VECTOR)), min_size=10))
@pytest.mark.thorough
def test_observer_with_measured_velocity(events):
    run_observer(TwistObserver(TwistObserverSettings(velocity="measured")), events)


def run_observer(observer, events):
    for event in in_order(events):
        if isinstance(event, PoseSample):
            observer.use_pose(event)
        elif isinstance(event, InertialSample):
            check(observer.use_inertial(event), odometry_records.of_twist)
        else:
            check(observer.use_twist(event), odometry_records.of_twist)


@junk
@given(
    st.lists(st.builds(WheelSample, TIME, WAYS)),
    st.sampled_from(["differential", "omni"]),
)
def test_wheels(samples, layout):
    odometry = WheelOdometry(OdometrySettings(layout=layout))
    for sample in in_order(samples):
        check(odometry.update(sample), odometry_records.of_wheels)


@pytest.mark.parametrize(
    "module", ["twist_observer", "wheel_odometry", "odometry_records", "settings"]
)
def test_the_daemons_modules_do_not_import_numpy(module):
    code = f"import sys, h2nav.motion.{module}; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
