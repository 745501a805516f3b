"""`h2nav signing-key`: the passphrase is asked for twice, or read from a pipe, and never shown."""

import getpass
import io
import sys

import pytest

from h2nav.cli import BAD_INPUT, SUCCESS, main
from h2nav.files.signing_keys import key_of_passphrase, read_signing_key


@pytest.fixture
def write(tmp_path, capsys, monkeypatch):
    """Runs the command with a standard input; its status and what it said."""

    def run(stdin):
        monkeypatch.setattr(sys, "stdin", stdin)
        status = main(["signing-key", "-o", str(tmp_path / "key")])
        said = capsys.readouterr()
        assert said.out == ""
        return status, said.err

    return run


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    "text", ["open sesame\n", "open sesame\r\n", "open sesame", "open sesame\nb"]
)
def test_the_first_line_of_a_pipe_is_the_passphrase(tmp_path, write, text):
    assert write(io.StringIO(text)) == (SUCCESS, f"{tmp_path / 'key'}: written\n")
    assert read_signing_key(tmp_path / "key") == key_of_passphrase("open sesame")


@pytest.mark.parametrize("text", ["", "\n", "\r\n", "\nsecond line\n"])
def test_an_empty_passphrase_makes_no_key(tmp_path, write, text):
    said = "h2nav: signing-key: the passphrase is empty; nothing was written\n"
    assert write(io.StringIO(text)) == (BAD_INPUT, said)
    assert not (tmp_path / "key").exists()


def test_what_is_no_text_makes_no_key(tmp_path, write):
    said = "h2nav: signing-key: the passphrase is no text; nothing was written\n"
    assert write(io.StringIO("\udcff\n")) == (BAD_INPUT, said)
    assert write(io.TextIOWrapper(io.BytesIO(b"\xff\n"), "utf-8")) == (BAD_INPUT, said)
    assert not (tmp_path / "key").exists()


@pytest.mark.parametrize(
    ("answers", "status", "said"),
    [
        (("a", "a"), SUCCESS, "KEY: written\n"),
        (
            ("a", "b"),
            BAD_INPUT,
            "h2nav: signing-key: the two passphrases differ; nothing was written\n",
        ),
        (("", ""), BAD_INPUT, "h2nav: signing-key: the passphrase is empty; nothing was written\n"),
    ],
)
def test_at_a_terminal_it_is_typed_twice(tmp_path, write, monkeypatch, answers, status, said):
    left, asked = list(answers), []

    def typed(prompt):
        asked.append(prompt)
        return left.pop(0)

    monkeypatch.setattr(getpass, "getpass", typed)
    assert write(Terminal("not read")) == (status, said.replace("KEY", str(tmp_path / "key")))
    assert asked == ["Passphrase: ", "Again: "]
    assert (tmp_path / "key").exists() is (status == SUCCESS)


def test_the_end_of_the_input_at_a_terminal_is_an_interrupt(tmp_path, write, monkeypatch):
    def closed(_prompt):
        raise EOFError

    monkeypatch.setattr(getpass, "getpass", closed)
    status, said = write(Terminal())
    assert status == 130
    assert "Traceback" not in said
    assert not (tmp_path / "key").exists()


def test_a_key_that_is_there_stays(tmp_path, write):
    write(io.StringIO("one\n"))
    status, said = write(io.StringIO("other\n"))
    assert status == BAD_INPUT
    assert said.startswith(
        f"h2nav: {tmp_path / 'key'}: the signing key cannot be written: File exists"
    )
    assert read_signing_key(tmp_path / "key") == key_of_passphrase("one")
