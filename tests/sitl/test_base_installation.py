"""The base installation: what works without any extra, and what the other commands say.

The commands run as processes whose interpreter finds the base's packages alone: all packages of
this environment that `pip install h2nav` would not bring are hidden from its path finder. A new
environment would prove the same of one list of packages, at the price of a network and a minute;
hidden packages also prove that the base needs nothing that it does not declare.
"""

import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from daemon_process import H2NAV, daemon, fake_autopilot, free_udp_port, the_log
from lanes import few_rows
from needs import REPOSITORY
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
# Read by `site` when an interpreter starts.
HIDE = """
import sys
from importlib.machinery import PathFinder

HIDDEN = {hidden!r}


class BaseFinder(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in HIDDEN else super().find_spec(name, path, target)


sys.meta_path[:] = [BaseFinder if found is PathFinder else found for found in sys.meta_path]
"""


def base_distributions() -> set[str]:
    """What the declared dependencies bring, themselves included."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    waiting = [Requirement(line) for line in project["dependencies"]]
    found: set[str] = set()
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        if name not in found and (
            requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        ):
            found.add(name)
            waiting += map(Requirement, importlib.metadata.requires(name) or [])
    return found


def foreign_modules() -> set[str]:
    """Top-level modules of this environment that the base does not bring."""
    base = base_distributions() | {"h2nav"}
    return {
        module
        for module, owners in importlib.metadata.packages_distributions().items()
        if base.isdisjoint(map(canonicalize_name, owners))
    }


def hiding(folder, hidden):
    """The environment of processes that do not find these modules."""
    (folder / "sitecustomize.py").write_text(HIDE.format(hidden=hidden))
    return {"PYTHONPATH": os.pathsep.join([str(folder), str(REPOSITORY)])}


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    hidden = foreign_modules()
    assert {"scipy", "cvxpy", "matplotlib", "clarabel", "pytest"} <= hidden
    assert hidden.isdisjoint({"numpy", "pymavlink", "mcap", "google", "h2nav"})
    return hiding(tmp_path_factory.mktemp("base"), hidden)


def h2nav(environment, *words):
    return subprocess.run(
        [*H2NAV, *map(str, words)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def result_of(environment, *words):
    done = h2nav(environment, *words)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def the_hint(environment, *words):
    """The one line of a command that lacks its extra."""
    done = h2nav(environment, *words)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    return line


def test_the_extras_are_out_of_reach(base):
    code = "import importlib.util, numpy; print(importlib.util.find_spec('scipy'))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **base},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "None\n"


@pytest.mark.thorough
def test_the_demo_and_the_log_commands(base, tmp_path):
    flown = json.loads(result_of(base, "demo", "--seconds", 5, "--log-dir", tmp_path, "--json"))
    assert flown["attitudes_sent"] > 30
    log = the_log(tmp_path)
    assert str(log) in result_of(base, "log", "info", log)
    result_of(base, "log", "export", log, "-o", tmp_path / "csv")
    assert list((tmp_path / "csv").glob("*.csv"))
    cut = tmp_path / "cut.mcap.active"
    shutil.copyfile(log, cut)
    os.truncate(cut, log.stat().st_size - 20)  # without the file's closing magic
    result_of(base, "log", "recover", cut, "-o", tmp_path / "whole.mcap")
    assert (
        json.loads(result_of(base, "replay", tmp_path / "whole.mcap", "--no-log", "--json"))[
            "imu_samples"
        ]
        > 50
    )


def test_the_daemon_and_a_fake_autopilot(base, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", base["PYTHONPATH"])
    port = free_udp_port()
    with (
        daemon("--connect", f"udpin:127.0.0.1:{port}", "--log-dir", str(tmp_path)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}"),
    ):
        running.wait_for_samples(50)
        assert running.stop() == 0
    assert the_log(tmp_path).stat().st_size > 0


def test_replay_of_a_recording(base):
    result = json.loads(result_of(base, "replay", TAKEOFF, "--no-log", "--json"))
    assert result["imu_samples"] > 1000
    assert result["rms_deg"]["tilt"] < 1.0


@pytest.mark.thorough
def test_configuration_and_gains(base, tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(result_of(base, "check-config", "--example", "ardupilot-serial"))
    assert result_of(base, "check-config", path) == f"{path}: fine\n"
    result_of(base, "export", "c", "handheld_100hz", "-o", tmp_path / "firmware")
    assert list((tmp_path / "firmware").glob("*.c"))


@pytest.mark.thorough
def test_a_trial_is_evaluated_without_the_filters_of_the_extras(base, tmp_path):
    rows = 200
    level = {"q": np.tile([1.0, 0, 0, 0], (rows, 1)), "acc": np.tile([0.0, 0, 9.81], (rows, 1))}
    np.savez(tmp_path / "rest.npz", fs=100.0, gyr=np.zeros((rows, 3)), **level)
    words = ("evaluate", "dataset", tmp_path, "--filter", "all", "--json")
    filters = json.loads(result_of(base, *words))["filters"]
    assert set(filters) == {"default", "default_fixed"}


@pytest.mark.parametrize(
    ("line", "extra", "package"),
    few_rows(
        4,
        [
            ("synthesize model.yaml --rate 100 -o gains.yaml", "synthesis", "scipy"),
            ("certify handheld_100hz", "synthesis", "scipy"),
            ("evaluate paper", "synthesis", "scipy"),
            ("evaluate dataset trials --filter paper", "synthesis", "scipy"),
            ("evaluate dataset trials --filter vqf", "peers", "vqf"),
            ("evaluate dataset trials --filter ahrs.ekf", "peers", "ahrs"),
            ("evaluate dataset trials --plots out", "plots", "matplotlib"),
            ("evaluate flights recordings --plots out", "plots", "matplotlib"),
            ("evaluate observer --plots out", "plots", "matplotlib"),
            ("odometry calibrate drive.csv --plots out", "plots", "matplotlib"),
            ("run --connect udpin:127.0.0.1:0 --live", "live", "foxglove"),
        ],
    ),
)
def test_a_missing_extra_is_one_line_with_its_remedy(base, line, extra, package):
    hint = the_hint(base, *line.split())
    assert f"needs the extra {extra} ({package} is not installed)" in hint
    assert hint.endswith(f"pip install 'h2nav[{extra}]'")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("line", "hidden", "said"),
    [
        ("synthesize model.yaml --rate 100 -o gains.yaml", "cvxpy", "(cvxpy is not installed)"),
        ("synthesize model.yaml --rate 100 -o gains.yaml", "scs", "(scs is not installed)"),
        (
            "evaluate observer --plots out",
            "kiwisolver",
            "(for matplotlib: kiwisolver is not installed)",
        ),
    ],
)
def test_half_an_extra_is_named_by_what_is_missing(tmp_path, line, hidden, said):
    assert said in the_hint(hiding(tmp_path, {hidden}), *line.split())


def test_a_broken_package_is_installed_again(tmp_path):
    """Asking for the extra would change nothing: pip believes that it is there."""
    environment = hiding(tmp_path, set())
    error = 'ImportError("libkiwi.so.1:\\ncannot open", name="kiwisolver._cext")'
    (tmp_path / "kiwisolver.py").write_text(f"raise {error}\n")
    hint = the_hint(environment, "evaluate", "observer", "--plots", "out")
    assert "(for matplotlib: kiwisolver._cext: libkiwi.so.1: cannot open)" in hint
    assert hint.endswith("pip install --force-reinstall kiwisolver")
