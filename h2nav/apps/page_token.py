"""The token without which the page changes nothing."""

import secrets
from pathlib import Path

from h2nav.errors import BadInput
from h2nav.files.whole_file import replace_whole

SHORTEST = 16
LONGEST = 256


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


def token_in(path: Path) -> str:
    """The token of a file, which is made if it is missing.

    Raises:
        BadInput: it cannot be read or written, or holds none.
    """
    try:
        text = path.read_text(encoding="ascii").strip()
    except FileNotFoundError:
        text = new_token()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_whole(path, f"{text}\n".encode())
        except OSError as error:
            raise BadInput(f"flights.token_file: {path}: {error.strerror or error}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is no text"
        raise BadInput(f"flights.token_file: {path}: {reason}") from None
    if not SHORTEST <= len(text) <= LONGEST or not text.isprintable() or " " in text:
        raise BadInput(
            f"flights.token_file: {path}: expected {SHORTEST} to {LONGEST} letters without spaces; "
            "delete it, and a new one is made"
        )
    return text
