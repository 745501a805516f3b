"""What is said where a package of an extra is missing or broken: which one, and how to get it."""

import shlex
import sys

import pytest

from h2nav.apps import extras
from h2nav.errors import BadInput


@pytest.fixture
def packages(monkeypatch, tmp_path):
    """A function: puts a module of this text where it is found."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(extras.shutil, "which", lambda name: None)
    # To look through what is installed takes a tenth of a second.
    monkeypatch.setattr(extras.importlib.metadata, "packages_distributions", dict)
    names = []

    def put(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        names.append(name)

    yield put
    for name in names:
        sys.modules.pop(name, None)


PIP = f"{shlex.quote(sys.executable)} -m pip"


def refused(*modules):
    with pytest.raises(BadInput) as caught:
        extras.require("peers", "--filter vqf", *modules)
    (line,) = caught.value.lines
    return line


def test_what_can_be_imported_is_fine(packages):
    packages("made_good", "")
    extras.require("peers", "--filter vqf", "json", "made_good", "xml.dom")
    extras.require("peers", "--filter vqf")
    assert "made_good" in sys.modules


@pytest.mark.parametrize("module", ["made_absent", "made_absent.part"])
def test_a_missing_package_is_named_with_its_extra(packages, module):
    assert refused("json", module) == (
        "--filter vqf: needs the extra peers (made_absent is not installed); remedy: "
        f"{PIP} install 'h2nav[peers]'"
    )


def test_what_a_package_lacks_itself_is_said_to_be_for_it(packages):
    packages("made_outer", "import made_absent")
    assert refused("made_outer") == (
        "--filter vqf: needs the extra peers (for made_outer: made_absent is not installed); "
        f"remedy: {PIP} install 'h2nav[peers]'"
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("raise ImportError('libfoo.so:\\n  no such file')", "made_bad: libfoo.so: no such file"),
        ("raise ImportError('made_bad is of another Python')", "made_bad is of another Python"),
    ],
)
def test_a_broken_package_is_to_be_installed_again(packages, text, reason):
    packages("made_bad", text)
    assert refused("made_bad") == (
        f"--filter vqf: needs the extra peers ({reason}); remedy: "
        f"{PIP} install --force-reinstall made_bad"
    )


def test_a_package_may_have_another_name_than_its_module(packages, monkeypatch):
    monkeypatch.setattr(
        extras.importlib.metadata,
        "packages_distributions",
        lambda: {"made_bad": ["made-project", "other"]},
    )
    packages("made_bad", "raise ImportError('made_bad: too old')")
    assert refused("made_bad").endswith("install --force-reinstall made-project")


@pytest.mark.parametrize(
    ("found", "pip"),
    [
        ("/venv/bin/pip", "pip"),
        ("/usr/bin/pip", "'/venv/bin/the python' -m pip"),
        (None, "'/venv/bin/the python' -m pip"),
    ],
)
def test_the_pip_is_the_one_of_this_interpreter(packages, monkeypatch, found, pip):
    monkeypatch.setattr(extras.sys, "executable", "/venv/bin/the python")
    monkeypatch.setattr(extras.shutil, "which", lambda name: found)
    assert refused("made_absent").endswith(f"remedy: {pip} install 'h2nav[peers]'")


def test_for_another_process_packages_are_looked_for_and_not_loaded(packages):
    packages("made_unloaded", "raise ImportError")
    extras.require_installed("live", "live.address", "made_unloaded", "json")
    assert "made_unloaded" not in sys.modules
    with pytest.raises(BadInput) as caught:
        extras.require_installed("live", "live.address", "json", "made_absent")
    assert str(caught.value) == (
        "live.address: needs the extra live (made_absent is not installed); remedy: "
        f"{PIP} install 'h2nav[live]'"
    )
