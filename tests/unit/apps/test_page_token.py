"""The token of the page, in a file."""

from pathlib import Path

import pytest

from h2nav.apps.page_token import LONGEST, SHORTEST, token_in
from h2nav.errors import BadInput


def test_a_missing_one_is_made_for_its_user_alone_and_stays(tmp_path: Path) -> None:
    path = tmp_path / "below" / "token"
    made = token_in(path)
    assert SHORTEST <= len(made) <= LONGEST
    assert path.stat().st_mode & 0o777 == 0o600
    assert token_in(path) == made
    assert token_in(tmp_path / "other") != made


@pytest.mark.parametrize("length", [SHORTEST, LONGEST])
def test_a_token_of_the_users_own_is_taken_without_its_line_break(
    length: int, tmp_path: Path
) -> None:
    (tmp_path / "token").write_text("x" * length + "\r\n")
    assert token_in(tmp_path / "token") == "x" * length


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"x" * (SHORTEST - 1),
        b"x" * (LONGEST + 1),
        b"x" * SHORTEST + b" y",
        b"x" * SHORTEST + b"\ny",
        b"x" * SHORTEST + b"\xe4",
    ],
)
def test_what_is_no_token_is_named(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "token").write_bytes(content)
    with pytest.raises(BadInput, match=r"flights\.token_file: .*/token: "):
        token_in(tmp_path / "token")


def test_a_place_that_cannot_be_written_or_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    for path in (tmp_path / "file" / "token", tmp_path):
        with pytest.raises(BadInput, match=f"flights.token_file: {path}: "):
            token_in(path)
