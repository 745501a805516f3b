"""Where a daemon without a service manager leaves its event socket."""

import os
from pathlib import Path

# The socket of the systemd unit, and of root.
USUAL_SOCKET = Path("/run/h2nav/events")


def own_socket() -> Path | None:
    """The event socket of this user's daemon; None without a folder for such files."""
    folder = os.environ.get("XDG_RUNTIME_DIR")
    if folder:
        return Path(folder) / "h2nav" / "events"
    return USUAL_SOCKET if os.geteuid() == 0 else None
