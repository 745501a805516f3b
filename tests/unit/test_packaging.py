"""What an installation holds: built from the source archive, and run away from the checkout."""

import ast
import email
import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from needs import REPOSITORY, shared_data
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from h2nav import __version__

pytestmark = pytest.mark.thorough

IGNORED = shutil.ignore_patterns(
    ".git", ".venv", ".*_cache", ".hypothesis", "build", "logs", "*.egg-info", "__pycache__",
    "*.so", "*.mcap*",
)  # fmt: skip


def build(kind: str, source: Path, target: Path) -> Path:
    """What `pip` calls, without the network: the file that is built."""
    code = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", code, str(target)],
        cwd=source,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = target.iterdir()
    return path


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdist")
    shutil.copytree(REPOSITORY, folder / "tree", ignore=IGNORED)
    (folder / "out").mkdir()
    return build("sdist", folder / "tree", folder / "out")


def unpack(archive: Path, folder: Path) -> None:
    with tarfile.open(archive) as stream:
        # Python 3.11.2 (Debian 12) has no such filter and reads over the attribute.
        stream.extraction_filter = getattr(tarfile, "data_filter", None)
        stream.extractall(folder)


@pytest.fixture(scope="module")
def wheel(archive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    unpack(archive, folder)
    (folder / "out").mkdir()
    return build("wheel", folder / f"h2nav-{__version__}", folder / "out")


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Runs the command line of the wheel's content."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as stream:
        stream.extractall(folder)
    environment = {**os.environ, "PYTHONPATH": str(folder)}

    def run(*words):
        return subprocess.run(
            [sys.executable, *words],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    assert Path(run("-c", "import h2nav; print(h2nav.__file__)").strip()).is_relative_to(folder)
    return lambda *words: run("-m", "h2nav", *words)


def repository_files(*patterns):
    return {
        str(path.relative_to(REPOSITORY))
        for pattern in patterns
        for path in REPOSITORY.glob(pattern)
    }


def test_the_archive_is_enough_to_build_and_test(archive):
    with tarfile.open(archive) as stream:
        held = {name.partition("/")[2] for name in stream.getnames()}
    assert held >= repository_files(
        "h2nav/**/*.py", "h2nav/py.typed", "gains/**/*.yaml", "configs/*", "native/*.c",
        "tests/**/*.py", "tests/data/*", "tools/**/*.py", ".ci/run", "packaging/requirements.lock",
        "docs/**/*.md", "packaging/*/*", "Makefile", "setup.py", "LICENSE",
    )  # fmt: skip


def test_the_wheel_holds_every_module_and_the_data(wheel):
    with zipfile.ZipFile(wheel) as stream:
        held = set(stream.namelist())
    patterns = ("gains/**/*.yaml", "configs/*", "packaging/layouts/*", "packaging/systemd/*")
    data = {f"h2nav/{name}" for name in repository_files(*patterns)}
    modules = repository_files("h2nav/**/*.py")
    assert held >= modules | data | repository_files("h2nav/*/assets/*") | {"h2nav/py.typed"}
    kinds = (".py", ".yaml", ".json")
    wanted = {name for name in modules | data if name.endswith(kinds)}
    assert {name for name in held if name.endswith(kinds)} == wanted


def test_the_wheel_offers_its_extras(wheel):
    with zipfile.ZipFile(wheel) as stream:
        text = stream.read(f"h2nav-{__version__}.dist-info/METADATA").decode()
    metadata = email.message_from_string(text)
    assert {"synthesis", "plots", "all"} <= set(metadata.get_all("Provides-Extra"))
    wanted = [Requirement(line) for line in metadata.get_all("Requires-Dist")]
    base = {requirement.name for requirement in wanted if requirement.marker is None}
    assert base.isdisjoint({"scipy", "cvxpy", "matplotlib"})
    assert base >= {"numpy", "pymavlink", "mcap", "pyyaml"}


def test_every_declared_package_is_imported_and_the_other_way_round():
    """Of the base and of most extras; the peers are imported by name, at their filter."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    # distributed draws its dashboard with bokeh, and says so only when it is missing.
    fleet = [line for line in extras["fleet"] if Requirement(line).name != "bokeh"]
    others = (*extras["synthesis"], *extras["plots"], *extras["live"])
    lines = [*project["dependencies"], *others, *fleet]
    imported = {
        name
        for path in (REPOSITORY / "h2nav").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        for name in imported_modules(node)
    }
    foreign = {name.partition(".")[0] for name in imported} - sys.stdlib_module_names - {"h2nav"}
    # Several packages share the module google; ours is the one with google.protobuf.
    owners = importlib.metadata.packages_distributions() | {"google": ["protobuf"]}
    assert {canonicalize_name(owner) for name in foreign for owner in owners[name]} == {
        canonicalize_name(Requirement(line).name) for line in lines
    }


def imported_modules(node):
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    is_absolute = isinstance(node, ast.ImportFrom) and node.level == 0
    return [node.module] if is_absolute else []


def test_the_compiled_kernels_are_in_the_wheel(wheel):
    """Where there is a compiler; an installation without one is tried with CC=/bin/false below."""
    if shutil.which(os.environ.get("CC", "cc")) is None:
        pytest.skip("no C compiler")
    with zipfile.ZipFile(wheel) as stream:
        assert any("_native" in name for name in stream.namelist())


def test_without_a_compiler_the_wheel_is_built_all_the_same(archive, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/bin/false")
    unpack(archive, tmp_path)
    (tmp_path / "out").mkdir()
    wheel = build("wheel", tmp_path / f"h2nav-{__version__}", tmp_path / "out")
    with zipfile.ZipFile(wheel) as stream:
        held = stream.namelist()
    assert "h2nav/attitude/batch.py" in held
    assert not any("_native" in name for name in held)


def test_the_installation_finds_its_gains_and_examples(installed):
    assert f"h2nav {__version__}" in installed("--version")
    assert installed("check-config", "--example", "sitl").startswith("#")
    assert json.loads(installed("certify", "mpu9250_100hz", "--json"))


def test_the_installation_replays_a_recording(installed):
    log = shared_data("flights/takeoff_40s.tlog")
    result = json.loads(installed("replay", str(log), "--no-log", "--json"))
    assert result["imu_samples"] > 1000
    assert result["rms_deg"]["tilt"] < 1.0
