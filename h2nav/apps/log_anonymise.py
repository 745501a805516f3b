"""`h2nav log anonymise`: a log that may be shown to others, with its physics kept."""

import argparse
import secrets
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps import playback
from h2nav.apps.json_output import print_json
from h2nav.apps.log_progress import byte_bar
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.recordings.anonymous import Coordinates, Replacement
    from h2nav.recordings.anonymous_logs import Counted
    from h2nav.recordings.anonymous_place import Elsewhere

_CLOSING = """\
The flight is moved, not turned, to another place with the earth's field and the gravity of the old
one, so that everything in the log still fits together; --to and --far give that up. Altitudes,
headings, velocities, the shape of the way, times since boot and the time of the week stay. Dates go
back by some weeks. Ids of processors become pseudonyms; paths, addresses and coordinates in texts
lose their letters and digits; counters, serial numbers and network parameters become 0; what the
autopilot held of the earth's field becomes the new place's; raw data of receivers, heights of the
map, other vehicles, files and tunnels are removed, and so are bytes that belong to no message.
Signatures of MAVLink frames are dropped.

The new file is searched for the old coordinates and ids, and both are reviewed: the findings have
to be the same. Where one is at the limit of a test and differs, up to four other places are drawn,
and the best is kept. Look at the file yourself before you publish it: who knows the way and the
vehicle still knows the flight.

FILE is a dataflash log (.bin), a ULog file (.ulg), a telemetry log (.tlog), raw MAVLink, or our own
log (.mcap). The new file has the same format, but of the last two it is a telemetry log: the frames
that were received, without our configuration, estimates and texts.

exit status: 1 if something remained or the findings differ; the new file is kept."""
# Findings of both reviews are the same within this.
SAME_S = 0.5
# Places that are drawn until the findings are the same.
MAX_DRAWS = 5
# Weeks by which dates go back.
MAX_WEEKS = 400


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument("log", type=Path, metavar="FILE", help="a recording")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="the new file"
    )
    parser.add_argument("--to", metavar="LAT,LON", help="where the flight goes, degrees")
    parser.add_argument(
        "--far", action="store_true", help="a random place anywhere; its field is another one"
    )
    parser.add_argument("--keep-date", action="store_true", help="dates stay as they are")
    parser.add_argument(
        "--no-check", action="store_true", help="do not review both files (the bytes are searched)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    if args.to is not None and args.far:
        raise BadInput("--to and --far: both choose the place; leave one of them out")
    if args.output.exists():
        raise BadInput(f"{args.output}: exists; name another file with -o")
    document = _best(args)
    if args.json:
        print_json(document)
    else:
        _show(document)
    is_good = not document["remains"] and not document["differences"]
    return 0 if is_good else 1


def _best(args: argparse.Namespace) -> dict[str, Any]:
    """Anonymises to the first place drawn whose review is the same, or else to the best of some.

    What is found at the limit of a test may not be found with a field that is a little off.
    """
    kind = _kind(args.log)
    fixes, unix_s = _facts(kind, args.log)
    best = _drawn(args, kind, fixes, unix_s, args.output)
    old = None if args.no_check else _reviewed(args.log)
    _check(best, fixes, old)
    has_choice = best["moved"] and args.to is None and not args.far
    draws = MAX_DRAWS if has_choice else 1
    while best["differences"] and not best["remains"] and best["draws"] < draws:
        with tempfile.TemporaryDirectory(dir=args.output.parent) as folder:
            path = Path(folder) / args.output.name
            other = _drawn(args, kind, fixes, unix_s, path)
            _check(other, fixes, old)
            other["draws"] = best["draws"] = best["draws"] + 1
            if len(other["differences"]) < len(best["differences"]) and not other["remains"]:
                path.replace(args.output)
                best = {**other, "path": str(args.output)}
    return best


def _drawn(
    args: argparse.Namespace,
    kind: str,
    fixes: "list[Coordinates]",
    unix_s: float | None,
    output: Path,
) -> dict[str, Any]:
    """Writes the recording as it would have been somewhere else, and says what was replaced."""
    from h2nav.recordings.anonymous import Replacement
    from h2nav.recordings.anonymous_place import fields_of, middle_of

    origin = middle_of(fixes)
    elsewhere = _target(args, origin, unix_s)
    fields = fields_of(origin, elsewhere, unix_s)
    by = Replacement(origin, *elsewhere, secrets.token_bytes(32), fields)
    try:
        with byte_bar("anonymising") as progress:
            counted, signatures = _written(kind, args.log, output, by, progress)
    except OSError as error:
        raise BadInput(
            f"{error.filename or output}: {error.strerror}; name a place that can be written"
        ) from error
    return {
        "path": str(output),
        "moved": origin is not None,
        "weeks": elsewhere.weeks,
        "draws": 1,
        "replaced": counted._asdict(),
        "signatures_dropped": signatures,
    }


def _kind(path: Path) -> str:
    from h2nav.recordings.dataflash_tables import is_binary, is_dataflash
    from h2nav.recordings.opening import beginning_of
    from h2nav.recordings.recording import open_recording
    from h2nav.recordings.ulog_tables import is_ulog

    start = beginning_of(path)
    if is_ulog(start):
        return "ulog"
    if is_binary(start):
        return "dataflash"
    if is_dataflash(start):
        raise BadInput(f"{path}: a dataflash log as text; expected the binary one (.bin)")
    open_recording(path)
    return "frames"


def _facts(kind: str, path: Path) -> "tuple[list[Coordinates], float | None]":
    """Some fixes of the recording, the first one first, and its date."""
    from h2nav.recordings.anonymous_frames import frame_facts
    from h2nav.recordings.anonymous_logs import dataflash_facts, ulog_facts
    from h2nav.recordings.recording import open_recording

    if kind == "frames":
        return frame_facts(open_recording(path))
    return dataflash_facts(path) if kind == "dataflash" else ulog_facts(path)


def _target(
    args: argparse.Namespace, origin: "Coordinates | None", unix_s: float | None
) -> "Elsewhere":
    from h2nav.files.earth_field import UNDATED_UNIX_S
    from h2nav.recordings.anonymous import Coordinates
    from h2nav.recordings.anonymous_place import Elsewhere, random_place, similar_place

    allowed = range(1) if args.keep_date else range(1, MAX_WEEKS + 1)
    weeks = secrets.choice(allowed)
    if args.to is not None:
        return Elsewhere(_place(args.to), weeks)
    if origin is None:
        return Elsewhere(Coordinates(0.0, 0.0), weeks)
    seed = secrets.randbits(64)
    if args.far:
        return Elsewhere(random_place(origin, seed), weeks)
    if unix_s is None:  # its review takes this date
        return similar_place(origin, UNDATED_UNIX_S, range(1), seed)
    return similar_place(origin, unix_s, allowed, seed)


def _place(text: str) -> "Coordinates":
    from h2nav.recordings.anonymous import Coordinates

    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(f"--to {text}: expected LAT,LON in degrees, such as 47.4,8.5") from None
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise BadInput(f"--to {text}: expected at most 89 and 180 degrees")
    return Coordinates(latitude, longitude)


def _written(
    kind: str, path: Path, output: Path, by: "Replacement", progress: Any
) -> "tuple[Counted, int]":
    from h2nav.recordings.anonymous_frames import anonymise_frames
    from h2nav.recordings.anonymous_logs import anonymise_dataflash, anonymise_ulog
    from h2nav.recordings.recording import open_recording

    if kind == "frames":
        return anonymise_frames(open_recording(path), output, by, progress)
    write = anonymise_dataflash if kind == "dataflash" else anonymise_ulog
    return write(path, output, by, progress), 0


# --- the check ----------------------------------------------------------------------------------


def _check(
    document: dict[str, Any], fixes: "list[Coordinates]", old: dict[str, Any] | None
) -> None:
    """Adds what remained, and how the findings differ; null where that was not looked at.

    Args:
        document: of the new recording.
        fixes: of the old one.
        old: its review.
    """
    from h2nav.recordings.anonymous_check import remains

    output = Path(document["path"])
    if old is None:
        document |= {"remains": remains(output, fixes, ()), "findings": None, "differences": None}
        return
    names = [name for name in (old["airframe"]["uid"],) if name]
    new = _reviewed(output)
    document["remains"] = remains(output, fixes, names)
    document["findings"] = len(old["findings"])
    document["differences"] = differences(old["findings"], new["findings"])


def _reviewed(path: Path) -> dict[str, Any]:
    from h2nav.apps.reviewing import review
    from h2nav.recordings.opening import open_flight
    from h2nav.reviews.document import document

    with byte_bar(f"reviewing {path.name}") as progress:
        options = playback.PlaybackOptions()
        return document(*review(open_flight(path), options, smooths=False, progress=progress))


def differences(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> list[str]:
    """Findings that only one of two reviews has, one phrase each."""
    left = list(new)
    missing = []
    for one in old:
        same = next((each for each in left if _is_same(one, each)), None)
        if same is None:
            missing.append(one)
        else:
            left.remove(same)
    return [
        *(f"no longer found: {_phrase(one)}" for one in missing),
        *(f"newly found: {_phrase(one)}" for one in left),
    ]


def _is_same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    names = ("kind", "source", "severity")
    is_alike = all(one[name] == other[name] for name in names)
    return is_alike and all(abs(one[name] - other[name]) <= SAME_S for name in ("from_s", "to_s"))


def _phrase(one: dict[str, Any]) -> str:
    return f"{one['severity']}: {one['from_s']:.1f} s: {one['source']}: {one['text']}"


def _show(document: dict[str, Any]) -> None:
    replaced = Counter(document["replaced"])
    parts = [f"{count} {name.replace('_', ' ')}" for name, count in replaced.items() if count]
    print(f"{document['path']}: {', '.join(parts) or 'nothing'} replaced or removed")
    if not document["moved"]:
        print("it holds no position, so nothing was moved")
    if document["signatures_dropped"]:
        print(f"{document['signatures_dropped']} frames were signed: their signatures are dropped")
    for line in document["remains"]:
        print(f"h2nav: remained: {line}", file=sys.stderr)
    if document["differences"] is None:
        print("not reviewed")
    elif not document["differences"]:
        print(f"the reviews of both have the same findings ({document['findings']})")
    if document["draws"] > 1:
        print(f"{document['draws']} places were tried")
    for line in document["differences"] or ():
        print(f"h2nav: {line}", file=sys.stderr)
