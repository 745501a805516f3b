"""A line of the terminal panel"""

CHANGES = {
    "h2nav/apps/panel.py": (
        ("        _log(log),\n", "        _log(log),\n        _made(health),\n"),
        (
            "def _state(health: HealthRecord,",
            """\
def _made(health: HealthRecord) -> str:
    return f"made       {health.samples_used} samples"


def _state(health: HealthRecord,""",
        ),
    ),
}

if __name__ == "__main__":
    from live_records import estimate, health, status

    from h2nav.apps.panel import Sight, panel_lines

    shown = panel_lines(Sight(health(), status(), None), estimate())
    assert "made       2000 samples" in shown
