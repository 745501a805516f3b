"""A field of a log"""

CHANGES = {
    "h2nav/recordings/field_tables.py": (
        (
            "SERIES = (\n",
            """\
SERIES = (
    Field("made", "V", dataflash=(series("POWR", "VServo"),)),
""",
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.recordings.columns import Format, messages_of
    from h2nav.recordings.field_tables import FIELDS

    assert "made" in [one.name for one in FIELDS]
    assert "POWR" in messages_of(Format.DATAFLASH, FIELDS)
