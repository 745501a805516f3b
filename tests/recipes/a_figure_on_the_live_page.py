"""A figure on the live page"""

CHANGES = {
    "h2nav/live/messages.py": (
        (
            '        "version": __version__,\n',
            '        "version": __version__,\n        "made": len(state.alarms),\n',
        ),
    ),
    "h2nav/live/assets/figures.js": (
        ("process(data), vehicle(data),\n", "process(data), vehicle(data), made(data),\n"),
        (
            "function samples({ health, status }) {\n",
            """\
function made({ made: count }) {
  return ["made", `${count}`, false];
}

function samples({ health, status }) {
""",
        ),
    ),
}

if __name__ == "__main__":
    from live_records import flying_state

    from h2nav.live.messages import overview

    assert overview(flying_state())["made"] == 0
