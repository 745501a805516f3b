"""Anonymises recordings, and searches what came out for where and whose they were.

Each is given to `h2nav log anonymise`, which reviews both files and searches the new one for some
fixes and for the id. Here every byte of it is looked at, at every offset: pairs of int32, float and
double within 2 km of any fix of the old one, in both orders, up to 16 bytes apart, in degrees and
in metres from 0 deg; decimals in texts near its latitudes and longitudes; parameters that hold its
declination; texts of the old one that look like ids, paths or addresses.

Run: python tools/anonymous_logs.py FILE...
"""

import argparse
import contextlib
import io
import json
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from h2nav.apps.log_anonymise import _facts, _kind
from h2nav.cli import main as h2nav
from h2nav.recordings.anonymous import DEGREE_M

MARGIN_DEG = 0.02
LONGEST_STEP = 16
# The last one: metres from 0 deg.
KINDS = (("<i4", 1e7), ("<f4", 1e7), ("<f4", 1.0), ("<f8", 1.0), ("<f4", DEGREE_M))
DECIMAL = re.compile(rb"-?\d{1,3}\.\d{3,}")
NAMING = re.compile(
    rb"[0-9A-F]{8}(?: [0-9A-F]{8}){2}|[\w.+-]{3,}@[\w-]{3,}\.\w{2,}|(?:/[\w.-]{2,}){3,}"
)
# With its value behind its name, in both autopilots' logs.
DECLINATION = re.compile(rb"(?s:(?:COMPASS_DEC\0{5}|EKF2_MAG_DECL|ATT_MAG_DECL).{4})")


class Box(NamedTuple):
    """Where the old flight was, degrees."""

    latitudes: tuple[float, float]
    longitudes: tuple[float, float]


def main() -> int:
    """Prints a line for each; 1 if anything remained or the findings of any differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    bad = findings = 0
    files = parser.parse_args().files
    for file in files:
        begun_s = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            new = Path(folder) / file.name
            said, errors = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(errors):
                status = h2nav(["log", "anonymise", str(file), "-o", str(new), "--json"])
            if status not in (0, 1):
                print(f"{file.name}: not anonymised: {errors.getvalue().strip()}", flush=True)
                continue
            found = json.loads(said.getvalue())
            box = box_of(file)
            left = [*found["remains"], *remaining(file.read_bytes(), new.read_bytes(), box)]
        differences = found["differences"]
        bad += bool(left or differences)
        findings += found["findings"]
        print(
            f"{file.name}: {found['findings']} findings, {len(differences)} differ, "
            f"{len(left)} remained, {time.process_time() - begun_s:.0f} s",
            *(f"  {line}" for line in (*left[:9], *differences)),
            sep="\n",
            flush=True,
        )
    print(f"{len(files)} recordings, {findings} findings, {bad} with a difference or a remainder")
    return 1 if bad else 0


def box_of(file: Path) -> Box | None:
    """Where a recording was; None if it has no fix."""
    fixes = np.array(_facts(_kind(file), file)[0])
    if not len(fixes):
        return None
    low, high = fixes.min(axis=0) - MARGIN_DEG, fixes.max(axis=0) + MARGIN_DEG
    return Box((low[0], high[0]), (low[1], high[1]))


def remaining(old: bytes, new: bytes, box: Box | None) -> list[str]:
    """What of the old recording is still in the new one."""
    names = {name for name in NAMING.findall(old) if name in new}
    names |= {held for held in DECLINATION.findall(old) if held in new and any(held[-4:])}
    return [f"a name: {name!r}" for name in sorted(names)] + ([] if box is None else near(new, box))


def near(data: bytes, box: Box) -> list[str]:
    """What lies in a box, at any byte."""
    found = []
    for kind, scale in KINDS:
        size = np.dtype(kind).itemsize
        inside = [np.zeros(len(data), np.bool_) for _ in box]
        for offset in range(size):
            stored = np.frombuffer(data, kind, (len(data) - offset) // size, offset)
            with np.errstate(invalid="ignore"):
                values = stored / scale
                for of_axis, (low, high) in zip(inside, box, strict=True):
                    of_axis[offset : offset + size * len(values) : size] = (
                        (low <= values) & (values <= high) & (np.abs(values) > MARGIN_DEG)
                    )
        latitudes, longitudes = (np.flatnonzero(each) for each in inside)
        steps = np.arange(size, LONGEST_STEP + 1)
        for first, second in ((latitudes, longitudes), (longitudes, latitudes)):
            pairs = np.isin(first[:, None] + steps, second)
            places = first[pairs.any(axis=1)]
            found += [f"a pair of {kind} at byte {place}" for place in places]
    for text in DECIMAL.finditer(data):
        if any(low <= float(text[0]) <= high and abs(float(text[0])) > 1.0 for low, high in box):
            found.append(f"a text at byte {text.start()}: {text[0].decode()}")
    return found


if __name__ == "__main__":
    sys.exit(main())
