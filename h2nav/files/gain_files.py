"""Gain files on disk: written, found by shipped name, checked for the daemon."""

import functools
import json
import math
import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

import yaml

from h2nav.attitude.gains.envelope import FORMAT, GainFile, parse_gain_file
from h2nav.attitude.gains.seal import check_seal
from h2nav.errors import BadInput
from h2nav.files.plain_yaml import parse_bytes, read_bytes, read_mapping

SUFFIX = ".yaml"
SHIPPED_RATES_HZ = (50, 100, 200, 400)
LONGEST_ROW = 600  # characters; a loop of a plant of three states with its proof takes some 500


def load(path_or_name: str | Path) -> GainFile:
    """Loads a gain file whose seal and certificate are valid.

    Args:
        path_or_name: a file, or the name of a shipped one such as ``mpu9250_100hz``.

    Raises:
        BadInput: one line per error: not found, not a gain file, changed since certification, not
            certified at all.
    """
    path = find(path_or_name)
    return _checked(read_bytes(path), str(path))


# A run over many flights asks for the same files each time.
@functools.lru_cache(maxsize=16)
def _checked(content: bytes, place: str) -> GainFile:
    file = parse_gain_file(parse_bytes(content, place), place)
    check_seal(file, place)
    return file


def read(path: Path) -> GainFile:
    """Reads a gain file's envelope without checking its certificate.

    Raises:
        BadInput: one line per error.
    """
    return parse_gain_file(read_mapping(path), str(path))


def find(path_or_name: str | Path) -> Path:
    """Finds a gain file by path or shipped name; raises BadInput if there is no such file."""
    path = Path(path_or_name)
    if path.suffix == SUFFIX or os.sep in str(path_or_name):
        if path.is_file():
            return path
        raise BadInput(f"{path}: no such gain file")
    known = shipped()
    if str(path_or_name) not in known:
        names = ", ".join(known) or "none"
        raise BadInput(
            f"gain file {path_or_name}: not shipped; expected a path ending in {SUFFIX} or one of "
            f"{names}"
        )
    return known[str(path_or_name)]


def shipped() -> dict[str, Path]:
    """Name -> path of the gain files shipped with h2nav."""
    packaged = Path(str(resources.files("h2nav"))) / "gains"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[2] / "gains"
    return {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}


def shipped_rate(rate_hz: float) -> int:
    """The nearest rate of the shipped gains; filters step with the samples' true intervals."""
    return min(SHIPPED_RATES_HZ, key=lambda shipped_hz: abs(math.log(shipped_hz / rate_hz)))


def text_of(file: GainFile) -> str:
    """The YAML text of a gain file; numbers are exact to the last bit.

    Model and gains, for people, are written as blocks; methods and certificate, for programs, as
    rows of one line per entry. The seal covers the values, so the layout does not affect it.
    """
    document = {
        "format": FORMAT,
        "kind": file.kind,
        "name": file.name,
        "rate_hz": file.rate_hz,
        "model": _plain(file.model),
        "gains": _plain(file.gains),
        "methods": _in_rows(_plain(file.methods)),
        "certificate": _in_rows(_plain(file.certificate)),
        "fixed_point": _plain(file.fixed_point),
        "made_by": file.made_by,
    }
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, width=math.inf)


def write(path: Path, file: GainFile) -> None:
    """Writes a gain file atomically; raises BadInput if the file cannot be written."""
    temporary = path.with_name(path.name + ".part")
    try:
        temporary.write_text(text_of(file), encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise BadInput(f"{path}: cannot be written: {error}") from None


class _Row(dict[str, object]):
    """A mapping written on one line."""


class _Dumper(yaml.SafeDumper):
    """Mappings in blocks and rows, lists of numbers in lines."""


def _row(dumper: yaml.SafeDumper, items: _Row) -> yaml.Node:
    return dumper.represent_mapping("tag:yaml.org,2002:map", items, flow_style=True)


def _list(dumper: yaml.SafeDumper, items: list[object]) -> yaml.Node:
    flat = not any(isinstance(item, list | dict) for item in items)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=flat)


_Dumper.add_representer(_Row, _row)
_Dumper.add_representer(list, _list)


def _in_rows(value: object) -> object:
    """Turns the largest mappings that fit into a row into rows, within blocks."""
    if not isinstance(value, dict):
        return value
    if len(json.dumps(value)) <= LONGEST_ROW:
        return _Row(value)
    return {key: _in_rows(item) for key, item in value.items()}


def _plain(value: object) -> object:
    """Converts mappings to dicts and sequences to lists, which YAML can write."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
