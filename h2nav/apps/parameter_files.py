"""Parameter files of ground stations: ArduPilot's, QGroundControl's, PX4's shell lines."""

import math
from collections.abc import Iterable
from pathlib import Path

from h2nav.errors import BadInput

MAX_LINES = 20_000
LARGEST_PARAMETER = 3.4e38  # autopilots keep 32 bits of a number


def read_parameters(path: Path) -> dict[str, float]:
    """Reads parameters by name.

    Raises:
        BadInput: it cannot be read, or is not a parameter file.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; name a parameter file") from error
    return parameters_of(text.splitlines(), str(path))


def parameters_of(lines: Iterable[str], name: str) -> dict[str, float]:
    """Parses parameters in any of these forms; one that is not a number is not set.

    Args:
        name: of the file, for errors.

    Raises:
        BadInput: a line is not a parameter.
    """
    found: dict[str, float] = {}
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        if words[:2] == ["param", "set"]:
            words = words[2:]
        pair = words[2:4] if len(words) == 5 else words[:2]
        try:
            key, value = pair[0], float(pair[1])
            if abs(value) >= LARGEST_PARAMETER:
                raise ValueError
        except (IndexError, ValueError):
            raise BadInput(
                f"{name}:{number}: {line.strip()[:60]!r} is not a parameter; expected NAME,VALUE "
                "or QGroundControl's five columns"
            ) from None
        if not math.isnan(value):  # which is not set
            found[key] = value
        if number > MAX_LINES:
            raise BadInput(f"{name}: more than {MAX_LINES} lines; this is not a parameter file")
    return found
