"""What a command may load before it works: modules, by name, since times vary with the machine.

Whoever needs another package for a command imports it where it is used, or extends its row here
and says in the change how much longer the command takes to start (`python -X importtime`).
"""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
from h2nav.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
finally:
    print(*(f"loaded {name}" for name in sys.modules), sep="\\n", file=sys.stderr)
"""
# Beside the standard library, and h2nav itself. What writes a log is for daemons that write one.
DAEMON = {"fastcrc", "orjson", "pymavlink", "serial", "yaml"}
CONFIGURATION = {"fastcrc", "pymavlink", "yaml"}
PACKAGES = {
    ("--help",): set(),
    ("log", "--help"): set(),
    ("replai",): set(),
    ("status", "--socket", "/nonexistent"): set(),
    ("check-config", "/nonexistent"): CONFIGURATION,
    ("setup", "--help"): CONFIGURATION | {"serial", "tqdm"},
    ("run", "--connect", "nonsense"): DAEMON,
    ("replay", "--no-log", "/nonexistent"): CONFIGURATION | {"numpy", "orjson"},
    ("check", "--connect", "nonsense"): DAEMON | {"pygeomag"},
}
# Slow ones of the standard library.
SLOW = {"asyncio", "ctypes.util", "multiprocessing", "sqlite3", "ssl", "unittest", "xml.etree"}


def loaded_by(words: tuple[str, ...]) -> set[str]:
    result = subprocess.run(
        [sys.executable, "-I", "-c", PROGRAM, *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    lines = (line.partition("loaded ") for line in result.stderr.splitlines())
    return {name for before, _, name in lines if name and not before}


@pytest.mark.parametrize("words", PACKAGES, ids=" ".join)
def test_a_command_loads_no_package_that_it_does_not_need(words: tuple[str, ...]) -> None:
    names = loaded_by(words)
    assert "h2nav.cli" in names, "the command was run"
    before = {name.partition(".")[0] for name in loaded_by(("--help",))}
    packages = {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) - before
    # Compiled packages bring modules of their tools.
    packages = {name for name in packages if not name.startswith(("_", "cython"))}
    more = packages - PACKAGES[words]
    assert not more, f"h2nav {' '.join(words)} loads {more}: import them where they are used"
    slow = SLOW & names
    assert not slow, f"h2nav {' '.join(words)} loads {slow}: import them where they are used"


def test_the_list_of_commands_loads_no_command() -> None:
    ours = {name for name in loaded_by(("--help",)) if name.startswith("h2nav")}
    assert ours == {"h2nav", "h2nav.cli", "h2nav.errors"}


def test_the_state_is_shown_without_the_configuration() -> None:
    ours = loaded_by(("status", "--socket", "/nonexistent"))
    assert "h2nav.apps.status" in ours
    assert not {"h2nav.apps.configuration", "h2nav.service.service"} & ours
