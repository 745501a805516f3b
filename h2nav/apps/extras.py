"""The optional extras of the installation, and the message where one is missing."""

import importlib
import importlib.metadata
import importlib.util
import shlex
import shutil
import sys
from pathlib import Path

from h2nav.errors import BadInput


def require(extra: str, asker: str, *modules: str) -> None:
    """Imports third-party modules before any work that needs them begins.

    Args:
        extra: of `pyproject.toml`, such as ``synthesis``.
        asker: the command or option that needs it, as typed.
        modules: to be imported, such as ``scipy.linalg``.

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
    """Checks for packages that another process will import.

    Args:
        packages: by their import names.

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
    """The package name of a module for pip."""
    package = _package(module)
    return importlib.metadata.packages_distributions().get(package, [package])[0]


def _one_line(module: str, error: ImportError) -> str:
    """The error's text with the module's name."""
    said = " ".join(str(error).split())
    return said if module in said else f"{module}: {said}"


def _pip() -> str:
    """The pip of this environment; through its interpreter if the command is another one's."""
    python = Path(sys.executable)
    found = shutil.which("pip")
    if found is not None and Path(found).parent == python.parent:
        return "pip"
    return f"{shlex.quote(str(python))} -m pip"
