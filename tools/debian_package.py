"""Makes Debian packages, each in a clean Debian of its suite and architecture, and tries them.

`build` leaves dist/h2nav_VERSION~SUITE_ARCH.deb; `check` installs a package in a clean root, flies
the demo in it, installs it again, removes and purges it, and fails where something is left. An
architecture other than this computer's runs under qemu-user (packages qemu-user-static and
binfmt-support), some ten times slower. Needs root, a network and mmdebstrap.

Run: python3 tools/debian_package.py build [--suite bookworm] [--arch arm64] [--quick]
     python3 tools/debian_package.py check [--suite bookworm] [--arch arm64]
"""

import argparse
import os
import platform
import re
import ssl
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from programs import need

REPOSITORY = Path(__file__).resolve().parents[1]
SUITES = ("bookworm", "trixie")
NEEDED = "gcc,libc6-dev,python3-dev,python3-venv"
SLIM = [
    *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in ("doc", "locale", "man")),
    "--dpkgopt=force-unsafe-io",
    '--aptopt=Acquire::Languages "none"',
]
PACK = "dpkg-deb --root-owner-group {packing} --build"
SMALL, QUICK = "-Zxz -z6", "-Zzstd -z1"
# What the build reads; the rest of a checkout (.git, .venv, logs) stays outside.
SOURCES = (
    *("h2nav", "configs", "gains", "native", "packaging", "docs", "tests", "tools", ".ci"),
    *("pyproject.toml", "setup.py", "MANIFEST.in", "Makefile", "Dockerfile", ".dockerignore"),
    *("README.md", "LICENSE", "ARCHITECTURE.md", "CHANGELOG.md"),
)
# The commands of the page, with an autopilot on a pseudo-terminal; flies, upgrades over itself,
# removes, purges; the last lines say what is left.
TRIAL = """
set -eu
export DEBIAN_FRONTEND=noninteractive RUNTIME_DIRECTORY=/run/h2nav
cd /trial
{installation}
h2nav --version | grep 'native kernels'
h2nav fake-autopilot --connect pty:/dev/ttyACM0 --scenario flight --seconds 999 &
timeout 60 sh -c 'until test -e /dev/ttyACM0; do sleep 0.1; done'
h2nav setup --yes
mkdir -p $RUNTIME_DIRECTORY
h2nav run -c /etc/h2nav/config.yaml & daemon=$!
timeout 120 sh -c 'until h2nav status; do sleep 1; done'
kill $daemon; wait $daemon; kill %1
h2nav log info /var/log/h2nav/*.mcap | grep /estimate
h2nav demo --seconds {seconds}
echo '# mine' >> /etc/h2nav/config.yaml
apt-get install -y -qq --reinstall ./h2nav_*.deb
tail -n 1 /etc/h2nav/config.yaml | grep -x '# mine'
apt-get remove -y -qq h2nav
test -e /etc/h2nav/config.yaml
apt-get purge -y -qq h2nav
! getent passwd h2nav
! find / -xdev -ipath '*h2nav*' -not -path '/trial*' -not -path '/tmp/*' -not -path '/run/*' \
    -not -path '/proc/*' -not -path '/var/lib/dpkg/*' -not -path '/var/log/*' \
    -not -path '/var/cache/*' | grep .
echo 'the package is fine'
"""


def main() -> int:
    arguments = parsed()
    package = build(arguments) if arguments.what == "build" else newest(arguments)
    if arguments.what == "check":
        check(package, arguments)
    print(f"{package}: {package.stat().st_size / 1e6:.1f} MB")
    return 0


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("build", "check"))
    parser.add_argument("--suite", choices=SUITES, default=SUITES[0])
    parser.add_argument("--arch", choices=("amd64", "arm64"), default=own_architecture())
    parser.add_argument(
        "--quick", action="store_true", help="pack in a second; half as large again"
    )
    parser.add_argument("--output", type=Path, default=REPOSITORY / "dist", metavar="DIR")
    return parser.parse_args()


def own_architecture() -> str:
    return "arm64" if platform.machine() == "aarch64" else "amd64"


