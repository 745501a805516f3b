"""Files that no command may trip over."""

import contextlib
import re
import resource
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from bench import H2NAV, KIB_PER_MIB, Row
from mcap.writer import Writer

REPOSITORY = Path(__file__).resolve().parents[2]
RECORDING = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
GAINS = REPOSITORY / "gains" / "mpu9250_100hz.yaml"
LONGEST_S = 25.0
POLL_S = 0.005
SMALL_FILE_BYTES = 100_000
BOMB_BYTES = 1 << 30
TOLD_BYTES = 1 << 20
MCAP_MAGIC = b"\x89MCAP0\r\n"
HEADER, CHUNK, DATA_END, FOOTER = 0x01, 0x06, 0x0F, 0x02


class FileAttack(NamedTuple):
    """A file and who has to read it.

    Attributes:
        done: in words.
        make: writes it into a folder; the words of the command that reads it.
        file_bytes: how large the files of the command may grow; None = no limit.
    """

    done: str
    make: Callable[[Path], list[str]]
    file_bytes: int | None = None


def _text(name: str, content: str, *words: str) -> Callable[[Path], list[str]]:
    def make(folder: Path) -> list[str]:
        path = folder / name
        path.write_text(content)
        return [*words, str(path)]

    return make


def _nested_aliases() -> str:
    """Seven times ten of the line before: ten million leaves in 300 bytes."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    for depth in range(1, 7):
        lines.append(f"a{depth}: &a{depth} [{', '.join([f'*a{depth - 1}'] * 10)}]")
    return "\n".join([*lines, "link: {url: *a6}"])


def _gains_with_a_list(folder: Path) -> list[str]:
    path = folder / "gains.yaml"
    path.write_text(re.sub("^kind: .*", "kind: [1, 2]", GAINS.read_text(), flags=re.MULTILINE))
    return ["certify", str(path)]


def _log_with(folder: Path, configuration: bytes, schema: bytes, words: list[str]) -> list[str]:
    path = folder / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(0, 0, "configuration.yaml", "application/yaml", configuration)
        schema_id = writer.register_schema("h2nav.Health", "jsonschema", schema)
        channel = writer.register_channel("/health", "json", schema_id)
        writer.add_message(channel, 1, b'{"state": "active"}', 1)
        writer.finish()
    return [word.replace("LOG", str(path)).replace("DIR", str(folder)) for word in words]


def _configuration_in_latin_1(folder: Path) -> list[str]:
    return _log_with(folder, b"link: {url: '\xe9'}", b"{}", ["replay", "LOG", "--no-log"])


def _schema_of_nonsense(folder: Path) -> list[str]:
    words = ["log", "export", "LOG", "-o", "DIR/csv"]
    return _log_with(folder, b"{}", b'{"properties": [1, 2]}', words)


def _complex_trial(folder: Path) -> list[str]:
    rows = np.ones((300, 3))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (300, 1))
    np.savez(folder / "trial.npz", fs=100.0 + 1.0j, gyr=rows, acc=rows, q=q)
    return ["evaluate", "dataset", str(folder), "--json"]


def _huge_increments(folder: Path) -> list[str]:
    path = folder / "drive.csv"
    head = "phi_left_rad,phi_right_rad,dx_m,dy_m,dtheta_rad\n"
    path.write_text(head + "1e308,1e308,1e308,1e308,1\n" * 50 + "1,2,3,4,5\n" * 50)
    return ["odometry", "calibrate", str(path), "--json"]


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _bomb(folder: Path) -> list[str]:
    """A chunk of some ten kilobytes that tells of a megabyte and unpacks to a gigabyte."""
    packer = zstandard.ZstdCompressor(level=1).compressobj(size=BOMB_BYTES)
    block = bytes(1 << 24)
    packed = b"".join(packer.compress(block) for _ in range(BOMB_BYTES >> 24)) + packer.flush()
    head = struct.pack("<QQQI", 0, 0, TOLD_BYTES, 0) + struct.pack("<I", 4) + b"zstd"
    chunk = head + struct.pack("<Q", len(packed)) + packed
    empty = struct.pack("<I", 0)
    path = folder / "bomb.mcap"
    end = _record(DATA_END, bytes(4)) + _record(FOOTER, bytes(20))
    path.write_bytes(
        MCAP_MAGIC + _record(HEADER, empty + empty) + _record(CHUNK, chunk) + end + MCAP_MAGIC
    )
    return ["log", "export", str(path), "-o", str(folder / "csv")]


def _replay_into_a_file_in_the_way(folder: Path) -> list[str]:
    (folder / "file").write_text("")
    return ["replay", str(RECORDING), "-o", str(folder / "file" / "out.mcap")]


def _replay_into_a_full_disk(folder: Path) -> list[str]:
    return ["replay", str(RECORDING), "-o", str(folder / "out.mcap")]


_CHECK = ("check-config",)
ATTACKS = {
    "D12-digits": FileAttack(
        "YAML integer of 400 digits",
        _text("c.yaml", f"autopilot: {{imu_rate_hz: {'9' * 400}}}\n", *_CHECK),
    ),
    "D12-date": FileAttack(
        "YAML date 2026-13-45", _text("c.yaml", "link: {url: 2026-13-45}\n", *_CHECK)
    ),
    "D12-aliases": FileAttack("nested YAML aliases", _text("c.yaml", _nested_aliases(), *_CHECK)),
    "D12-gains": FileAttack("gain file with a list for a number", _gains_with_a_list),
    "D12-latin-1": FileAttack("configuration in an MCAP is not UTF-8", _configuration_in_latin_1),
    "D12-schema": FileAttack("schema in an MCAP is none", _schema_of_nonsense),
    "D12-complex": FileAttack("npz trial of a complex rate", _complex_trial),
    "D12-huge": FileAttack("CSV of 1e308", _huge_increments),
    "D12-bomb": FileAttack("zstd chunk that unpacks to 1 GiB", _bomb),
    "U2-way": FileAttack("replay -o below a file", _replay_into_a_file_in_the_way),
    "U2-full": FileAttack(
        f"replay -o where files may not exceed {SMALL_FILE_BYTES} bytes",
        _replay_into_a_full_disk,
        SMALL_FILE_BYTES,
    ),
}


def attacked(name: str) -> Row:
    """Runs the command on the file."""
    attack = ATTACKS[name]
    with tempfile.TemporaryDirectory(prefix="h2nav-attack-") as folder:
        words = attack.make(Path(folder))
        start_s = time.monotonic()
        out_path, said_path = Path(folder) / "stdout", Path(folder) / "stderr"
        with out_path.open("wb") as out, said_path.open("wb") as said:
            process = subprocess.Popen([*H2NAV, *words], stdout=out, stderr=said)
            if attack.file_bytes is not None:
                limits = (attack.file_bytes, attack.file_bytes)
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, limits)
            ended, most_mib = _wait(process)
        row = Row(name, attack.done, ended)
        said_lines = said_path.read_text(errors="replace").splitlines()
        printed = out_path.read_text(errors="replace")
    if any("Traceback" in line for line in said_lines):
        row.ended += ", traceback"
    row.rss_mib = (0.0, most_mib)
    row.figures += [
        f"took {time.monotonic() - start_s:.1f} s",
        f"stderr, {len(said_lines)} lines, the last: {said_lines[-1][:160] if said_lines else ''}",
    ]
    if "NaN" in printed or "Infinity" in printed:
        row.figures.append("NaN or Infinity in its JSON")
    return row


def _wait(process: subprocess.Popen[bytes]) -> tuple[str, float]:
    """How it ended, and the most memory that it had, MiB."""
    end_s = time.monotonic() + LONGEST_S
    most_mib = 0.0
    while process.poll() is None:
        with contextlib.suppress(OSError):
            status = Path(f"/proc/{process.pid}/status").read_text()
            found = re.search(r"VmHWM:\s+(\d+)", status)
            most_mib = max(most_mib, int(found[1]) / KIB_PER_MIB if found else 0.0)
        if time.monotonic() > end_s:
            process.kill()
            process.wait()
            return f"hangs, killed after {LONGEST_S:.0f} s", most_mib
        time.sleep(POLL_S)
    return str(process.returncode), most_mib


ROWS = {name: partial(attacked, name) for name in ATTACKS}
