"""`h2nav check-config`: what it prints, its status, and its examples."""

import json
from pathlib import Path

import pytest
from needs import REPOSITORY
from one_command import main

from h2nav.apps import live_view
from h2nav.apps.check_config import SCHEMA, checked, example, is_example
from h2nav.cli import BAD_INPUT, SUCCESS
from h2nav.errors import BadInput
from h2nav.files.signing_keys import write_signing_key


@pytest.fixture
def config(tmp_path):
    """A function: the path of a file with this text."""
    path = tmp_path / "config.yaml"

    def written(text):
        path.write_text(text)
        return path

    return written


FINE = "link: {url: udpin:0.0.0.0:14550}\n"


def test_a_fine_file_is_said_to_be_fine(config, capsys):
    path = config(FINE)
    assert main(["check-config", str(path)]) == SUCCESS
    told = capsys.readouterr()
    assert (told.out, told.err) == (f"{path}: fine\n", "")
    assert main(["check-config", str(path), "--json"]) == SUCCESS
    told = capsys.readouterr()
    assert json.loads(told.out) == {"ok": True, "errors": [], "warnings": []}
    assert told.err == ""


def test_a_warning_is_told_and_is_no_error(config, capsys):
    path = config("live: {address: 0.0.0.0:8080}\n")
    assert main(["check-config", str(path)]) == SUCCESS
    told = capsys.readouterr()
    assert told.out == f"{path}: fine\n"
    assert told.err.startswith(f"h2nav: {path}: live.address: 0.0.0.0:8080 shows attitude")
    assert main(["check-config", str(path), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert (found["ok"], found["errors"], len(found["warnings"])) == (True, [], 1)


def test_every_error_is_told_and_nothing_is_fine(config, capsys):
    path = config("output: {component_id: 1}\nflights: {fetch_log: true}\n")
    assert main(["check-config", str(path), "--json"]) == BAD_INPUT
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert (found["ok"], len(found["errors"]), found["warnings"]) == (False, 2, [])
    assert told.err == "".join(f"h2nav: {line}\n" for line in found["errors"])
    assert main(["check-config", str(path)]) == BAD_INPUT
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("is_there", "count"), [(True, 0), (False, 1)])
def test_a_device_that_is_not_there_now_is_warned_of(config, tmp_path, capsys, is_there, count):
    device = tmp_path / "tty"
    if is_there:
        device.touch()
    path = config(f"link: {{url: 'serial:{device}:921600'}}\n")
    assert main(["check-config", str(path), "--json"]) == SUCCESS
    warned = json.loads(capsys.readouterr().out)["warnings"]
    assert len(warned) == count
    assert all(f"link.url: {device}: no such device now; `h2nav setup` lists" in line for line in warned)  # fmt: skip  # noqa: E501


def test_the_key_and_the_packages_of_the_page_are_looked_for(config, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(live_view, "require_packages", lambda: asked.append(1))
    signing = f"signing: {{key_file: {tmp_path / 'key'}, state_file: {tmp_path / 'stamp'}}}\n"
    path = config(signing)
    with pytest.raises(BadInput, match=str(tmp_path / "key")):
        checked(path)
    write_signing_key(tmp_path / "key", bytes(range(32)))
    assert checked(path).signing.key_file == str(tmp_path / "key")
    assert asked == []
    assert checked(config("live: {address: 127.0.0.1:0}\n")).live.address == "127.0.0.1:0"
    assert asked == [1]


def test_an_example_refers_to_the_schema_where_that_is(capsys):
    shipped = (REPOSITORY / "configs" / "sitl.yaml").read_text()
    text = example("sitl")
    first = f"={REPOSITORY / 'configs' / SCHEMA}"
    assert first in text.splitlines()[0]
    assert text.replace(first, f"={SCHEMA}", 1) == shipped
    assert main(["check-config", "--example", "sitl"]) == SUCCESS
    assert capsys.readouterr().out == text


def test_only_a_file_without_a_change_is_an_example(tmp_path):
    path = tmp_path / "mine.yaml"
    assert not is_example(path)
    assert not is_example(tmp_path)
    path.write_text(example("sitl"))
    assert is_example(path)
    path.write_text(example("sitl") + "#\n")
    assert not is_example(path)
    path.write_bytes(b"\xff\xfe")
    assert not is_example(path)


def test_the_schema_that_is_printed_is_the_one_beside_the_examples(capsys):
    assert main(["check-config", "--schema"]) == SUCCESS
    told = capsys.readouterr().out
    assert told == Path(REPOSITORY / "configs" / SCHEMA).read_text()
