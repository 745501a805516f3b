"""What a test needs from outside the repository, with a reason when it is absent."""

import importlib
import importlib.util
import os
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED_DATA = Path(os.environ.get("H2NAV_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
TOOLS = REPOSITORY / "tools"
DEG = 0.017453292519943295


def absent(reason: str) -> NoReturn:
    """Skips the test; where everything must be present (CI) fails it instead."""
    if os.environ.get("H2NAV_REQUIRE_ALL") == "1":
        pytest.fail(f"required here, but {reason}")
    pytest.skip(reason)


def shared_data(name: str) -> Path:
    """A file or folder of the shared test data, such as ``flights/calm.tlog``."""
    path = SHARED_DATA / name
    if not path.exists():
        absent(f"shared data {name} is absent (H2NAV_SHARED_DATA names its folder)")
    return path


def need_program(name: str) -> str:
    """The path of an optional program, such as ``qemu-system-arm``."""
    path = shutil.which(name)
    if path is None:
        absent(f"program {name} is not installed")
    return path


def need_package(name: str) -> ModuleType:
    """An optional Python package, such as ``vqf``."""
    try:
        return importlib.import_module(name)
    except ImportError:
        absent(f"package {name} is not installed")


def tool(name: str) -> ModuleType:
    """A program of tools/, such as ``benchmark/score``, to call its functions.

    Imported once in a process, as processes that it starts must find it again.
    """
    known = f"tools/{name}"
    if known not in sys.modules:
        spec = importlib.util.spec_from_file_location(known, TOOLS / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = sys.modules[known] = importlib.util.module_from_spec(spec)
        sys.path.insert(0, str(TOOLS))
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[known]
            raise
        finally:
            sys.path.remove(str(TOOLS))
    return sys.modules[known]
