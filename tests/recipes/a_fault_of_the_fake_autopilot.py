"""A fault of the fake autopilot"""

CHANGES = {
    "h2nav/sim/faults.py": (
        (
            '    "gyro-bias": _of_imu(',
            """\
    "made": _of_imu("a made one", 2.0),
    "gyro-bias": _of_imu(""",
        ),
    ),
    "h2nav/sim/sensor_faults.py": (
        (
            '    "gyro-bias": lambda',
            """\
    "made": lambda s, x: s._replace(w_b=_scaled(s.w_b, x)),
    "gyro-bias": lambda""",
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.attitude.samples import ImuSample
    from h2nav.sim.faults import FaultSchedule, parse_fault
    from h2nav.sim.sensor_faults import SensorFaults

    faults = SensorFaults(FaultSchedule([parse_fault("made=3@2+1")]))
    sample = ImuSample(0, (0.1, 0.2, 0.3), (0.0, 0.0, -9.8))
    assert faults.apply(1.9, sample).w_b == sample.w_b
    assert faults.apply(2.5, sample).w_b[1] == 3 * 0.2
