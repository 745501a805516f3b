"""What puts the daemon on a machine: lock file, container, unit, the documented commands."""

import ipaddress
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from needs import REPOSITORY, need_program
from packaging.requirements import Requirement
from packaging.version import Version

from h2nav import __version__
from h2nav.apps import configuration

LOCK = REPOSITORY / "packaging" / "requirements.lock"
DOCKERFILE = (REPOSITORY / "Dockerfile").read_text()
UNIT = (REPOSITORY / "packaging" / "systemd" / "h2nav.service").read_text()
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())
# Not of a test: they change the machine, or ask a network.
STUBBED = ("apt-get", "useradd", "systemctl", "journalctl")


def locked() -> dict[str, list[Requirement]]:
    """Package -> its lines in the lock file, hashes left out; several where Python decides."""
    found: dict[str, list[Requirement]] = {}
    for line in LOCK.read_text().splitlines():
        if re.match(r"[a-z0-9]", line):
            requirement = Requirement(line.rstrip(" \\"))
            found.setdefault(requirement.name, []).append(requirement)
    return found


@pytest.mark.parametrize(
    "declared",
    [
        *PROJECT["project"]["dependencies"],
        *PROJECT["project"]["optional-dependencies"]["live"],
        *PROJECT["build-system"]["requires"],
    ],
)
def test_the_lock_satisfies_what_is_declared(declared):
    wanted = Requirement(declared)
    for requirement in locked()[wanted.name]:
        (pin,) = requirement.specifier
        assert pin.operator == "=="
        assert wanted.specifier.contains(Version(pin.version))


def test_every_package_of_the_lock_has_hashes_and_no_place():
    text = LOCK.read_text()
    pieces = re.split(r"^(?=[a-z0-9])", text, flags=re.MULTILINE)[1:]
    assert len(pieces) == sum(map(len, locked().values()))
    assert all("--hash=sha256:" in piece for piece in pieces)
    assert "://" not in text
    assert "--index" not in text


def test_the_container_is_made_of_exact_versions():
    bases = re.findall(r"^FROM (\S+)", DOCKERFILE, re.MULTILINE)
    assert bases
    assert all(re.fullmatch(r"docker\.io/library/debian:trixie-\d{8}-slim", base) for base in bases)
    assert "--require-hashes" in DOCKERFILE
    assert "--python-version 3.11" in LOCK.read_text()


def test_the_container_is_built_from_what_is_needed():
    kept = {
        line[1:]
        for line in (REPOSITORY / ".dockerignore").read_text().splitlines()
        if line.startswith("!")
    }
    assert all((REPOSITORY / name).exists() for name in kept)
    assert kept >= {
        "h2nav",
        "configs",
        "gains",
        "native",
        "pyproject.toml",
        "setup.py",
        "README.md",
    }
    copied = re.findall(r"^COPY (\S+) ", DOCKERFILE, re.MULTILINE)
    assert set(copied) - {".", "--from=build"} <= kept
    setuptools = PROJECT["tool"]["setuptools"]
    places = [setuptools["package-dir"].get(n, n.replace(".", "/")) for n in setuptools["packages"]]
    assert [place for place in places if not any(is_in(place, name) for name in kept)] == []


def is_in(place: str, folder: str) -> bool:
    return Path(folder) in (Path(place), *Path(place).parents)


def labels() -> dict[str, str]:
    """Of the container, with what its arguments are by themselves."""
    lines = DOCKERFILE.replace("\\\n", "").splitlines()
    arguments = dict(re.findall(r"^ARG (\w+)=\"?([^\"\n]*)\"?$", DOCKERFILE, re.MULTILINE))
    words = [word for line in lines if line.startswith("LABEL ") for word in shlex.split(line)[1:]]
    return {
        key: re.sub(r"\$(\w+)", lambda found: arguments[found[1]], value)
        for key, _, value in (word.partition("=") for word in words)
    }


def test_the_container_says_which_version_it_is():
    found = labels()
    assert found["version"] == found["org.opencontainers.image.version"] == __version__
    assert found["org.opencontainers.image.licenses"] == PROJECT["project"]["license"]


