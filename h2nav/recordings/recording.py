"""Opens a recording of a link: telemetry log, raw bytes, MCAP of h2nav."""

from pathlib import Path

from h2nav.errors import BadInput
from h2nav.log.magic import is_mcap
from h2nav.recordings.link_recording import BytesRecording, Recording, TlogRecording
from h2nav.wire.deframer import Deframer
from h2nav.wire.tlog import looks_like_tlog

_PROBE_BYTES = 1 << 18
# How packed files begin, and what unpacks them.
_UNPACKED_BY = {
    b"\x1f\x8b": "gunzip",
    b"PK\x03\x04": "unzip",
    b"BZh": "bunzip2",
    b"\xfd7zXZ\x00": "unxz",
    b"7z\xbc\xaf\x27\x1c": "7z x",
    b"\x28\xb5\x2f\xfd": "unzstd",
    b"Rar!": "unrar x",
}


def open_recording(path: Path | str) -> Recording:
    """Opens a recording; its content decides the kind.

    Raises:
        BadInput: there is no such file, it cannot be read, or it holds no MAVLink.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            start = stream.read(_PROBE_BYTES)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; expected a recording") from error
    if start and is_mcap(path):
        from h2nav.recordings.mcap_recording import McapRecording

        return McapRecording(path)
    for magic, program in _UNPACKED_BY.items():
        if start.startswith(magic):
            raise BadInput(f"{path}: is packed; expected a recording: unpack it, '{program} FILE'")
    if looks_like_tlog(start[:4096]):
        return TlogRecording(path)
    deframer = Deframer()
    if deframer.feed(start) or deframer.flush():
        return BytesRecording(path)
    raise BadInput(
        f"{path}: not a recording; expected a telemetry log (.tlog), raw MAVLink bytes, MCAP, "
        "or an autopilot's own log (.bin, .log, .ulg)"
    )
