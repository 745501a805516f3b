"""What reads files, by name: `run(target, data, folder)` lets nothing pass but what is documented.

A command may end with a status from 0 to 3, or with `BadInput` or `TaskFailed`; its `--json`
output is strict JSON. Another exception or status, or more than `LONGEST_S` of processor time is a
finding.
"""

import argparse
import contextlib
import dataclasses
import functools
import importlib
import io
import json
import os
import random
import shutil
import signal
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

import numpy as np
import yaml

from fuzz import file_seeds
from fuzz.file_mutations import mutated
from h2nav import cli
from h2nav.apps.algorithms import NAMES, algorithm
from h2nav.apps.configuration import FilterSettings
from h2nav.apps.filters import FilterFactory
from h2nav.apps.synthesize import sensor_model
from h2nav.attitude.gains.envelope import GainFile, parse_gain_file
from h2nav.attitude.gains.seal import check_seal, seal
from h2nav.errors import BadInput, TaskFailed
from h2nav.files.plain_yaml import parse_bytes
from h2nav.recordings.imported import ImportedLog
from h2nav.recordings.opening import open_flight
from h2nav.recordings.telemetry import read_context
from h2nav.synthesis.velocity_aided import checked_model

LONGEST_S = 1.0
STATUSES = (0, 1, 2, 3)
YAML_WORDS = (
    b"~", b"null", b"[]", b"{}", b"[1, 2]", b"{a: 1}", b"true", b"''", b"-1", b"0", b"1e308",
    b".nan", b".inf", b"-.inf", b"2026-13-45", b"9" * 30, b"9" * 400, b"0x_", b"1:59", b"&a", b"*a",
    b"!!int ''", b"<<:", b"? ", b"- ", b"|\n", b"\0", b"\xff", b"%YAML 1.2\n", b"---\n", b"[" * 200,
    b"nan", b"auto", b"text", b"1e-320",
)  # fmt: skip
CSV_WORDS = (
    b"nan", b"inf", b"1e308", b"-1e308", b"1e-308", b"", b'"', b"0", b"1", b",", b"\n", b"1e12",
    b"\xff", b"\0", b"9" * 400, b"time_s", b"dx_m", b"-0",
)  # fmt: skip
MCAP_WORDS = (b"zstd", b"lz4", b"json", b"protobuf", b"mavlink", b"\x89MCAP0\r\n", b"{}", b"[")


class Hang(BaseException):
    """More processor time than a file may cost; no reader catches it."""


class Target(NamedTuple):
    """Something that reads files.

    Attributes:
        seeds: sound files.
        run: reads one; raises what it finds.
        words: for the mutator.
        mend: makes checksums right again after a change, so that it is not only they that notice.
    """

    seeds: Callable[[], list[bytes]]
    run: Callable[[bytes, Path], None]
    words: tuple[bytes, ...] = ()
    mend: Callable[[bytes], bytes] = bytes


def run(target: str, data: bytes, folder: Path) -> None:
    """Gives a file to a target.

    Args:
        target: a key of `TARGETS`.
        data: the file's content.
        folder: an empty one, for the file and what is made of it; emptied again.

    Raises:
        Hang: it took longer than `LONGEST_S` of processor time.
        BaseException: anything that the target must not let out.
    """
    _warmed_up(target)
    try:
        with _bounded():
            TARGETS[target].run(data, folder)
    finally:
        for path in folder.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def case(target: str, number: int) -> bytes:
    """The file of this number: the same for everybody."""
    dice = random.Random(f"{target} {number}")
    found = TARGETS[target]
    return found.mend(mutated(dice, _seeds(target), found.words))


@functools.cache
def _seeds(target: str) -> list[bytes]:
    return TARGETS[target].seeds()


@functools.cache
def _warmed_up(target: str) -> None:
    """Sound files first: they must be read, and imports are not what a bad file costs."""
    import tempfile

    for seed in _seeds(target):
        with tempfile.TemporaryDirectory() as name:
            TARGETS[target].run(seed, Path(name))


@contextlib.contextmanager
def _bounded() -> Iterator[None]:
    def ring(*_: object) -> NoReturn:
        raise Hang(f"still at it after {LONGEST_S} s of processor time")

    can_interrupt = threading.current_thread() is threading.main_thread()
    started_s = time.process_time()
    before = signal.signal(signal.SIGVTALRM, ring) if can_interrupt else None
    if can_interrupt:
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
    try:
        yield
    finally:
        if can_interrupt:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
            signal.signal(signal.SIGVTALRM, before)
    spent_s = time.process_time() - started_s
    if spent_s > LONGEST_S:
        raise Hang(f"{spent_s:.1f} s of processor time")


