"""Stand-ins for the review of a flight: a recording is a word that says what becomes of it.

They live in a module of their own because the workers of a cluster import it.
"""

import os
import time
from pathlib import Path
from typing import Any

from h2nav.errors import BadInput

FINDING = {
    "kind": "magnet", "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.5,
    "size": 9.0, "unit": "deg", "text": "compass near a magnet", "evidence": "dip",
}  # fmt: skip


def review(path: Path, folder: Path, diary: str) -> dict[str, Any]:
    """What the word in the recording says; a line in `diary` says that it was done."""
    word = path.read_text()
    descriptor = os.open(diary, os.O_CREAT | os.O_APPEND | os.O_WRONLY)
    os.write(descriptor, f"{path.name} {word}\n".encode())
    os.close(descriptor)
    if word == "broken":
        raise BadInput(f"{path}: no recording; expected MAVLink")
    if word == "fault":
        raise ZeroDivisionError("division by zero")
    if word == "die":
        os._exit(9)
    while word == "hang":
        time.sleep(0.1)
    eaten = []
    while word == "eat":
        eaten.append(b"x" * (1 << 20))
        time.sleep(1e-3)  # so that the watch sees it in time
    (folder / "page.html").write_text(f"<p>{word}</p>")
    (folder / "page.json").write_text("{}")
    return {
        "kind": "tlog",
        "vehicle": "<b>quadrotor</b>",
        "duration_s": float(len(word)),
        "imus": len(word),
        "findings": [FINDING] * (len(word) - 4),
        "page": "page.html",
    }
