"""Archives of arrays: nothing is unpacked that is no number, not asked for, or too much."""

import io
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from h2nav.errors import BadInput
from h2nav.files import npz_arrays
from h2nav.files.npz_arrays import LARGEST_BYTES, read_arrays

PIECE = bytes(1 << 20)


def header(shape: tuple[int, ...], descr: str = "<f8") -> bytes:
    stream = io.BytesIO()
    fields = {"descr": descr, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, fields)
    return stream.getvalue()


def archive(folder: Path, **members: bytes) -> Path:
    path = folder / "arrays.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as stream:
        for key, data in members.items():
            stream.writestr(f"{key}.npy", data)
    return path


def add_zeros(path: Path, key: str, mebibytes: int) -> None:
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as stream,
        stream.open(f"{key}.npy", "w", force_zip64=True) as member,
    ):
        member.write(header((mebibytes << 17,)))
        for _ in range(mebibytes):
            member.write(PIECE)


def refusal(path: Path) -> str:
    tracemalloc.start()
    try:
        with pytest.raises(BadInput) as caught:
            read_arrays(path, ("a", "b"))
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
    (line,) = caught.value.lines
    assert line.startswith(str(path))
    return line


def test_only_what_is_asked_for_is_read(tmp_path: Path) -> None:
    path = tmp_path / "arrays.npz"
    np.savez(path, a=np.arange(3.0), b=np.array(True), c=np.array([object()]))
    found = read_arrays(path, ("a", "b", "d"))
    assert found.keys() == {"a", "b"}
    assert found["a"].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_come_back_as_they_were(tmp_path: Path, order: str) -> None:
    path = tmp_path / "arrays.npz"
    array = np.asarray(np.arange(12.0).reshape(4, 3), order=order)
    np.savez_compressed(path, a=array)
    assert np.array_equal(read_arrays(path, ("a",))["a"], array)


@pytest.mark.parametrize(
    "array", [np.zeros(3, complex), np.array(["x"]), np.array([None]), np.zeros(2, "M8[s]")]
)
def test_what_is_no_number_is_refused(tmp_path: Path, array: np.ndarray) -> None:
    path = tmp_path / "arrays.npz"
    np.savez(path, a=array)
    assert "a: expected numbers, found" in refusal(path)


@pytest.mark.parametrize("shape", [(10**13, 3), (1 << 62,), (1 << 40, 1 << 40), (-1,), (-3, -3)])
def test_a_header_that_announces_more_than_there_is_is_refused(tmp_path: Path, shape) -> None:
    path = archive(tmp_path, a=header(shape) + bytes(100))
    assert "a: shorter than its header says" in refusal(path)


@pytest.mark.thorough
def test_an_archive_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    path = archive(tmp_path)
    add_zeros(path, "a", (LARGEST_BYTES >> 20) + 1)
    assert path.stat().st_size < 1 << 20
    assert "expected at most 512" in refusal(path)


@pytest.mark.parametrize(
    "data",
    [b"", b"\x93NUMPY", b"\x93NUMPY\x09\x00", header((2,))[:40], b"\x93NUMPY\x01\x00\xff\xff("],
)
def test_a_member_that_is_no_array_is_refused(tmp_path: Path, data: bytes) -> None:
    assert "not a readable archive" in refusal(archive(tmp_path, a=data))


def test_half_an_hour_of_samples_is_not_too_much_and_an_hour_is() -> None:
    """Of 14 doubles at 2 kHz."""
    bytes_per_s = 14 * 8 * 2000
    assert 1800 * bytes_per_s < LARGEST_BYTES < 3600 * bytes_per_s


@pytest.mark.parametrize(("most", "is_read"), [(2048, True), (2047, False)])
def test_what_all_arrays_that_are_asked_for_unpack_to_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, is_read: bool
) -> None:
    path = archive(tmp_path, a=header((112,)) + bytes(896), b=header((112,)) + bytes(896))
    with zipfile.ZipFile(path) as stream:
        assert sum(member.file_size for member in stream.infolist()) == 2048
    monkeypatch.setattr(npz_arrays, "LARGEST_BYTES", most)
    if is_read:
        assert read_arrays(path, ("a", "b")).keys() == {"a", "b"}
    else:
        assert refusal(path) == f"{path}: unpacks to 0 MiB; expected at most 0"
    assert read_arrays(path, ("b",)).keys() == {"b"}


@pytest.mark.parametrize(("length", "is_read"), [(12, True), (13, False)])
def test_a_member_may_be_longer_than_its_array_and_not_shorter(
    tmp_path: Path, length: int, is_read: bool
) -> None:
    """The header itself takes 128 bytes, as many as 16 numbers."""
    path = archive(tmp_path, a=header((length + 16,)) + bytes(12 * 8))
    if is_read:
        with pytest.raises(BadInput, match="not a readable archive"):  # numpy says so
            read_arrays(path, ("a",))
    else:
        assert "a: shorter than its header says" in refusal(path)


def test_a_header_of_the_second_version_is_read(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([1.5, -2.0]), version=(2, 0))
    assert read_arrays(archive(tmp_path, a=stream.getvalue()), ("a",))["a"].tolist() == [1.5, -2.0]


def test_a_file_that_cannot_be_read_says_why(tmp_path: Path) -> None:
    assert refusal(tmp_path / "none.npz").endswith("cannot be read: No such file or directory")
    assert refusal(tmp_path).endswith("cannot be read: Is a directory")
