"""What is known of the daemon at present, for whoever asks."""

from h2nav.io.foxglove_messages import LogLevel


class LiveState:
    """The newest of everything that the daemon has told."""

    def take(self, topic: str, unix_ns: int, record: tuple[object, ...]) -> None:
        """A record of the log, or one of the live topics.

        Args:
            topic: such as ``/estimate``; ``/status`` (`StatusRecord`) and ``/feed`` (`FeedRecord`)
                are not in the log.
            unix_ns: host time of it.
            record: a NamedTuple of flat scalars.
        """

    def text(self, unix_ns: int, level: LogLevel, text: str) -> None:
        """A line of the program.

        Args:
            unix_ns: host time of it.
            level: how grave it is.
            text: the line.
        """
