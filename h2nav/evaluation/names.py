"""Short names of files that are scored together, for tables and the files of their figures."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path


def names_of(paths: Iterable[Path]) -> dict[Path, str]:
    """A name for each file, once: its stem, or as much more as tells it from the others."""
    each = list(dict.fromkeys(paths))
    stems, names = Counter(path.stem for path in each), Counter(path.name for path in each)
    found: dict[str, Path] = {}
    for path in each:
        whole = "_".join(part for part in path.parts if part != path.anchor)
        longer = path.name if names[path.name] == 1 else whole
        name = path.stem if stems[path.stem] == 1 else longer
        # a_b/c and a/b/c are one text.
        found[name if name not in found else f"{name}_{len(found)}"] = path
    return {path: name for name, path in found.items()}
