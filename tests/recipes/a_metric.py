"""A metric"""

CHANGES = {
    "h2nav/live/metrics.py": (
        (
            "_GAUGES = (\n",
            '_GAUGES = (\n    _Row("made", "A made one.", "/health", "samples_used", 0.5),\n',
        ),
    ),
}

if __name__ == "__main__":
    from live_records import flying_state

    from h2nav.live.metrics import metrics_text

    assert b"\nh2nav_made 1000.0\n" in metrics_text(flying_state(), 0)
