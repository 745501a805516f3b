"""Any flight recording, opened by what it holds and not by its name."""

from pathlib import Path

from h2nav.flightlogs.imported import ImportedLog
from h2nav.io.recordings import Recording, open_recording

Source = Recording | ImportedLog


def open_flight(path: Path | str) -> Source:
    """Telemetry logs, raw MAVLink, our own logs, and the logs that autopilots write themselves.

    Raises:
        BadInput: there is no such file, it cannot be read, or it is none of these.
    """
    return open_recording(path)