def _command(file_name: str, *words: str) -> Callable[[bytes, Path], None]:
    """Runs ``h2nav WORDS``; FILE and OUT in them stand for the file and for what is written."""

    def run_command(data: bytes, folder: Path) -> None:
        path = folder / file_name
        path.write_bytes(data)
        module, arguments = _understood(words)
        places = {"FILE": os.fspath(path), "OUT": os.fspath(folder / "out")}
        given = argparse.Namespace(**{k: _placed(v, places) for k, v in arguments.items()})
        told = io.StringIO()
        with (
            contextlib.redirect_stdout(told),
            contextlib.redirect_stderr(io.StringIO()),
            contextlib.suppress(BadInput, TaskFailed),
        ):
            assert module.run(given) in STATUSES
        if "--json" in words and told.getvalue():
            json.loads(told.getvalue(), parse_constant=_no_json)

    return run_command


@functools.cache
def _understood(words: tuple[str, ...]) -> tuple[ModuleType, dict[str, Any]]:
    """The command's module and arguments; parsing them costs more than reading a small file."""
    arguments = vars(cli._parser(words).parse_args(words))
    name = cli.COMMANDS[arguments.pop("command")].module
    return importlib.import_module(f"h2nav.apps.{name}"), arguments


def _placed(value: Any, places: dict[str, str]) -> Any:
    if isinstance(value, list):
        return [_placed(item, places) for item in value]
    if isinstance(value, str | Path) and str(value) in places:
        return type(value)(places[str(value)])
    return value


def _no_json(constant: str) -> NoReturn:
    raise AssertionError(f"bare {constant} in JSON")


def _gains_with_a_fitting_seal(data: bytes, _: Path) -> None:
    """A gain file that somebody changed and sealed again, in each filter."""
    with contextlib.suppress(BadInput):
        file = _sealed(parse_gain_file(parse_bytes(data, "file"), "file"))
        check_seal(file, "file")
        for name in NAMES:
            for arithmetic in algorithm(name).makers:
                settings = FilterSettings(name=name, arithmetic=arithmetic)
                with contextlib.suppress(BadInput):
                    FilterFactory(settings, {}, {"file": file})


def _sealed(file: GainFile) -> GainFile:
    try:
        fresh = seal(file)
    except (TypeError, ValueError):
        return file
    return dataclasses.replace(file, certificate={**file.certificate, "sha256": fresh})


def _gain_file_changed_inside(data: bytes, folder: Path) -> None:
    """`certify` of what may be a sealed file, so that it looks at everything behind the seal."""
    try:
        document = parse_bytes(data, "file")
        fresh = seal(parse_gain_file(document, "file"))
        document["certificate"]["sha256"] = fresh
        data = yaml.safe_dump(document).encode()
    except (BadInput, KeyError, TypeError, ValueError):
        pass  # then as it is
    _command("gains.yaml", "certify", "FILE", "--json")(data, folder)


def _model(data: bytes, _: Path) -> None:
    with contextlib.suppress(BadInput, TaskFailed):
        mapping = parse_bytes(data, "file")
        if mapping.get("kind") in ("velocity_aided", "shaped"):
            checked_model(mapping, "file")
        else:
            sensor_model(mapping, "file")


def _attached(data: bytes, folder: Path) -> None:
    log = file_seeds.plain_mcap(data, unix_s=data[:20].decode(errors="replace"))
    _command("log.mcap", "replay", "FILE", "--no-log", "--json")(log, folder)
    log = file_seeds.plain_mcap(data)
    _command("log.mcap", "replay", "FILE", "--no-log", "--json")(log, folder)


def _one_array(data: bytes, folder: Path) -> None:
    """A sound archive in which each array in turn is this one."""
    arrays = file_seeds.trial_arrays()
    keys = (*arrays, "t", "gps")
    chosen = keys[sum(data) % len(keys)]
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(f"{chosen}.npy", data)
        for key, array in arrays.items():
            if key != chosen:
                with archive.open(f"{key}.npy", "w") as member:
                    file_seeds.np.lib.format.write_array(member, array)
    _command("trial.npz", "evaluate", "dataset", "FILE", "--json")(stream.getvalue(), folder)


