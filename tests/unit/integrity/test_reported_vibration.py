"""VIBRATION of an autopilot: what lasts is told, what a landing does is not."""

from h2nav.integrity.findings import Kind
from h2nav.integrity.reported_vibration import ReportedVibration

HALF_NS = 500_000_000


def reported(levels, counters):
    """Two reports a second; what is said at the end."""
    vibration = ReportedVibration()
    for i, (level, counts) in enumerate(zip(levels, counters, strict=True)):
        vibration.take(i * HALF_NS, level, counts)
    return vibration, (len(levels) - 1) * HALF_NS


def kinds(vibration, t_ns):
    return {alarm.kind: (alarm.sensor.number, alarm.size) for alarm in vibration.alarms(t_ns)}


def test_clips_are_told_of_the_imu_that_has_them():
    counters = [(0, 7, 0), (40, 7, 0), (90, 7, 0), (150, 7, 0)]
    vibration, now_ns = reported([5.0] * 4, counters)
    assert kinds(vibration, now_ns) == {Kind.CLIPPED_SAMPLES: (1, 150.0)}
    assert [vibration.clips(imu, now_ns) for imu in range(4)] == [150, 0, 0, 0]
    assert kinds(vibration, now_ns + 8 * HALF_NS) == {}


def test_a_hard_landing_is_no_clipping():
    vibration, now_ns = reported([5.0] * 6, [(0, 0, 0)] * 3 + [(12, 9, 11)] * 2 + [(14, 9, 11)])
    assert kinds(vibration, now_ns) == {}


def test_a_level_has_to_last():
    still = [(0, 0, 0)] * 4
    vibration, now_ns = reported([5.0, 5.0, 45.0, 5.0], still)
    assert kinds(vibration, now_ns) == {}
    vibration, now_ns = reported([5.0, 5.0, 45.0, 63.0], still)
    assert kinds(vibration, now_ns) == {Kind.VIBRATION: (None, 63.0)}


def test_counters_of_another_boot_are_no_clips():
    counters = [(900, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)]
    vibration, now_ns = reported([5.0] * 4, counters)
    assert kinds(vibration, now_ns) == {}
    vibration.take(now_ns + 100 * HALF_NS, 5.0, (5000, 0, 0))
    assert kinds(vibration, now_ns + 100 * HALF_NS) == {}
