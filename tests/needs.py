"""What a test needs from outside the repository, with a reason when it is absent."""

import importlib
import os
import shutil
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED_DATA = Path(os.environ.get("H2NAV_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
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
