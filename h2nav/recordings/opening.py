"""Opens any flight recording by its content, not by its name."""

from pathlib import Path

from h2nav.errors import BadInput
from h2nav.recordings.dataflash_tables import is_dataflash
from h2nav.recordings.imported import ImportedLog
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.recording import open_recording
from h2nav.recordings.ulog_tables import is_ulog

PROBE_BYTES = 4096

Source = Recording | ImportedLog


def beginning_of(path: Path) -> bytes:
    """The first bytes of a recording, which show its kind.

    Raises:
        BadInput: there is no such file, or it cannot be read.
    """
    try:
        if path.is_dir():
            raise BadInput(
                f"{path}: is not a file but a folder; expected a recording: name those in it, or "
                "review them all with 'h2nav fleet'"
            )
        if path.exists() and not path.is_file():
            raise BadInput(f"{path}: is not a file; expected a recording")
        with path.open("rb") as stream:
            return stream.read(PROBE_BYTES)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; expected a recording") from error


def open_flight(path: Path | str) -> Source:
    """Opens telemetry logs, raw MAVLink, logs of h2nav, and autopilots' own logs.

    Raises:
        BadInput: there is no such file, it cannot be read, or it is of another kind.
    """
    path = Path(path)
    start = beginning_of(path)
    # An importer is loaded for its recordings only.
    if is_dataflash(start):
        from h2nav.recordings.dataflash import open_dataflash

        return open_dataflash(path)
    if is_ulog(start):
        from h2nav.recordings.ulog import open_ulog

        return open_ulog(path)
    return open_recording(path)
