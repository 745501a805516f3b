"""The extras of the installation: what a command says where the packages of one are missing."""

import importlib
import importlib.metadata
import importlib.util
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
            failed = error.name or module
            is_absent = importlib.util.find_spec(_package(failed)) is None
            reason = f"{failed} is not installed" if is_absent else _one_line(failed, error)
            if _package(failed) != _package(module):
                reason = f"for {_package(module)}: {reason}"
            what = f"'h2nav[{extra}]'" if is_absent else f"--force-reinstall {_project(failed)}"
            raise _missing(extra, asker, reason, what) from None


def require_installed(extra: str, asker: str, *packages: str) -> None:
    """The same for packages that another process will import: looks for them only.

    Args:
        extra: of `pyproject.toml`.
        asker: the command or the option that needs it, as it is typed.
        packages: by the names under which they are imported.

    Raises:
        BadInput: one of them is missing.
    """
    for package in packages:
        if importlib.util.find_spec(package) is None:
            raise _missing(extra, asker, f"{package} is not installed", f"'h2nav[{extra}]'")


def _missing(extra: str, asker: str, reason: str, what: str) -> BadInput:
    return BadInput(f"{asker}: needs the extra {extra} ({reason}); remedy: {_pip()} install {what}")


def _package(module: str) -> str:
    return module.partition(".")[0]


def _project(module: str) -> str:
    """The name under which pip knows the package of a module."""
    package = _package(module)
    return importlib.metadata.packages_distributions().get(package, [package])[0]


def _one_line(module: str, error: ImportError) -> str:
    """What the error says, with the module's name."""
    said = " ".join(str(error).split())
    return said if module in said else f"{module}: {said}"


def _pip() -> str:
    """The pip of this environment; by its interpreter where the word alone means another one."""
    python = Path(sys.executable)
    found = shutil.which("pip")
    if found is not None and Path(found).parent == python.parent:
        return "pip"
    return f"{shlex.quote(str(python))} -m pip"
