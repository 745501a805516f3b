"""Names of files as text: on Linux they may be any bytes."""


def readable(name: str) -> str:
    """A name, a path, or a text with one in it, in valid Unicode."""
    return name.encode(errors="surrogateescape").decode(errors="replace")