def test_blueos_can_read_the_labels():
    """Their form: the README of BlueOS's repository of extensions."""
    found = labels()
    assert found["type"] in {"device-integration", "example", "theme", "tool", "other"}
    assert {"name", "email"} == set(json.loads(found["authors"])[0])
    assert {"name", "email", "about"} == set(json.loads(found["company"]))
    assert "source" in json.loads(found["links"])
    tags = json.loads(found["tags"])
    assert len(tags) <= 10
    assert all(re.fullmatch(r"[a-z0-9-]+", tag) for tag in tags)


def test_blueos_lets_the_container_do_no_more_than_it_needs():
    permissions = json.loads(labels()["permissions"])
    host = permissions["HostConfig"]
    assert set(host) == {"NetworkMode", "Binds", "CapDrop", "SecurityOpt"}
    assert host["CapDrop"] == ["ALL"]
    shipped = configuration.read(REPOSITORY / "configs" / "blueos.yaml")
    assert [bind.rpartition(":")[2] for bind in host["Binds"]] == ["/etc/h2nav", shipped.log.folder]
    page_port = shipped.live.address.rpartition(":")[2]
    ports = {f"{page_port}/tcp", f"{shipped.live.foxglove_port}/tcp"}
    assert set(permissions["ExposedPorts"]) == ports


def test_the_first_start_on_blueos_leaves_a_configuration_and_the_next_keeps_it(tmp_path):
    start = (REPOSITORY / "packaging" / "blueos" / "start").read_text()
    assert f"COPY packaging/blueos/start /opt/h2nav/bin/{entrypoint_on_blueos()}" in DOCKERFILE
    config, asked = tmp_path / "config.yaml", tmp_path / "asked"
    write_program(
        tmp_path / "h2nav",
        f'echo "$@" >> {asked}; [ "$1" = run ] || exec {sys.executable} -m h2nav "$@"',
    )
    script = start.replace("/etc/h2nav/config.yaml", str(config))
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    environment["PYTHONPATH"] = str(REPOSITORY)
    # But for the first line, which names the schema by its whole path.
    example = (REPOSITORY / "configs" / "blueos.yaml").read_text().splitlines()[1:]
    for _ in range(2):
        subprocess.run(["sh", "-c", script], env=environment, check=True)
        assert config.read_text().splitlines()[1:] == example
    started = f"run -c {config}"
    assert asked.read_text().splitlines() == ["check-config --example blueos", started, started]


def entrypoint_on_blueos() -> str:
    (word,) = json.loads(labels()["permissions"])["Entrypoint"]
    return word


@pytest.mark.parametrize("device", ["ttyAMA", "ttyS", "ttyUSB", "ttyACM", "ttyTHS"])
def test_the_unit_opens_serial_ports(device):
    assert f"DeviceAllow=char-{device} rw" in UNIT


@pytest.mark.parametrize(
    ("address", "is_allowed"),
    [
        ("192.168.1.7", True), ("10.1.2.3", True), ("172.20.0.1", True), ("169.254.7.7", True),
        ("100.64.0.1", True), ("100.127.255.254", True), ("fe80::1", True), ("fd00::1", True),
        ("100.128.0.1", False), ("8.8.8.8", False), ("2001:4860::8888", False),
    ],
)  # fmt: skip
def test_the_unit_reaches_private_networks_alone(address, is_allowed):
    lines = re.findall(r"^IPAddressAllow=(.*)$", UNIT, re.MULTILINE)
    words = [word for line in lines for word in line.split() if word != "localhost"]
    networks = [ipaddress.ip_network(word) for word in words]
    assert any(ipaddress.ip_address(address) in network for network in networks) == is_allowed
    assert "IPAddressDeny=any" in UNIT


def test_a_wrong_configuration_is_not_restarted():
    assert "RestartPreventExitStatus=2" in UNIT


