"""docs/rotations.md holds what its command prints."""

import subprocess
import sys

from needs import REPOSITORY


def test_the_documented_table_is_the_printed_one():
    printed = subprocess.run(
        [sys.executable, str(REPOSITORY / "tools" / "rotation_table.py")],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert printed in (REPOSITORY / "docs" / "rotations.md").read_text(encoding="utf-8")
