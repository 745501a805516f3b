"""Completion for bash, zsh and fish: self-contained scripts, so that no key press starts Python."""

from collections.abc import Sequence
from shlex import quote

from h2nav.apps.command_words import CommandWords, Option, Value, WordKind

# Shared by bash and zsh; `current` is the word under the cursor.
_SHARED = """\
_h2nav_propose() {{
    local before="$1" command="" word
    shift
    for word in "$@"; do
        case "$command $word" in
        {commands}) command="${{command:+$command }}$word" ;;
        esac
    done
    case "$command|$before" in
{values}
    esac
    case "$command|$current" in
{words}
    esac
}}
"""
_BASH = """\
# Completion of h2nav for bash.
_h2nav_words() {{ compopt +o default; COMPREPLY=($(compgen -W "$*" -- "$current")); }}
_h2nav_files() {{ COMPREPLY=(); }}
_h2nav_folders() {{ compopt +o default -o dirnames; }}
_h2nav_nothing() {{ compopt +o default; }}
{shared}
_h2nav() {{
    local current="${{COMP_WORDS[COMP_CWORD]}}"
    COMPREPLY=()
    _h2nav_propose "${{COMP_WORDS[COMP_CWORD-1]}}" "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"
}}
complete -o default -F _h2nav h2nav
"""
_ZSH = """\
#compdef h2nav
# Completion of h2nav for zsh.
_h2nav_words() {{ compadd -- "$@"; }}
_h2nav_files() {{ _files; }}
_h2nav_folders() {{ _files -/; }}
_h2nav_nothing() {{ :; }}
{shared}
_h2nav() {{
    local current="${{words[CURRENT]}}"
    _h2nav_propose "${{words[CURRENT-1]}}" "${{(@)words[2,CURRENT-1]}}"
}}
if [ "${{funcstack[1]}}" = _h2nav ]; then _h2nav "$@"; else compdef _h2nav h2nav; fi
"""
_FISH = """\
# Completion of h2nav for fish.
function __h2nav_at
    set -l command ''
    for word in (commandline -opc)[2..]
        switch "$command $word"
            case {commands}
                set command (string trim "$command $word")
        end
    end
    test "$command" = "$argv[1]"
end
complete -c h2nav -f
"""


def bash_script(lines: Sequence[CommandWords]) -> str:
    """A script to source, by hand or from the folder of completions."""
    return _BASH.format(shared=_shared(lines))


def zsh_script(lines: Sequence[CommandWords]) -> str:
    """A script to source, or a file `_h2nav` in `fpath`."""
    return _ZSH.format(shared=_shared(lines))


def fish_script(lines: Sequence[CommandWords]) -> str:
    """A script to source, by hand or from the folder of completions."""
    made = [_FISH.format(commands=" ".join(map(_fish_quoted, _steps(lines))))]
    for line in lines:
        at = f'complete -c h2nav -n "__h2nav_at {_fish_quoted(line.command)}"'
        for name, summary in _below(lines, line.command).items():
            made.append(f"{at} -a {name} -d {_fish_quoted(summary)}\n")
        if line.argument.kind is not WordKind.NOTHING:
            made.append(f"{at} {_fish_value(line.argument)}\n")
        for option in line.options:
            made.append(f"{at} {_fish_option(option)}\n")
    return "".join(made)


SCRIPTS = {"bash": bash_script, "zsh": zsh_script, "fish": fish_script}


def _below(lines: Sequence[CommandWords], command: str) -> dict[str, str]:
    """The words that may follow a command, with their help."""
    prefix = f"{command} " if command else ""
    found = {}
    for line in lines:
        rest = line.command.removeprefix(prefix)
        if line.command.startswith(prefix) and rest and " " not in rest:
            found[rest] = line.summary
    return found


def _steps(lines: Sequence[CommandWords]) -> list[str]:
    """Each command before its last word, a space, and that word."""
    pairs = [line.command.rpartition(" ") for line in lines if line.command]
    return [f"{before} {word}" for before, _, word in pairs]


def _shared(lines: Sequence[CommandWords]) -> str:
    values, words = [], []
    for line in lines:
        for option in line.options:
            if option.value is not None:
                names = "|".join(quote(f"{line.command}|{name}") for name in option.names)
                values.append(f"    {names}) {_call(option.value)}; return ;;")
        names = " ".join(name for option in line.options for name in option.names)
        below = tuple(_below(lines, line.command))
        argument = Value(WordKind.WORDS, below) if below else line.argument
        words.append(f"    {quote(line.command + '|-')}*) _h2nav_words {names} ;;")
        words.append(f"    {quote(line.command + '|')}*) {_call(argument)} ;;")
    return _SHARED.format(
        commands="|".join(map(quote, _steps(lines))),
        values="\n".join(values),
        words="\n".join(words),
    )


def _call(value: Value) -> str:
    return " ".join((f"_h2nav_{value.kind.value}", *map(quote, value.words)))


def _fish_option(option: Option) -> str:
    """Its names, its value, and its help."""
    names = [
        f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names
    ]
    takes = [] if option.value is None else ["-r", _fish_value(option.value)]
    return " ".join((*names, *takes, "-d", _fish_quoted(option.summary)))


def _fish_value(value: Value) -> str:
    return {
        WordKind.NOTHING: "-f",
        WordKind.FILES: "-F",
        WordKind.FOLDERS: "-f -a '(__fish_complete_directories)'",
        WordKind.WORDS: f"-f -a {_fish_quoted(' '.join(value.words))}",
    }[value.kind]


def _fish_quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
