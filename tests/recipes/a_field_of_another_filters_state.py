"""A field of another filter's state, or one that the integers alone have"""

ROOM = "h2nav/attitude"
CHANGES = {
    f"{ROOM}/constant_gain/memory.py": (
        (
            '    saturations: I32 = integer(\n        0, SATURATIONS_LIMIT, "",',
            """\
    forces: I32 = integer(0, SATURATIONS_LIMIT, "", "samples whose force was used; never wraps")
    saturations: I32 = integer(
        0, SATURATIONS_LIMIT, "",""",
        ),
    ),
    f"{ROOM}/constant_gain/kernel/step.py": (
        (
            "    s.age_us = clamp(s.age_us + sample.dt_us, 0, AGE_LIMIT_US)\n",
            """\
    s.age_us = clamp(s.age_us + sample.dt_us, 0, AGE_LIMIT_US)
    s.forces = clamp(s.forces + (used & FORCE_USED), 0, SATURATIONS_LIMIT)
""",
        ),
    ),
    f"{ROOM}/velocity_aided/integer/memory.py": (
        (
            '    saturations: I32 = integer(0, 1 << 30, "",',
            """\
    fixes_judged: I32 = integer(0, 1 << 30, "", "fixes that were judged; never wraps")
    saturations: I32 = integer(0, 1 << 30, "",""",
        ),
    ),
    f"{ROOM}/velocity_aided/integer/kernel/fixes.py": (
        (
            "    s.innovation_n = s.fix_innovation_n\n",
            """\
    s.fixes_judged = clamp(s.fixes_judged + 1, 0, 1 << 30)
    s.innovation_n = s.fix_innovation_n
""",
        ),
    ),
}
WRITTEN = ("docs/memory.md",)

if __name__ == "__main__":
    import subprocess
    import sys
    from pathlib import Path

    from h2nav.apps.export_c import kernel_sources
    from h2nav.attitude.kernel_files import CONSTANT_GAIN, VELOCITY_AIDED_INTEGER
    from h2nav.translate.c99 import translate

    subprocess.run([sys.executable, "tools/memory_tables.py"], check=True)
    page = Path(*WRITTEN).read_text(encoding="utf-8")
    assert "fixes that were judged" in page
    assert "samples whose force was used" in page

    # The ranges are proved, and the C has the fields.
    code = translate(kernel_sources(CONSTANT_GAIN), [CONSTANT_GAIN.entry]).code
    assert "s->forces =" in code
    code = translate(kernel_sources(VELOCITY_AIDED_INTEGER), [VELOCITY_AIDED_INTEGER.entry]).code
    assert "s->fixes_judged =" in code
