"""Completion, asked of the shells themselves."""

import contextlib
import io
import os
import pty
import select
import shlex
import signal
import subprocess

import pytest
from needs import need_program

from h2nav.cli import COMMANDS, GROUPS, main
from h2nav.sim.scenarios import SCENARIOS

FILES, FOLDERS, NOTHING = {"a folder/", "a file.yaml"}, {"a folder/"}, set()
CASES = {
    "": {words[0] for words in COMMANDS},
    "ru": {"run"},
    "log ": {"anonymise", "info", "recover", "export", "decode"},
    "log in": {"info"},
    "--v": {"--version"},
    "demo --scenario ": set(SCENARIOS),
    "demo --seed 3 --scenario fl": {"flight"},
    "demo --seed ": NOTHING,
    "fake-autopilot --fault gps-l": {"gps-lag@", "gps-lost@"},
    "check-config --example s": {"sitl"},
    "check-config a": {"a file.yaml", "a folder/"},
    "run --config ": FILES,
    "run -c ": FILES,
    "run --log-dir ": FOLDERS,
    "run --connect ": NOTHING,
    "run --conn": {"--connect"},
    "replay ": FILES,
    "log info --j": {"--json"},
    "completion ": {"bash", "zsh", "fish"},
    "evaluate paper --se": {"--seeds"},
}
# They print what the shell would propose, one proposal a line.
BASH = """
source "$1"; shift
compopt() { [[ "$*" = *+o* ]] && default=; [[ "$*" = *-o\\ dirnames* ]] && default=-d; :; }
default=-f
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_h2nav
if [ ${#COMPREPLY[@]} -gt 0 ]; then printf '%s\\n' "${COMPREPLY[@]}"
elif [ -n "$default" ]; then compgen $default -- "${COMP_WORDS[COMP_CWORD]}"; fi
"""
ZSH = """
compdef() { :; }
compadd() { shift; print -rl -- "$@"; }
_files() { if [ "$1" = -/ ]; then print -rl -- *(/N); else print -rl -- *(N); fi; }
source "$1"; shift
words=("$@"); CURRENT=$#
_h2nav
"""
FISH = "source $argv[1]; complete -C $argv[2]"


@pytest.fixture(scope="module", params=["bash", "zsh", "fish"])
def shell(request, tmp_path_factory):
    """A function: what a shell proposes for a line."""
    program = need_program(request.param)
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "here" / "a folder").mkdir(parents=True)
    (folder / "here" / "a file.yaml").touch()
    script = folder / "script"
    script.write_text(script_for(request.param))
    flags = {"bash": ["--norc"], "zsh": ["-f"], "fish": ["--no-config"]}[request.param]

    def proposals(line):
        words = ["h2nav", *shlex.split(line)] + ([""] if not line or line[-1] == " " else [])
        arguments = {
            "bash": [BASH, "-", str(script), *words],
            "zsh": [ZSH, "-", str(script), *words],
            "fish": [FISH, str(script), f"h2nav {line}"],
        }[request.param]
        done = subprocess.run(
            [program, *flags, "-c", *arguments],
            cwd=folder / "here",
            env={**os.environ, "HOME": str(folder)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stderr == ""
        found = {word.partition("\t")[0].replace("\\", "") for word in done.stdout.splitlines()}
        return {_as_shown(folder / "here", word) for word in found if word.startswith(words[-1])}

    return proposals


def _as_shown(folder, word):
    """Folders with a slash, as some shells show them."""
    return f"{word.rstrip('/')}/" if (folder / word).is_dir() and word else word


def script_for(shell):

    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main(["completion", shell]) == 0
    return printed.getvalue()


def test_what_is_proposed(shell):
    assert {line: shell(line) for line in CASES} == CASES


def test_every_command_and_every_group_leads_on(shell):
    for words in COMMANDS:
        assert "--help" in shell(f"{' '.join(words)} --h")
    for group in GROUPS:
        assert shell(f"{group} ") == {words[1] for words in COMMANDS if words[0] == group}


def test_bash_completes_while_one_types(tmp_path):
    script = tmp_path / "script"
    script.write_text(script_for("bash"))
    (tmp_path / "flight.mcap").touch()
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        environment = {**os.environ, "PS1": "ready> ", "TERM": "xterm"}
        os.execvpe("bash", ["bash", "--norc", "--noprofile", "-i"], environment)
    try:
        for typed, awaited in (
            (b"", "ready> "),
            (b"source ./script; PS1=a'gain> '\n", "again> "),
            (b"h2nav de\t", "h2nav demo "),
            (b"--scen\t", "--scenario "),
            (b"hov\t", "hover "),
            (b"\x15h2nav log info fl\t", "flight.mcap "),
        ):
            os.write(terminal, typed)
            shown = ""
            while awaited not in shown:
                assert select.select([terminal], [], [], 20.0)[0], shown
                shown += os.read(terminal, 65536).decode()
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(terminal)
