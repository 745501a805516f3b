import os
from pathlib import Path

import pytest

from h2nav.errors import BadInput
from h2nav.files.signing_keys import key_of_passphrase, read_signing_key, write_signing_key

KEY = bytes(range(32))


def key_file(folder: Path, content: bytes, mode: int = 0o600) -> Path:
    path = folder / "key"
    path.write_bytes(content)
    path.chmod(mode)
    return path


def complaint(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read_signing_key(path)
    (line,) = caught.value.lines
    assert line.startswith(f"{path}: ")
    return line


@pytest.mark.parametrize(
    "content", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n", b"\n" * 31 + b"\1"]
)
def test_a_key_is_32_bytes_or_64_digits(tmp_path, content):
    expected = content if len(content) == 32 else KEY
    assert read_signing_key(key_file(tmp_path, content)) == expected


@pytest.mark.parametrize("content", [b"", b"x" * 31, b"x" * 64, KEY + b"\n", b"ab" * 31])
def test_anything_else_is_no_key(tmp_path, content):
    assert "64 hexadecimal digits" in complaint(key_file(tmp_path, content))


def test_a_complaint_does_not_show_the_content(tmp_path):
    assert "secret" not in complaint(key_file(tmp_path, b"secret words"))


@pytest.mark.parametrize("mode", [0o600, 0o400])
def test_a_file_for_its_owner_alone_is_taken(tmp_path, mode):
    assert read_signing_key(key_file(tmp_path, KEY, mode)) == KEY


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o602, 0o610, 0o440, 0o777])
def test_a_file_that_others_can_get_at_is_refused_with_the_remedy(tmp_path, mode):
    line = complaint(key_file(tmp_path, KEY, mode))
    assert f"{mode:04o}" in line
    assert "chmod 600" in line


def test_a_credential_of_systemd_may_be_read_by_its_group(tmp_path, monkeypatch):
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    assert read_signing_key(key_file(tmp_path, KEY, 0o440)) == KEY
    assert "0444" in complaint(key_file(tmp_path, KEY, 0o444))


def test_zeros_are_no_key(tmp_path):
    assert "zeros" in complaint(key_file(tmp_path, bytes(32)))


def test_what_is_missing_or_no_file_is_told_in_one_line(tmp_path):
    assert "signing-key -o" in complaint(tmp_path / "absent")
    assert "Is a directory" in complaint(tmp_path)
    os.mkfifo(tmp_path / "fifo", 0o600)
    assert "not a regular file" in complaint(tmp_path / "fifo")


def test_a_written_key_is_read_back_and_private(tmp_path):
    path = tmp_path / "key"
    before = os.umask(0)
    try:
        write_signing_key(path, KEY)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o600
    assert read_signing_key(path) == KEY


def test_an_existing_file_is_never_overwritten(tmp_path):
    path = key_file(tmp_path, KEY)
    with pytest.raises(BadInput, match="cannot be written"):
        write_signing_key(path, b"x" * 32)
    assert read_signing_key(path) == KEY


def test_a_passphrase_makes_the_key_of_the_ground_stations():
    """SHA-256, as MAVProxy's `passphrase_to_key`; the value is that of `sha256sum`."""
    digits = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert key_of_passphrase("abc").hex() == digits


@pytest.mark.parametrize(
    ("content", "count"),
    [(b"", 0), (b"x" * 31, 31), (b"ab" * 33, 66), (b"x" * 5000, 4096)],
)
def test_the_complaint_counts_what_was_found_and_says_how_to_make_a_key(tmp_path, content, count):
    path = key_file(tmp_path, content)
    assert complaint(path) == (
        f"{path}: expected a signing key, 32 bytes or 64 hexadecimal digits, found {count} bytes "
        "of something else; make the file with `h2nav signing-key -o FILE`"
    )


def test_each_complaint_says_what_to_do(tmp_path):
    path = tmp_path / "key"
    assert complaint(path) == (
        f"{path}: the signing key cannot be read: No such file or directory; make the file with "
        "`h2nav signing-key -o FILE`, for the user that runs h2nav"
    )
    key_file(tmp_path, KEY, 0o644)
    assert complaint(path) == (
        f"{path}: the signing key has mode 0644, so others can read it; run `chmod 600 {path}`, "
        "and create a new key if others may have read it"
    )
    key_file(tmp_path, bytes(32))
    assert complaint(path).endswith("means to autopilots that signing is off; choose another")


@pytest.mark.parametrize(
    ("mode", "is_refused"), [(0o440, False), (0o460, True), (0o450, True), (0o441, True)]
)
def test_the_group_may_only_read_a_credential(tmp_path, monkeypatch, mode, is_refused):
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    path = key_file(tmp_path, KEY, mode)
    if is_refused:
        assert f"mode {mode:04o}" in complaint(path)
    else:
        assert read_signing_key(path) == KEY


def test_a_key_is_written_as_digits_and_a_line_feed(tmp_path):
    write_signing_key(tmp_path / "key", KEY)
    assert (tmp_path / "key").read_bytes() == KEY.hex().encode() + b"\n"
    with pytest.raises(BadInput) as caught:
        write_signing_key(tmp_path / "key", KEY)
    assert str(caught.value) == (
        f"{tmp_path / 'key'}: the signing key cannot be written: File exists; name a new file in "
        "a folder that you may write to"
    )
