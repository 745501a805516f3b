"""A column of an IMU, a compass, a receiver, an attitude or a text"""

CHANGES = {
    "h2nav/recordings/receiver_tables.py": (
        (
            "    is_used: Array  #",
            """\
    hdop: Array  # (N,)
    is_used: Array  #""",
        ),
        (
            '                "is_used": column("U", may_lack=True),\n',
            """\
                "is_used": column("U", may_lack=True),
                "hdop": column("HDop", may_lack=True),
""",
        ),
        (
            '                "spoofing": column("spoofing_state", may_lack=True),\n',
            """\
                "spoofing": column("spoofing_state", may_lack=True),
                "hdop": column("hdop", may_lack=True),
""",
        ),
        (
            '                    "satellites": column("satellites_visible",',
            """\
                    "hdop": column("eph", scale=CENTI),
                    "satellites": column("satellites_visible",""",
        ),
    ),
}

if __name__ == "__main__":
    import numpy as np

    from h2nav.recordings.columns import Format, read
    from h2nav.recordings.log_rows import Rows
    from h2nav.recordings.receiver_tables import FIXES
    from h2nav.recordings.row_tables import Table

    class Log:
        def instances(self, name, *columns):
            row = [(one, "i4") for one in {*columns, "HDop", "hdop", "eph"}]
            table = Table(name, np.arange(1), np.full(1, 120, row))
            yield Rows(0, table, np.zeros(1, np.int64), np.zeros(1))

    log = Log()
    for log.format in Format:
        factor = 0.01 if log.format is Format.TELEMETRY else 1.0
        assert read(log, (FIXES,)).values["fixes"][0].hdop == [120 * factor]