_REPLAY = ("replay", "FILE", "--class", "multirotor", "--no-log", "--json")
_DATASET = ("evaluate", "dataset", "FILE", "--json")
_CALIBRATE = ("odometry", "calibrate", "FILE", "--json")
_small_gains = functools.partial(
    file_seeds.texts, "gains/multirotor_100hz.yaml", "gains/mpu9250_100hz.yaml"
)
_mend = file_seeds.with_attachment_sums


def _imported(data: bytes, folder: Path) -> None:
    """An autopilot's own log, or telemetry: its context and its events, in order."""
    path = folder / "log"
    path.write_bytes(data)
    with contextlib.suppress(BadInput):
        source = open_flight(path)
        if not isinstance(source, ImportedLog):
            read_context(source)
            return
        before_ns = 0
        for envelope, _ in source.events():
            assert envelope.t_ns >= before_ns, "time goes backwards"
            before_ns = envelope.t_ns
        for track in source.context().attitudes:
            assert np.isfinite(track.q_nb).all(), "an attitude that is no number"


LOG_WORDS = (
    b"\xa3\x95", b"\xa3\x95\x80", b"FMT, 1, 9, A, Q, B\n", b"TimeUS", b"TimeMS", b"QQQQ", b"aaaa",
    b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"\0\0\xc0\x7f", b"nan", b"-inf", b"1e400", b"ULog",
)  # fmt: skip

TARGETS: dict[str, Target] = {
    "dataflash": Target(file_seeds.dataflash_logs, _imported, LOG_WORDS),
    "dataflash as text": Target(file_seeds.dataflash_texts, _imported, LOG_WORDS),
    "ulog": Target(file_seeds.ulogs, _imported, LOG_WORDS),
    "telemetry": Target(file_seeds.tlog, _imported),
    "configuration": Target(
        functools.partial(file_seeds.texts, "configs/*.yaml"),
        _command("config.yaml", "check-config", "FILE", "--json"),
        YAML_WORDS,
    ),
    "gains": Target(_small_gains, _gains_with_a_fitting_seal, YAML_WORDS),
    "certify": Target(_small_gains, _gain_file_changed_inside, YAML_WORDS),
    "model": Target(functools.partial(file_seeds.texts, "gains/models/*.yaml"), _model, YAML_WORDS),
    "attached configuration": Target(lambda: [b"link: {}"], _attached, YAML_WORDS),
    "replay tlog": Target(file_seeds.tlog, _command("log.tlog", *_REPLAY)),
    "replay bytes": Target(file_seeds.link_bytes, _command("log.bytes", *_REPLAY)),
    "replay mcap": Target(file_seeds.mcap, _command("log.mcap", *_REPLAY), MCAP_WORDS, _mend),
    "replay into a log": Target(
        file_seeds.mcap,
        _command("log.mcap", "replay", "FILE", "--class", "multirotor", "-o", "OUT"),
        MCAP_WORDS,
        _mend,
    ),
    "log info": Target(
        file_seeds.mcap, _command("log.mcap", "log", "info", "FILE", "--json"), MCAP_WORDS, _mend
    ),
    "log info as text": Target(
        file_seeds.mcap, _command("log.mcap", "log", "info", "FILE"), MCAP_WORDS, _mend
    ),
    "log export": Target(
        file_seeds.mcap,
        _command("log.mcap", "log", "export", "FILE", "-o", "OUT", "--json"),
        MCAP_WORDS,
        _mend,
    ),
    "log recover": Target(
        file_seeds.mcap,
        _command("log.mcap", "log", "recover", "FILE", "-o", "OUT", "--json"),
        MCAP_WORDS,
        _mend,
    ),
    "trial": Target(file_seeds.npz, _command("trial.npz", *_DATASET)),
    "array of a trial": Target(file_seeds.npy, _one_array),
    "recorded trial": Target(file_seeds.mcap, _command("log.mcap", *_DATASET), MCAP_WORDS, _mend),
    "odometry table": Target(file_seeds.tables, _command("drive.csv", *_CALIBRATE), CSV_WORDS),
    "odometry table as text": Target(
        file_seeds.tables, _command("drive.csv", "odometry", "calibrate", "FILE"), CSV_WORDS
    ),
    "odometry recording": Target(file_seeds.tlog, _command("log.tlog", *_CALIBRATE)),
}
