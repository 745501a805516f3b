"""Writes JSON that every reader accepts: numbers that are not finite become null."""

import json
import math
import sys
from typing import Any


def json_text(document: Any, indent: int | None = None) -> str:
    """Encodes a document as JSON.

    Args:
        document: mappings, sequences and scalars; NaN and the infinities become null.
        indent: spaces per level; None = one line.
    """
    return json.dumps(_finite(document), indent=indent, allow_nan=False)


def print_json(document: Any, indent: int | None = None) -> None:
    """Writes the document and a line break to standard output; see `json_text`."""
    sys.stdout.write(json_text(document, indent) + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
