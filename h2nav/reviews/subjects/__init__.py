"""What a review looks at: one module per subject, found by itself.

Each has a `SUBJECT`: its kinds of finding, what it needs, and a pure function of the evidence.
"""

import importlib
import pkgutil

from h2nav.integrity.kinds import AnyKind
from h2nav.reviews.declared import Declared, ReviewSubject


def _subjects() -> tuple[ReviewSubject, ...]:
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    found = [module.SUBJECT for module in modules if hasattr(module, "SUBJECT")]
    return tuple(sorted(found, key=_worst))


def _worst(subject: ReviewSubject) -> tuple[int, str]:
    """What can be worst is named first."""
    return min(one.meaning.worst for one in subject.kinds), subject.name


SUBJECTS = _subjects()
KINDS: dict[AnyKind, Declared] = {one.kind: one for subject in SUBJECTS for one in subject.kinds}
# Name of each kind -> the section of the page with its pictures.
SECTIONS = {kind.value: one.section for kind, one in KINDS.items()}
