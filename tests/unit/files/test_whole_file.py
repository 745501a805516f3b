"""A power cut at any moment leaves the old content or the new one."""

import os
import stat
from pathlib import Path

import pytest

from h2nav.files.whole_file import replace_whole


@pytest.mark.parametrize("mode", [0o600, 0o640])
def test_a_file_gets_content_and_mode(tmp_path, mode):
    path = tmp_path / "a"
    path.write_bytes(b"something longer")
    replace_whole(path, b"new", mode)
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == mode
    assert list(tmp_path.iterdir()) == [path]


def test_it_is_its_owners_alone_where_nothing_is_said(tmp_path):
    replace_whole(tmp_path / "a", b"new")
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o600


def test_content_is_on_the_disk_before_its_name_and_the_name_before_it_returns(
    tmp_path, monkeypatch
):
    path, steps = tmp_path / "a", []
    path.write_bytes(b"old")
    rename = Path.rename

    def synced(descriptor):
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        steps.append("folder" if is_folder else (tmp_path / "a.new").read_bytes())

    def renamed(old, new):
        steps.append((old.name, new.name))
        return rename(old, new)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "rename", renamed)
    replace_whole(path, b"new")
    assert steps == [b"new", ("a.new", "a"), "folder"]


def test_what_an_interrupted_write_left_is_written_over(tmp_path):
    (tmp_path / "a.new").write_bytes(b"half of something longer")
    replace_whole(tmp_path / "a", b"new")
    assert (tmp_path / "a").read_bytes() == b"new"


def test_a_link_that_somebody_put_there_is_not_followed(tmp_path):
    (tmp_path / "victim").write_bytes(b"old")
    (tmp_path / "a.new").symlink_to(tmp_path / "victim")
    with pytest.raises(OSError, match=r"a\.new"):
        replace_whole(tmp_path / "a", b"new")
    assert (tmp_path / "victim").read_bytes() == b"old"


def test_no_descriptor_stays_open(tmp_path):
    before = len(os.listdir("/proc/self/fd"))
    replace_whole(tmp_path / "a", b"new")
    assert len(os.listdir("/proc/self/fd")) == before
