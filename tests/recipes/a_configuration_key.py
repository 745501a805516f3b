"""A configuration key"""

CHANGES = {
    "h2nav/service/settings.py": (
        (
            '    lanes: Lanes = "auto"\n',
            """\
    made_hz: RateHz = 3.0
    lanes: Lanes = "auto"
""",
        ),
    ),
}

if __name__ == "__main__":
    import contextlib
    import io

    from h2nav.cli import main

    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["check-config", "--schema"]) == 0
    assert '"made_hz"' in out.getvalue()
