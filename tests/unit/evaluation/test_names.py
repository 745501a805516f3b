"""Files that are scored together have names of their own."""

from pathlib import Path

import pytest

from h2nav.evaluation.names import names_of


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (("a/x.bin", "b/y.bin"), ["x", "y"]),
        (("a/x.bin", "a/x.tlog"), ["x.bin", "x.tlog"]),
        (("a/x.bin", "b/x.bin", "b/y.bin"), ["a_x.bin", "b_x.bin", "y"]),
        (("/a/x.bin", "a/../x.bin"), ["a_x.bin", "a_.._x.bin"]),
        (("a_b/x.bin", "a/b/x.bin", "/a/b/x.bin"), ["a_b_x.bin", "a_b_x.bin_1", "a_b_x.bin_2"]),
        (("a/x.bin", "a/x.bin"), ["x"]),
        ((), []),
    ],
)
def test_names(paths, names):
    assert list(names_of(map(Path, paths)).values()) == names
