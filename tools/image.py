"""Builds the container without Docker and tries it; what it does not hold to is printed.

A clean Debian is unpacked under the name of the image that the Dockerfile begins from; Buildah
takes the Dockerfile's steps in it, in a chroot and without a daemon. The container must hold what
its labels say and the compiled kernels, and fly the demo. Needs root, a network, some 2 minutes and
the programs buildah and mmdebstrap, but no package of Python; nothing stays behind.

Run: python3 tools/image.py
"""

import json
import re
import ssl
import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from programs import need

REPOSITORY = Path(__file__).resolve().parents[1]
NAME = "localhost/h2nav"
LIVE = ("--live", "127.0.0.1:0", "--seconds", "10")
PATIENCE_S = 120.0
# What Debian leaves out of its own slim images, and what makes unpacking quick.
SLIM = [
    *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in ("doc", "locale", "man")),
    "--dpkgopt=force-unsafe-io",
    '--aptopt=Acquire::Languages "none"',
]
IN_THE_CONTAINER = """
import getpass, json, os, shutil, h2nav
from h2nav.attitude.native import backend
print(json.dumps({"user": getpass.getuser(), "kernels": backend(), "version": h2nav.__version__,
    "writes_logs": os.access("/var/log/h2nav", os.W_OK), "start": shutil.which("start-on-blueos")}))
"""


class Images:
    """Buildah with a store of its own.

    Args:
        folder: where the store is made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._buildah = ["buildah", "--root", str(folder / "store"), "--storage-driver", "vfs"]
        self._buildah += ["--runroot", str(folder / "run")]

    def call(self, *words: str) -> str:
        """What a subcommand prints; its messages go to standard error."""
        done = subprocess.run(
            [*self._buildah, *words], check=True, stdout=subprocess.PIPE, text=True
        )
        return done.stdout.strip()

    def started(self, *words: str) -> subprocess.Popen[str]:
        """A subcommand that runs, its standard output and error to be read."""
        pipe = subprocess.PIPE
        return subprocess.Popen([*self._buildah, *words], stdout=pipe, stderr=pipe, text=True)

    def make_base(self, name: str) -> None:
        """A clean Debian under the name of an image, such as ``debian:trixie-20260918-slim``."""
        suite = name.rpartition(":")[2].partition("-")[0]
        archive = self._folder / "base.tar"
        command = ["mmdebstrap", "--variant=minbase", "--mode=root", *SLIM, suite, str(archive)]
        subprocess.run(command, check=True, stdout=sys.stderr)
        container = self.call("from", "scratch")
        self.call("add", "--quiet", container, str(archive), "/")
        self.call("commit", "--quiet", "--rm", container, name)
        archive.unlink()

    def build(self) -> None:
        """Takes the steps of the Dockerfile; `pip` trusts whom this machine trusts."""
        settings = self._folder / "pip.conf"
        settings.write_text("[global]\ncert = /etc/ssl/machine.crt\n")
        trusted = ssl.get_default_verify_paths().cafile or "/etc/ssl/certs/ca-certificates.crt"
        volumes = [f"{settings}:/etc/pip.conf:ro", f"{trusted}:/etc/ssl/machine.crt:ro"]
        words = ["build", "--isolation", "chroot", "--pull-never", "--layers=false", "--tag", NAME]
        words += [word for volume in volumes for word in ("--volume", volume)]
        print(self.call(*words, str(REPOSITORY)), file=sys.stderr)

    @contextmanager
    def container(self) -> Iterator[str]:
        """A container of the image, by its id."""
        name = self.call("from", "--pull-never", NAME)
        yield name
        self.call("rm", name)


def main() -> int:
    need("buildah", "mmdebstrap", is_root_needed=True)
    text = (REPOSITORY / "Dockerfile").read_text()
    (base,) = set(re.findall(r"^FROM (\S+)", text, re.MULTILINE))
    with tempfile.TemporaryDirectory(prefix="h2nav-image-") as folder:
        images = Images(Path(folder))
        images.make_base(base)
        images.build()
        image = json.loads(images.call("inspect", "--type", "image", NAME))["OCIv1"]["config"]
        with images.container() as name:
            run = ["run", "--isolation", "chroot", name, "--"]
            inside = json.loads(images.call(*run, "python", "-c", IN_THE_CONTAINER))
            demo = fly(images.started(*run, "h2nav", "demo", *LIVE, "--json"))
    print(json.dumps({"image": image, "inside": inside, "demo": demo}, indent=1))
    complaints = broken(image["Labels"], inside, demo)
    print("\n".join(complaints) or "the container is fine")
    return 1 if complaints else 0


def fly(demo: subprocess.Popen[str]) -> dict[str, Any]:
    """What the demo prints, and how many lines of metrics its live view had meanwhile."""
    assert demo.stderr is not None
    lines = 0
    for line in demo.stderr:
        print(line, end="", file=sys.stderr)
        if found := re.search(r"live view at (http://\S+/)", line):
            with urllib.request.urlopen(f"{found[1]}metrics", timeout=PATIENCE_S) as answer:
                lines = len(answer.read().splitlines())
            break
    printed, _ = demo.communicate(timeout=PATIENCE_S)
    return {**json.loads(printed or "{}"), "metrics_lines": lines}


def broken(labels: dict[str, str], inside: dict[str, Any], demo: dict[str, Any]) -> list[str]:
    """What the container does not hold to, one line each."""
    permissions = json.loads(labels["permissions"])
    versions = {labels["version"], labels["org.opencontainers.image.version"], inside["version"]}
    promises = {
        f"one version, found {versions}": len(versions) == 1,
        "the compiled kernels": inside["kernels"] == "native",
        "a user of its own, who may write logs": (inside["user"], inside["writes_logs"])
        == ("h2nav", True),
        "the entrypoint on BlueOS": permissions["Entrypoint"] == ["start-on-blueos"]
        and bool(inside["start"]),
        "a demo that succeeds": demo.get("ok") is True,
        "a live view with metrics": demo["metrics_lines"] > 0,
    }
    return [f"broken promise: {what}" for what, is_kept in promises.items() if not is_kept]


if __name__ == "__main__":
    sys.exit(main())
