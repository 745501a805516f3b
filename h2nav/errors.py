"""The two ways a command ends badly; the command line turns them into exit statuses."""


class BadInput(Exception):
    """Input or configuration that cannot be used (exit status 2).

    Args:
        *lines: one complete line per error: file, key or place, what was expected, the remedy.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__("\n".join(lines))
        self.lines = lines


class TaskFailed(Exception):
    """The input was fine, but what was asked for did not succeed (exit status 1)."""
