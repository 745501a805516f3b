"""A digest of the program: results of another digest may differ for the same flight."""

import hashlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from h2nav.files import gain_files

# Code and page templates. Compiled kernels are left out: they give the same bits as the Python
# ones, and not every worker has them.
_SUFFIXES = frozenset({".py", ".js", ".css", ".html"})


def program_digest() -> str:
    """Digest of the code and gains of this h2nav, hexadecimal."""
    return digest_of(Path(str(resources.files("h2nav"))), gain_files.shipped())


def digest_of(package: Path, gains: Mapping[str, Path]) -> str:
    """Digest of a package's code and of gain files by name, independent of their location."""
    code = {str(p.relative_to(package)): p for p in package.rglob("*") if p.suffix in _SUFFIXES}
    digest = hashlib.sha256()
    for files in (code, gains):
        for name, path in sorted(files.items()):
            content = path.read_bytes()
            digest.update(f"{name}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()[:32]
