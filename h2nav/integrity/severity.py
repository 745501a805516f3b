"""One scale of severity for findings, notices, logs and pages."""

from enum import IntEnum


class Severity(IntEnum):
    """MAV_SEVERITY, as far as it is used. The name in lower case is the word for programs."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6

    @property
    def word(self) -> str:
        """The word for programs: ``error``."""
        return self.name.lower()

    @property
    def tag(self) -> str:
        """The word on pages."""
        return _ON_PAGES[self][0]

    @property
    def look(self) -> str:
        """The CSS class on pages."""
        return _ON_PAGES[self][1]

    @classmethod
    def of(cls, value: object) -> "Severity | None":
        """From a number or a word of any version of a log; None for anything else."""
        if isinstance(value, str):
            return next((each for each in cls if each.word == value), None)
        return next((each for each in cls if each == value), None)


_ON_PAGES = {
    Severity.CRITICAL: ("serious", "severe"),
    Severity.ERROR: ("serious", "severe"),
    Severity.WARNING: ("warning", "doubtful"),
    Severity.NOTICE: ("note", "noted"),
    Severity.INFO: ("note", "noted"),
}
