"""Files with a MAVLink signing key: 32 bytes or 64 hexadecimal digits, private to the owner."""

import hashlib
import os
import stat
from pathlib import Path

from h2nav.errors import BadInput
from h2nav.wire.signing import KEY_SIZE

CREDENTIALS = Path("/run/credentials")  # where systemd mounts the credentials of units

_LONGEST_FILE = 4096
_OTHERS = 0o077
_CREDENTIAL_OTHERS = 0o037  # systemd admits the unit's user by an ACL, whose mask reads as 0440


def read_signing_key(path: Path) -> bytes:
    """Reads the key from a file.

    Returns:
        32 bytes.

    Raises:
        BadInput: one line: the file cannot be read, is readable by others, or holds no key.
    """
    try:
        # A FIFO in its place must not block the start.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, "rb") as stream:
            _demand_privacy(path, os.fstat(descriptor).st_mode)
            content = stream.read(_LONGEST_FILE)
    except OSError as error:
        raise BadInput(
            f"{path}: the signing key cannot be read: {error.strerror}; "
            "make the file with `h2nav signing-key -o FILE`, for the user that runs h2nav"
        ) from None
    return _key_in(path, content)


def write_signing_key(path: Path, key: bytes) -> None:
    """Creates a file of 64 hexadecimal digits that only its owner can read.

    Raises:
        BadInput: the file exists, or cannot be created.
    """
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with open(os.open(path, flags, 0o600), "w", encoding="ascii") as stream:
            stream.write(f"{key.hex()}\n")
    except OSError as error:
        raise BadInput(
            f"{path}: the signing key cannot be written: {error.strerror}; "
            "name a new file in a folder that you may write to"
        ) from None


def key_of_passphrase(passphrase: str) -> bytes:
    """Derives the key from a passphrase as MAVProxy, Mission Planner and QGroundControl do."""
    return hashlib.sha256(passphrase.encode()).digest()


def _demand_privacy(path: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        raise BadInput(f"{path}: not a regular file; expected one with a signing key")
    others = _CREDENTIAL_OTHERS if _is_credential(path) else _OTHERS
    if mode & others:
        raise BadInput(
            f"{path}: the signing key has mode {stat.S_IMODE(mode):04o}, so others can read it; "
            f"run `chmod 600 {path}`, and create a new key if others may have read it"
        )


def _is_credential(path: Path) -> bool:
    folders = {CREDENTIALS, Path(os.environ.get("CREDENTIALS_DIRECTORY") or CREDENTIALS)}
    return any(path.absolute().is_relative_to(folder) for folder in folders)


def _key_in(path: Path, content: bytes) -> bytes:
    key = content if len(content) == KEY_SIZE else _from_digits(content)
    if key is None:
        raise BadInput(
            f"{path}: expected a signing key, {KEY_SIZE} bytes or {2 * KEY_SIZE} hexadecimal "
            f"digits, found {len(content)} bytes of something else; "
            "make the file with `h2nav signing-key -o FILE`"
        )
    if not any(key):
        raise BadInput(
            f"{path}: a key of zeros means to autopilots that signing is off; choose another"
        )
    return key


def _from_digits(content: bytes) -> bytes | None:
    try:
        key = bytes.fromhex(content.decode("ascii").strip())
    except ValueError:
        return None
    return key if len(key) == KEY_SIZE else None