def documented_commands() -> list[str]:
    """Those of an installation by hand, without `h2nav setup`."""
    text = (REPOSITORY / "docs" / "companion.md").read_text()
    section = re.search(r"### With Python alone\n(.*?)\n### ", text, re.DOTALL)
    assert section is not None
    short, by_hand = re.findall(r"\n```\n(.*?)```", section[1], re.DOTALL)
    *installation, setup = short.splitlines()
    assert setup == "h2nav setup"
    return [*installation, *by_hand.splitlines()]


def test_the_documented_commands_work_one_after_the_other(tmp_path):
    """In a folder instead of /; what changes the machine or asks a network is stood in for."""
    for name in ("etc/systemd/system", "usr/local/bin", "opt", "stubs"):
        (tmp_path / name).mkdir(parents=True)
    for name in STUBBED:
        write_program(tmp_path / "stubs" / name, f'echo {name} "$@" >> {tmp_path}/asked')
    commands = documented_commands()
    install = [i for i, command in enumerate(commands) if "/opt/h2nav/bin/pip install" in command]
    assert len(install) == 1
    commands[install[0]] = "true"
    script = re.sub(r"(?<![\w.])/(?=opt|etc|usr)", f"{tmp_path}/", "\n".join(commands))
    script = script.replace("python3 -m venv", "mkdir -p")
    write_program(
        tmp_path / "opt" / "h2nav" / "bin" / "h2nav", f'exec {sys.executable} -m h2nav "$@"'
    )
    path = f"{tmp_path}/usr/local/bin:{tmp_path}/stubs:{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-eu", "-c", script],
        cwd=REPOSITORY,
        env={**os.environ, "PATH": path, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert f"{tmp_path}/etc/h2nav/config.yaml: fine" in done.stdout
    assert (tmp_path / "etc" / "systemd" / "system" / "h2nav.service").read_text() == UNIT
    asked = (tmp_path / "asked").read_text().splitlines()
    assert [line.split()[0] for line in asked] == [
        "apt-get", "apt-get", "useradd", "systemctl", "systemctl", "journalctl",
    ]  # fmt: skip


def test_the_documented_commands_make_what_the_unit_names():
    commands = "\n".join(documented_commands())
    named = dict(re.findall(r"^(User|Group|SupplementaryGroups)=(\w+)$", UNIT, re.MULTILINE))
    assert f"--groups {named['SupplementaryGroups']}" in commands
    assert (
        named["User"] == named["Group"] == commands.split("useradd")[1].split("\n")[0].split()[-1]
    )
    program, *_, configuration = re.findall(r"^ExecStart=(.*)$", UNIT, re.MULTILINE)[0].split()
    assert program in commands
    assert configuration in commands


MAKES_A_VENV = """\
[ "$1" = -m ] || exit 0
mkdir -p .venv/bin
for name in python pip h2nav pytest; do
  printf '#!/bin/sh\necho %s "$@" >> asked\n' $name > .venv/bin/$name
  chmod +x .venv/bin/$name
done"""


def test_make_installs_what_is_missing_and_nothing_twice(tmp_path):
    make = need_program("make")
    for name in ("Makefile", "pyproject.toml", "setup.py"):
        (tmp_path / name).write_bytes((REPOSITORY / name).read_bytes())
    write_program(tmp_path / "python", MAKES_A_VENV)

    def installed_for(target: str) -> list[str]:
        """What pip is asked for in each call."""
        (tmp_path / "asked").write_text("")
        subprocess.run(
            [make, "-s", "PYTHON=./python", "EXTRAS=dev", target], cwd=tmp_path, check=True
        )
        lines = (tmp_path / "asked").read_text().splitlines()
        calls = [line.split() for line in lines if line.startswith("pip install")]
        return [words[words.index("--editable") + 1] for words in calls]

    assert installed_for("demo") == ["."]
    assert installed_for("demo") == []
    assert installed_for("test") == [".[dev]"]
    assert installed_for("demo") == []
    os.utime(tmp_path / "pyproject.toml")
    assert installed_for("test") == [".[dev]"]
    assert installed_for("demo") == []


def write_program(path: Path, line: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)