def build(arguments: argparse.Namespace) -> Path:
    """Builds inside a Debian that is gone afterwards."""
    arguments.output.mkdir(parents=True, exist_ok=True)
    version = re.search(r'__version__ = "(.*)"', (REPOSITORY / "h2nav/__init__.py").read_text())
    assert version is not None
    name = f"h2nav_{version[1]}~{arguments.suite}_{arguments.arch}.deb"
    packing = QUICK if arguments.quick else SMALL
    with tempfile.TemporaryDirectory(prefix="h2nav-deb-") as folder:
        archive = Path(folder) / "source.tar"
        add_source(archive)
        debian(
            arguments.suite,
            arguments.arch,
            f"--include={NEEDED}",
            f"--customize-hook=mkdir -p $1/src && tar -xf {archive} -C $1/src",
            "--customize-hook=chroot $1 sh /src/packaging/debian/make",
            # Outside, where xz is no emulated program.
            f"--customize-hook={PACK.format(packing=packing)} $1/package {folder}/h2nav.deb",
        )
        target = arguments.output / name
        target.write_bytes((Path(folder) / "h2nav.deb").read_bytes())
    return target


def add_source(archive: Path) -> None:
    """Writes what a build reads into an archive."""
    with tarfile.open(archive, "w") as stream:
        for each in SOURCES:
            stream.add(REPOSITORY / each, each, filter=is_source)


def is_source(member: tarfile.TarInfo) -> tarfile.TarInfo | None:
    is_made = member.name.endswith((".so", ".pyc")) or "__pycache__" in member.name
    return None if is_made else member


def newest(arguments: argparse.Namespace) -> Path:
    """The package that was built last for this suite and architecture."""
    pattern = f"h2nav_*~{arguments.suite}_{arguments.arch}.deb"
    found = sorted(arguments.output.glob(pattern), key=lambda path: path.stat().st_mtime)
    if not found:
        sys.exit(f"no {pattern} in {arguments.output}: build it first")
    return found[-1]


def check(package: Path, arguments: argparse.Namespace) -> None:
    seconds = 10 if arguments.arch == own_architecture() else 40
    with tempfile.TemporaryDirectory(prefix="h2nav-deb-") as folder:
        trial = Path(folder) / "trial"
        trial.write_text(TRIAL.format(seconds=seconds, installation=documented_installation()))
        debian(
            arguments.suite,
            arguments.arch,
            f"--customize-hook=mkdir $1/trial && cp {package} {trial} $1/trial",
            "--customize-hook=chroot $1 bash /trial/trial",
        )


def documented_installation() -> str:
    """The page's commands up to `h2nav setup`, which asks questions there."""
    page = (REPOSITORY / "docs" / "companion.md").read_text()
    block = re.search(r"### The Debian package\n.*?\n```\n(.*?)```", page, re.DOTALL)
    assert block is not None
    *installation, setup, status = block[1].splitlines()
    assert (setup, status) == ("h2nav setup", "h2nav status")
    return "\n".join(installation)


def make_runnable(architecture: str) -> None:
    """Lets this computer run programs of another architecture, until its next start."""
    is_foreign = architecture != own_architecture()
    emulator = ("update-binfmts", "qemu-aarch64-static") if is_foreign else ()
    need("mmdebstrap", *emulator, is_root_needed=True)
    if not is_foreign:
        return
    if not Path("/proc/sys/fs/binfmt_misc/register").exists():
        subprocess.run(
            ["mount", "-t", "binfmt_misc", "none", "/proc/sys/fs/binfmt_misc"], check=True
        )
    subprocess.run(["update-binfmts", "--enable", "qemu-aarch64"], check=True)


def debian(suite: str, architecture: str, *hooks: str) -> None:
    """A clean Debian, unpacked, used by the hooks, and thrown away."""
    make_runnable(architecture)
    trusted = ssl.get_default_verify_paths().cafile or "/etc/ssl/certs/ca-certificates.crt"
    whom_to_trust = f"--setup-hook=mkdir -p $1/etc && cp {trusted} $1/etc/machine.crt"
    pip = "printf '[global]\\ncert = /etc/machine.crt\\n' > $1/etc/pip.conf"
    words = ["mmdebstrap", "--variant=minbase", "--mode=root", f"--arch={architecture}", *SLIM]
    words += [whom_to_trust, f"--setup-hook={pip}", *hooks, suite, "/dev/null"]
    # Paths of this computer mean nothing in there.
    kept = ("PATH", "HOME", "http_proxy", "https_proxy", "no_proxy")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    subprocess.run(words, check=True, env=environment, stdout=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
