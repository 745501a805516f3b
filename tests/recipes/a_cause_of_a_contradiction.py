"""A cause of a contradiction with velocity"""

CHANGES = {
    "h2nav/integrity/causes.py": (
        ('    LATENCY = "latency"\n', '    LATENCY = "latency"\n    SPEED_SCALE = "speed scale"\n'),
        (
            "FAILED_LAG_S = 0.5\n",
            "FAILED_LAG_S = 0.5\nFAILED_SPEED_SHARE = 0.5\nMIXED_UNITS = 1e-3\n",
        ),
        (
            "        if self._shaken > SHAKING_DENSITY:\n            odds[",
            """\
        odds[Cause.SPEED_SCALE] += math.log(MIXED_UNITS)  # how seldom a unit is wrong
        if self._shaken > SHAKING_DENSITY:
            odds[""",
        ),
        (
            "[*(g[0] for g in gained), *(g[1] for g in gained)], *self._ramps(count)]\n",
            """\
[*(g[0] for g in gained), *(g[1] for g in gained)], *self._ramps(count)]
        shapes.append([row.ended.v_n[i] - row.begun.v_n[i] for i in (0, 1) for row in self._rows])
""",
        ),
        (
            "            _Variant(Cause.HEADING, since.fit(",
            """\
            _Variant(Cause.SPEED_SCALE, since.fit(none, (3,), FAILED_SPEED_SHARE), 1),
            _Variant(Cause.HEADING, since.fit(""",
        ),
    ),
    "h2nav/integrity/cause_alarms.py": (
        (
            "    elif decided is Cause.VELOCITY:\n",
            """\
    elif decided is Cause.SPEED_SCALE:
        text, kind = f"GPS velocity is off by {found.step:.0%}", Kind.GPS_VELOCITY
        about, size, unit = Sensor(SensorKind.GPS), found.odds, ""
    elif decided is Cause.VELOCITY:
""",
        ),
    ),
    "docs/integrity.md": (
        (
            "**Slow drifts.** ",
            "A receiver whose velocities are off by a share has the signature of their changes.\n\n"
            "**Slow drifts.** ",
        ),
    ),
    "tests/unit/integrity/test_causes.py": (
        (
            '@pytest.mark.parametrize("heading_deg", [-40.0, 15.0, 30.0])\n',
            """\
def test_a_velocity_of_another_scale_is_named():
    found = signature(v_at=lambda t_s, v_n: tuple(1.5 * v for v in v_n[round(100.0 * t_s)]))
    assert found.decided is Cause.SPEED_SCALE
    # What is measured is 1.5 of what is true: a third of it is too much.
    assert found.step == pytest.approx(0.5 / 1.5, abs=0.03)


@pytest.mark.parametrize("heading_deg", [-40.0, 15.0, 30.0])
""",
        ),
    ),
}

if __name__ == "__main__":
    from unit.integrity import test_causes as signatures

    from h2nav.integrity.cause_alarms import cause_alarm
    from h2nav.integrity.causes import Cause
    from h2nav.integrity.findings import Kind, Sensor, SensorKind

    signatures.test_a_velocity_of_another_scale_is_named()
    # The signatures of other causes are theirs as before.
    signatures.test_a_sound_flight_has_no_cause(1)
    signatures.test_a_wrong_heading_turns_the_acceleration(30.0)
    signatures.test_a_drift_opens_the_tilt_by_what_it_would_bend()

    found = signatures.signature(v_at=lambda t_s, v_n: [1.5 * v for v in v_n[round(100.0 * t_s)]])
    alarm = cause_alarm(found, found.decided, Sensor(SensorKind.IMU, 1), 2.0)
    assert (alarm.kind, alarm.sensor.kind) == (Kind.GPS_VELOCITY, SensorKind.GPS)
    assert alarm.text == f"GPS velocity is off by {found.step:.0%}"
    assert Cause.SPEED_SCALE.value in alarm.evidence
