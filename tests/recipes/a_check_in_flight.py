"""A check in flight"""

CHANGES = {
    "h2nav/integrity/kernel/memory.py": (
        (
            "STUCK_AXIS = 32\n",
            "SPINS = 32  # the gyro shows what no vehicle does\nSTUCK_AXIS = 64\n",
        ),
        (
            '    field_frozen: float = real("",',
            """\
    spins_us: float = real("us", "for how long no vehicle turns as the gyro shows")
    field_frozen: float = real("",""",
        ),
    ),
    "h2nav/integrity/kernel/checks.py": (
        ("import FIELD_FROZEN, TURN_ROW, Gains,", "import FIELD_FROZEN, SPINS, TURN_ROW, Gains,"),
        (
            "LONGEST_STEP_US = 300e3\n",
            "LONGEST_STEP_US = 300e3\nSPINNING_RAD_S = 30.0\nSPINS_US = 200e3\n",
        ),
        (
            "    bits = standstill(s, sample)\n",
            """\
    bits = standstill(s, sample)
    s.spins_us = s.spins_us + s.step_us
    if length(sample.gyro) < SPINNING_RAD_S:
        s.spins_us = 0.0
    if s.spins_us > SPINS_US:
        bits = bits | SPINS
""",
        ),
    ),
    "h2nav/integrity/sensor_checks.py": (
        ("    GYRO_FROZEN,\n    STUCK_AXIS,\n", "    GYRO_FROZEN,\n    SPINS,\n    STUCK_AXIS,\n"),
        ("    return Use.DOUBTED if stuck", "    return Use.DOUBTED if stuck or bits & SPINS"),
        (
            "    if bits & FIELD_FROZEN:\n",
            """\
    if bits & SPINS:
        text, evidence = "gyro spins", "more than 30 rad/s, as no vehicle turns"
        spins_s = 1e-6 * memory.spins_us
        found.append(_standstill(imu, Kind.GYRO_SPINS, text, evidence, spins_s))
    if bits & FIELD_FROZEN:
""",
        ),
    ),
    "h2nav/integrity/kinds.py": (
        (
            '    GYRO_SCALE = "gyro_scale"\n',
            '    GYRO_SCALE = "gyro_scale"\n    GYRO_SPINS = "gyro_spins"\n',
        ),
        (
            "    Kind.IMU_FROZEN: Meaning(",
            """\
    Kind.GYRO_SPINS: Meaning(
        _IMU, _ERROR, "s", "The gyro showed turns that no vehicle makes.", words.SENSOR
    ),
    Kind.IMU_FROZEN: Meaning(""",
        ),
    ),
    "h2nav/reviews/subjects/in_flight.py": (
        (
            "    Declared(\n        Kind.IMU_FROZEN,\n",
            """\
    Declared(
        Kind.GYRO_SPINS,
        MEANINGS[Kind.GYRO_SPINS],
        phrase="a gyro showed absurd turns",
        section="timing",
    ),
    Declared(
        Kind.IMU_FROZEN,
""",
        ),
    ),
    "docs/integrity.md": (
        (
            "| clipping, vibration |",
            "| a gyro that spins | more than 30 rad/s for 0.2 s | `degraded` |\n"
            "| clipping, vibration |",
        ),
    ),
    "tools/integrity_table.py": (
        (
            '    Case("gyro in deg/s", "gyro-deg"),\n',
            '    Case("gyro in deg/s", "gyro-deg"),\n    Case("gyro spins", "gyro-bias=2000"),\n',
        ),
    ),
}
WRITTEN = ("docs/memory.md", "docs/schema/review.json", "docs/schema/event.json")

if __name__ == "__main__":
    import contextlib
    import subprocess
    import sys
    from pathlib import Path

    import needs

    needs.REPOSITORY, needs.TOOLS = Path.cwd(), Path("tools").resolve()
    from synthetic_imu import fly, slow
    from unit import test_integrity_table as table
    from unit import test_schemas as schemas
    from unit.reviews import test_subjects as subjects

    from h2nav.attitude.kernel_files import SENSOR_CHECKS
    from h2nav.cli import main
    from h2nav.integrity.findings import Kind, Sensor, SensorKind
    from h2nav.integrity.monitor import Monitor, Speeds
    from h2nav.integrity.sensor_checks import Use
    from h2nav.translate.c99 import translate
    from h2nav.translate.source import KernelSource

    # What is made of the declarations.
    subprocess.run([sys.executable, "tools/memory_tables.py"], check=True)
    assert "no vehicle turns as the gyro shows" in Path("docs/memory.md").read_text("utf-8")
    for name, words in schemas.PUBLISHED.items():
        published = Path(f"docs/schema/{name}.json")
        with published.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
            assert main(words) == 0
        assert '"gyro_spins"' in published.read_text(encoding="utf-8")

    # The sample that is wrong for long enough is doubted, and the next sound one is not.
    monitor, imu = Monitor(Sensor(SensorKind.IMU, 1), Speeds(9.0)), Sensor(SensorKind.IMU, 1)
    samples = fly(slow, 3.0, 1).samples
    uses, told = [], []
    for sample in samples:
        rates = [w + (35.0 if 1e6 < sample.t_us < 2e6 else 0.0) for w in sample.w_b]
        uses.append(monitor.check(sample._replace(w_b=tuple(rates))))
        told += [(sample.t_us, alarm) for alarm in monitor.alarms(sample.t_us)]
    spinning = [(t_us, alarm) for t_us, alarm in told if alarm.kind is Kind.GYRO_SPINS]
    assert {alarm.sensor for _, alarm in spinning} == {imu}
    assert 1.2e6 <= spinning[0][0] <= 1.25e6
    assert spinning[-1][0] < 2e6
    assert uses.count(Use.DOUBTED) == len(spinning)
    assert uses[-1] is Use.ALL

    # It is known wherever kinds are.
    subjects.test_every_kind_is_declared_once()
    schemas.test_a_finding_of_any_kind_is_as_the_schema_says(Kind.GYRO_SPINS)
    schemas.test_a_finding_in_flight_is_as_the_schema_says(Kind.GYRO_SPINS)
    table.test_every_case_is_a_fault_of_a_flight(needs.tool("integrity_table"))
    room = Path("h2nav", SENSOR_CHECKS.room)
    sources = [KernelSource(path, (room / path).read_text("utf-8")) for path in SENSOR_CHECKS.paths]
    assert "s->spins_us" in translate(sources, [SENSOR_CHECKS.entry]).code
