"""A contradiction between velocity and attitude: since when, and what its explanations decided."""

from collections import Counter

from h2nav.integrity.causes import NOTHING, Cause, Explained

# An undecided sensor is estimated anew after a suspicion of this duration.
SUSPECTED_US = 700_000
# A contradiction of this duration is reported, with its cause.
CONTRADICTED_US = 1_000_000
# An older one is explained at this interval only: its beginning needs the most.
OLD_US = 4_000_000
OLD_SPACING_US = 1_000_000


class Contradiction:
    """Keeps the explanations of one until it is over.

    Attributes:
        explained: the latest explanation; of nothing if there is no contradiction.
        begun_us: since when it contradicts; None while it does not.
    """

    def __init__(self) -> None:
        self.explained = NOTHING
        self.begun_us: int | None = None
        self._suspected_us: int | None = None
        self._explained_us = 0
        self._decisions: Counter[Cause] = Counter()
        self._shown: dict[Cause, Explained] = {}  # the latest explanation that decided each

    def forget(self) -> None:
        """Takes that it is over."""
        self.explained = NOTHING
        self.begun_us = self._suspected_us = None
        self._decisions.clear()
        self._shown.clear()

    def take(self, t_us: int, found: Explained) -> None:
        """Takes an explanation."""
        self._explained_us, self.explained = t_us, found
        if found.is_contradiction and self.begun_us is None:
            self.begun_us = t_us
        if found.is_suspicious and self._suspected_us is None:
            self._suspected_us = t_us

    def decide(self, cause: Cause, found: Explained) -> None:
        """Takes that the latest explanation decides a cause."""
        self._decisions[cause] += 1
        self._shown[cause] = found

    def clear(self, cause: Cause) -> None:
        """Drops the decisions for a cause."""
        self._decisions.pop(cause, None)

    def shown(self, cause: Cause) -> Explained | None:
        """The latest explanation that decided a cause."""
        return self._shown.get(cause)

    @property
    def decided(self) -> Cause | None:
        """The cause decided most often since the beginning, which later windows may miss."""
        return self._decisions.most_common(1)[0][0] if self._decisions else None

    def is_due(self, t_us: int) -> bool:
        """Whether it has to be explained again."""
        is_old = self.begun_us is not None and t_us - self.begun_us > OLD_US
        return t_us - self._explained_us >= (OLD_SPACING_US if is_old else 0)

    def is_told(self, t_us: int) -> bool:
        """Whether it has lasted for long enough to be reported."""
        return self.begun_us is not None and t_us - self.begun_us >= CONTRADICTED_US

    def is_young(self, t_us: int) -> bool:
        """Whether a cause that is not decided yet may show itself."""
        return self._suspected_us is None or t_us - self._suspected_us < SUSPECTED_US

    def is_old(self, t_us: int) -> bool:
        """Whether something has been suspected for long."""
        return self._suspected_us is not None and t_us - self._suspected_us >= OLD_US
