"""A check in flight"""

CHANGES = {
    "h2nav/integrity/ratios.py": (
        (
            "        turn_10s: the same.\n    ",
            "        turn_10s: the same.\n        speed: of a velocity to the usual ones.\n    ",
        ),
        (
            "    turn_10s: float = math.nan\n",
            "    turn_10s: float = math.nan\n    speed: float = math.nan\n",
        ),
    ),
    "h2nav/integrity/monitor.py": (
        ("    no_velocity,\n", "    no_velocity,\n    speed_alarm,\n"),
        (
            "        self._lost = LostAttitude()\n        self.ratios",
            "        self._lost, self._of_speed = LostAttitude(), Lasting()\n        self.ratios",
        ),
        (
            "        long = windows[-1]\n",
            """\
        speed_m_s = math.hypot(*fix.v_n[:2])
        speed = speed_m_s / (2.0 * GATE * self._speeds.horizontal_m_s)
        self.ratios = self.ratios._replace(speed=speed)
        long = windows[-1]
""",
        ),
        (
            "                velocity_10s=nothing,\n",
            "                velocity_10s=nothing,\n                speed=nothing,\n",
        ),
        (
            "            self._of_force.take(t_us, self.ratios.force_10s)\n",
            """\
            self._of_force.take(t_us, self.ratios.force_10s)
            self._of_speed.take(t_us, self.ratios.speed)
""",
        ),
        (
            "        if self._of_force.is_raised:\n",
            """\
        if self._of_speed.is_raised and self._fix is not None:
            found.append(speed_alarm(self._fix.v_n, self._of_speed.since_s(t_us)))
        if self._of_force.is_raised:
""",
        ),
    ),
    "h2nav/integrity/contradiction_alarms.py": (
        (
            "def no_velocity(",
            '''\
def speed_alarm(v_n: Vec3, since_s: float) -> Alarm:
    """Of a velocity that the vehicle cannot have.

    Args:
        v_n: the latest one.
        since_s: for how long.
    """
    size, sensor = math.hypot(*v_n[:2]), Sensor(SensorKind.GPS)
    text, evidence = "too fast for this vehicle", f"{size:.0f} m/s over ground"
    return Alarm(
        Kind.GPS_SPEED, sensor, Severity.WARNING, size, "m/s", text, evidence, since_s=since_s
    )


def no_velocity(''',
        ),
    ),
    "h2nav/integrity/kinds.py": (
        (
            '    GPS_SATELLITES = "gps_satellites"\n',
            '    GPS_SATELLITES = "gps_satellites"\n    GPS_SPEED = "gps_speed"\n',
        ),
        (
            "    Kind.GPS_VELOCITY: Meaning(",
            """\
    Kind.GPS_SPEED: Meaning(
        _GPS, _WARNING, "m/s", "The receiver's velocity was beyond the vehicle's.", words.RECEIVER
    ),
    Kind.GPS_VELOCITY: Meaning(""",
        ),
    ),
    "h2nav/reviews/subjects/in_flight.py": (
        (
            "    Declared(\n        Kind.GPS_VELOCITY,\n",
            """\
    Declared(
        Kind.GPS_SPEED,
        MEANINGS[Kind.GPS_SPEED],
        phrase="the GPS velocity was absurd",
        section="gps",
    ),
    Declared(
        Kind.GPS_VELOCITY,
""",
        ),
    ),
    "docs/integrity.md": (
        (
            "| missing velocities |",
            "| a velocity that is too high | three times twice the usual one | reported |\n"
            "| missing velocities |",
        ),
    ),
    "tools/integrity_table.py": (
        (
            '    Case("GPS lost", "gps-lost"),\n',
            """\
    Case("GPS lost", "gps-lost"),
    Case("GPS velocity step 200 m/s", "gps-step=200"),
""",
        ),
    ),
}
WRITTEN = ("docs/schema/review.json", "docs/schema/event.json")

if __name__ == "__main__":
    import contextlib
    from pathlib import Path

    import needs

    needs.REPOSITORY, needs.TOOLS = Path.cwd(), Path("tools").resolve()
    from monitored_flights import flown
    from unit import test_integrity_table as table
    from unit import test_schemas as schemas
    from unit.reviews import test_subjects as subjects
    from velocity_flights import accelerating, turning

    from h2nav.cli import main
    from h2nav.integrity.findings import Kind

    for name, words in schemas.PUBLISHED.items():
        published = Path(f"docs/schema/{name}.json")
        with published.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
            assert main(words) == 0
        assert '"gps_speed"' in published.read_text(encoding="utf-8")

    # Told within seconds of a velocity that is absurd from 10 s on, and never before.
    def leaping(t_s, v_n):
        return (v_n[0] + (200.0 if t_s > 10.0 else 0.0), *v_n[1:])

    told = []
    for t_s, _, _, monitor in flown(accelerating(14.0, 7, law=turning), leaping):
        alarms = {alarm.kind: alarm for alarm in monitor.alarms(round(1e6 * t_s))}
        if Kind.GPS_SPEED in alarms:
            told.append((t_s, alarms[Kind.GPS_SPEED]))
    assert 10.2 < told[0][0] < 11.0
    assert abs(told[0][1].size - 200.0) < 20.0
    assert monitor.ratios.speed > 3.0

    # It is known wherever kinds are.
    subjects.test_every_kind_is_declared_once()
    schemas.test_a_finding_of_any_kind_is_as_the_schema_says(Kind.GPS_SPEED)
    schemas.test_a_finding_in_flight_is_as_the_schema_says(Kind.GPS_SPEED)
    table.test_every_case_is_a_fault_of_a_flight(needs.tool("integrity_table"))
