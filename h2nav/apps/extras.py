"""The extras of the installation: what a command says where the packages of one are missing."""

import importlib
import shlex
import shutil
import sys
from pathlib import Path

from h2nav.errors import BadInput


def require(extra: str, asker: str, *modules: str) -> None:
    """Imports other people's modules, before any work is begun that would need them.

    Args:
        extra: of `pyproject.toml`, such as ``synthesis``.
        asker: the command or the option that needs it, as it is typed.
        modules: all that it will import, such as ``scipy.linalg``.

    Raises:
        BadInput: one of them, or a module behind it, cannot be imported.
    """
    for module in modules:
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise BadInput(
                f"{asker}: needs the extra {extra} ({_reason(module, error)}); "
                f"remedy: {_pip()} install 'h2nav[{extra}]'"
            ) from None


def _reason(module: str, error: ImportError) -> str:
    """One line that names the module that failed, and the one that was asked for."""
    said = " ".join(str(error).split())
    missing = error.name or module
    if isinstance(error, ModuleNotFoundError):
        said = f"{missing} is not installed"
    elif missing not in said:
        said = f"{missing}: {said}"
    package = module.partition(".")[0]
    return said if missing.partition(".")[0] == package else f"for {package}: {said}"


def _pip() -> str:
    """The pip of this environment; by its interpreter where the word alone means another one."""
    python = Path(sys.executable)
    found = shutil.which("pip")
    if found is not None and Path(found).parent == python.parent:
        return "pip"
    return f"{shlex.quote(str(python))} -m pip"
