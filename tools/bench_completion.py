"""What a key press costs: our completion script in bash, against asking the command's own parser.

A completer such as argcomplete starts the program at each key and has it declare its arguments;
that alone is measured here, in one process per key as it would be. Processor times, the least of
several, both in one run.
"""

import resource
import subprocess
import sys
from collections.abc import Callable

KEYS = 200
BASH = """
eval "$1"
compopt() { :; }
COMP_WORDS=(h2nav run --li); COMP_CWORD=2
for ((key = 0; key < $2; key++)); do _h2nav; done
[ "${COMPREPLY[*]}" = --live ]
"""
PARSER = "from h2nav import cli; cli._parser(['run'])"


def processor_s(work: Callable[[], object]) -> float:
    """Of the processes that `work` starts and waits for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    words = [sys.executable, "-m", "h2nav", "completion", "bash"]
    script = subprocess.run(words, capture_output=True, text=True, check=True).stdout

    def in_bash(keys: int) -> float:
        command = ["bash", "-c", BASH if keys else 'eval "$1"', "-", script, str(keys)]
        return processor_s(lambda: subprocess.run(command, check=True))

    def by_parser() -> float:
        return processor_s(lambda: subprocess.run([sys.executable, "-c", PARSER], check=True))

    rounds = [(in_bash(KEYS) - in_bash(0), by_parser()) for _ in range(5)]
    ours_s, parser_s = (min(times) for times in zip(*rounds, strict=True))
    print(
        f"h2nav run --li<Tab>: script {1e3 * ours_s / KEYS:.1f} ms, parser {1e3 * parser_s:.0f} ms"
    )


if __name__ == "__main__":
    main()
