"""Reviews of worn logs: a review, or words that say why not; never anything else."""

import argparse
import json
import math
import random
from functools import cache
from pathlib import Path
from typing import Any

import made_logs

from fuzz.worn_logs import Log, is_readable, log_of, text_of, worn
from h2nav.apps import playback
from h2nav.apps.reviewing import write_review
from h2nav.errors import BadInput

TAKEOFF = Path(__file__).parents[1] / "data" / "takeoff_40s.tlog"
SECONDS = 25.0


@cache
def seeds() -> dict[str, Log]:
    """A small sound log of each format, and of old ones."""
    flight = made_logs.made_flight(duration_s=SECONDS, rate_hz=50.0, imus=2)
    old = made_logs.dataflash(flight, old=True)
    logs = {
        "new.bin": made_logs.dataflash(flight),
        "old.bin": old,
        "old.log": text_of(old),
        "new.ulg": made_logs.ulog(flight),
        "old.ulg": made_logs.ulog(flight, old=True),
        "one.tlog": TAKEOFF.read_bytes()[: 400 * 1024],
    }
    return {name: log_of(name, data) for name, data in logs.items()}


def case(log: Log, number: int) -> tuple[bytes, str]:
    """A worn log, always the same of a number, and what was done to it."""
    changed, names = worn(random.Random(number), log)
    return changed.bytes(), names


def reviewed(data: bytes, ending: str, folder: Path, *, smooths: bool = False) -> dict[str, Any]:
    """Its review, which is sound JSON; empty if it was refused, as others refuse it."""
    path = folder / f"worn{ending}"
    path.write_bytes(data)
    parser = argparse.ArgumentParser()
    playback.add_arguments(parser)
    options = playback.options(parser.parse_args([]))
    try:
        write_review(path, folder, "worn", options, smooths=smooths)
    except BadInput as error:
        if is_readable(str(path)):
            raise AssertionError(f"refused, and others read it: {error}") from error
        return {}
    document = json.loads((folder / "worn.json").read_bytes(), parse_constant=_no_json)
    for one in document["findings"]:
        assert one["text"]
        assert "nan" not in one["text"].split(), one
        assert -math.inf < one["from_s"] <= one["to_s"] < math.inf, one
    assert "nan" not in document["verdict"].split(), document["verdict"]
    return document


def _no_json(constant: str) -> None:
    raise AssertionError(f"{constant} in the document")
