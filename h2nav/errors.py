"""The two ways in which a command fails; the command line turns them into exit statuses."""


class BadInput(Exception):
    """Input or configuration that is not usable (exit status 2).

    Args:
        *lines: one complete line per error: file, key or place, what was expected, the remedy.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__("\n".join(lines))
        self.lines = lines


class TaskFailed(Exception):
    """The input was valid, but the task did not succeed (exit status 1)."""
