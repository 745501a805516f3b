"""Notes taken during a flight: lines of the autopilot's time, s, and a text.

A text ``PHASE word`` begins a phase, which lasts until the next one begins.
"""

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from h2nav.errors import BadInput

LINE = re.compile(r"\s*(\d{1,12}(?:\.\d{1,9})?)\s+(\S.*?)\s*")
PHASE = "PHASE "


class Event(NamedTuple):
    """One line."""

    boot_s: float  # the autopilot's time, s
    text: str  # what happened


class FlightPhase(NamedTuple):
    """A part of a flight."""

    name: str  # phases of the same name are scored together
    from_s: float  # its beginning, s
    to_s: float  # its end, s; infinite for the last one


def events_path(recording: Path) -> Path | None:
    """The file of events of a recording: its name, or its stem, with .events; None without."""
    beside = (recording.with_name(f"{name}.events") for name in (recording.name, recording.stem))
    return next((path for path in beside if path.is_file()), None)


def read_events(path: Path) -> list[Event]:
    """Reads the events of a file; raises BadInput if a line has another form."""
    events = []
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        match = LINE.fullmatch(line)
        if match is None:
            raise BadInput(f"{path}:{number}: expected a time in s and a text")
        events.append(Event(float(match[1]), match[2]))
    return events


def phases_of(events: list[Event]) -> list[FlightPhase]:
    """The phases that the events begin."""
    begins = [event for event in events if event.text.startswith(PHASE)]
    end = Event(math.inf, "")
    return [
        FlightPhase(event.text.removeprefix(PHASE), event.boot_s, following.boot_s)
        for event, following in pairwise([*begins, end])
    ]


def parse_phase(text: str) -> FlightPhase:
    """``NAME=FROM-TO``, times in s; raises ValueError if it is of another form."""
    match = re.fullmatch(r"([^=]+)=(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)", text)
    if match is None or float(match[2]) >= float(match[3]):
        raise ValueError(f"expected NAME=FROM-TO, found {text}")
    return FlightPhase(match[1], float(match[2]), float(match[3]))
