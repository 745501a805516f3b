"""A command"""

CHANGES = {
    "h2nav/apps/made.py": '''\

"""A made command."""


def add_arguments(parser):
    parser.add_argument("--made")


def run(arguments):
    return 0
''',
    "h2nav/cli.py": (
        (
            '        ("demo",): CommandEntry(\n',
            """\
        ("made",): CommandEntry("made", "a made one", "made"),
        ("demo",): CommandEntry(
""",
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.cli import main

    assert main(["made", "--made", "x"]) == 0
