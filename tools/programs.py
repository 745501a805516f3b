"""What the make targets need from this computer, and the Debian package that has it.

Each tool asks for its programs before it begins; the Makefile asks for Python itself.

Run: python3 tools/programs.py [PROGRAM ...]
"""

import importlib.util
import os
import shutil
import sys

OLDEST_PYTHON = (3, 11)
# Programs; ensurepip is a module, which Debian keeps apart from Python.
PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "buildah": "buildah",
    "ensurepip": "python3-venv",
    "gcc": "gcc libc6-dev",
    "mmdebstrap": "mmdebstrap",
    "qemu-aarch64-static": "qemu-user-static",
    "qemu-system-arm": "qemu-system-arm",
    "update-binfmts": "binfmt-support",
}


def need(*names: str, is_root_needed: bool = False) -> None:
    """Ends the process with one line that says what is missing and how to get it.

    Args:
        names: of programs in `PACKAGES`.
        is_root_needed: whether the tool unpacks systems, which only root may.
    """
    missing = [name for name in names if not is_installed(name)]
    if missing:
        packages = " ".join(PACKAGES[name] for name in missing)
        sys.exit(f"not installed: {', '.join(missing)}; apt-get install -y {packages}")
    if is_root_needed and os.geteuid() != 0:
        sys.exit("this unpacks a clean Debian, which needs root: sudo make ...")


def is_installed(name: str) -> bool:
    if name == "ensurepip":
        return importlib.util.find_spec(name) is not None
    return shutil.which(name) is not None


if __name__ == "__main__":
    if sys.version_info < OLDEST_PYTHON:
        sys.exit("h2nav needs Python 3.11 or newer; make PYTHON=python3.11")
    need(*sys.argv[1:])
