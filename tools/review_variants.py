"""Reviews variants of logs, whose right answer follows from the original's.

    python tools/review_variants.py LOG... [--only PATTERN] [--json FILE]

LOG: recordings (.bin, .ulg, .tlog). Of each variant that is answered otherwise its verdict is
printed, and below it what to look at: `+` a warning or an error that the original's review does not
have, `-` one that is gone although its time is kept, `?` a subject that was looked at without its
messages, `!` a traceback or a refusal. Not each of them is wrong: what was left out may have been
evidence. The variants are those of tests/fuzz/log_variants.py; PATTERN selects them by name.
"""

import argparse
import json
import re
import sys
import tempfile
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPOSITORY / "tests"))

from fuzz.log_variants import variants  # noqa: E402
from fuzz.worn_logs import Log, log_of  # noqa: E402
from h2nav.apps.playback import PlaybackOptions  # noqa: E402
from h2nav.apps.reviewing import review  # noqa: E402
from h2nav.errors import BadInput  # noqa: E402
from h2nav.recordings.opening import open_flight  # noqa: E402
from h2nav.reviews.document import document  # noqa: E402

Document = dict[str, Any]
SERIOUS = ("critical", "error", "warning")
# Findings of one thing begin and end this far apart in two reviews.
SLACK_S = 5.0
# What began in the first seconds of a log may not have begun there.
SETTLED_S = 2.0
# What can only be looked at with its messages.
SUBJECTS = {
    "no_gps": "GPS",
    "no_compass": "compasses",
    "no_attitude": "attitude against its demand",
    "no_outputs": "motors",
    "no_battery": "battery",
}


def reviewed(log: Log, name: str) -> Document:
    """The document of its review; of a failure its `failure`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}{log.ending}"
        path.write_bytes(log.bytes())
        try:
            return document(*review(open_flight(path), PlaybackOptions()))
        except BadInput as error:
            return {"failure": f"refused: {error}"}
        except Exception:
            return {"failure": traceback.format_exc()}


def suspects(original: Document, variant: Document, name: str) -> Iterator[str]:
    """What the review of a variant says otherwise than the original's, a line each."""
    if "failure" in variant:
        yield f"! {variant['failure']}"
        return
    cut_s = original["duration_s"] - variant["duration_s"]
    late_s = cut_s if name == "begins" else 0.0
    known = list(_serious(original))
    found = [_later(one, late_s) for one in _serious(variant)]
    for one in found:
        if not any(_is_same(one, other) for other in known):
            yield f"+ {_words(one)}"
    for one in known:
        is_kept = one["from_s"] >= late_s + (SETTLED_S if late_s else 0.0)
        is_kept &= one["to_s"] <= late_s + variant["duration_s"]
        if is_kept and not any(_is_same(one, other) for other in found):
            yield f"- {_words(one)}"
    if SUBJECTS.get(name) in variant["looked_at"]:
        yield f"? {SUBJECTS[name]}"


def _serious(found: Document) -> Iterator[Document]:
    return (one for one in found["findings"] if one["severity"] in SERIOUS)


def _later(one: Document, late_s: float) -> Document:
    return {**one, "from_s": one["from_s"] + late_s, "to_s": one["to_s"] + late_s}


def _is_same(one: Document, other: Document) -> bool:
    """Whether two findings tell the same of the same sensor at about the same time."""
    sensors = [{each["sensor"]["number"], *each["sensor"]["others"]} for each in (one, other)]
    return (
        one["kind"] == other["kind"]
        and bool(sensors[0] & sensors[1])
        and one["from_s"] <= other["to_s"] + SLACK_S
        and other["from_s"] <= one["to_s"] + SLACK_S
    )


def _words(one: Document) -> str:
    times = f"{one['from_s']:.1f} to {one['to_s']:.1f} s"
    return f"{one['severity']}: {times}: {one['source']}: {one['text']} ({one['evidence']})"


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG")
    parser.add_argument("--only", default="", metavar="PATTERN", help="variants by name")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every document, one per line")
    args = parser.parse_args()
    failures = 0
    for path in args.logs:
        log = log_of(path.name, path.read_bytes())
        original = reviewed(log, path.stem)
        _keep(args.json, path, "", original)
        if "failure" in original:
            failures += 1
            print(f"{path}: {original['failure']}")
            continue
        print(f"{path}: {original['verdict']}", flush=True)
        for name, changed in variants(log):
            if not re.search(args.only, name):
                continue
            variant = reviewed(changed, path.stem)
            _keep(args.json, path, name, variant)
            failures += "failure" in variant
            verdict = variant.get("verdict", "")
            lines = list(suspects(original, variant, name))
            if lines or verdict != original["verdict"]:
                print("\n    ".join((f"  {name}: {verdict}", *lines)), flush=True)
    return 1 if failures else 0


def _keep(kept: Path | None, path: Path, name: str, found: Document) -> None:
    if kept is not None:
        with kept.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps({"log": str(path), "variant": name, **found}) + "\n")


if __name__ == "__main__":
    sys.exit(main())
