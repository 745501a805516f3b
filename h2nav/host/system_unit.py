"""The daemon's systemd unit: its location, installation and start."""

import pwd
import subprocess
import sys
from importlib import resources
from pathlib import Path

from h2nav.errors import TaskFailed

UNIT = "h2nav.service"
USER = "h2nav"
RUNNING = Path("/run/systemd/system")
UNIT_FOLDER = Path("/etc/systemd/system")
PACKAGED_UNITS = (Path("/lib/systemd/system") / UNIT, Path("/usr/lib/systemd/system") / UNIT)
PROGRAM_OF_THE_PACKAGE = "/opt/h2nav/bin/h2nav"


def is_booted() -> bool:
    """Whether systemd runs this computer (sd_booted)."""
    return RUNNING.is_dir()


def unit_text(program: str) -> str:
    """The unit's text for the program at this path."""
    packaged = Path(str(resources.files("h2nav"))) / "packaging" / "systemd" / UNIT
    here = Path(__file__).parents[2] / "packaging" / "systemd" / UNIT
    text = (packaged if packaged.is_file() else here).read_text(encoding="utf-8")
    return text.replace(PROGRAM_OF_THE_PACKAGE, program)


def install_and_start() -> None:
    """Creates the user and, where no package brought it, the unit; enables and starts it.

    Raises:
        TaskFailed: a step failed; the text is the tool's output.
        OSError: the unit cannot be written.
    """
    if not _has_user():
        _run("useradd", "--system", "--user-group", "--groups", "dialout",
             "--no-create-home", USER)  # fmt: skip
    if not any(path.is_file() for path in PACKAGED_UNITS):
        program = str(Path(sys.executable).with_name("h2nav"))
        (UNIT_FOLDER / UNIT).write_text(unit_text(program), encoding="utf-8")
    _run("systemctl", "daemon-reload")
    _run("systemctl", "enable", UNIT)
    _run("systemctl", "restart", UNIT)


def _has_user() -> bool:
    try:
        pwd.getpwnam(USER)
    except KeyError:
        return False
    return True


def _run(*words: str) -> None:
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    except OSError as error:
        raise TaskFailed(f"{words[0]}: {error.strerror}") from error
    if done.returncode:
        raise TaskFailed(f"{' '.join(words)}: {done.stderr.strip() or done.returncode}")
