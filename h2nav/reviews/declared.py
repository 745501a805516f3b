"""What a review knows of each kind of finding, and of each subject that it looks at.

A kind is declared once, beside the subject that finds it: its meaning, its words in the verdict,
its pictures, what it follows from. Chain, verdict, schema, cards and docs/review-findings.md are
made of these records.

Evidence is a function of the evidence below it. `FlightEvidence.of` works each one out once, when
it is first asked for: there is no order to keep.
"""

from collections.abc import Callable, Sequence
from enum import Flag, auto
from typing import Any, NamedTuple, TypeVar

from h2nav.integrity.findings import Finding, Kind
from h2nav.integrity.kinds import AnyKind, Meaning
from h2nav.reviews.flight import Flight

Value = TypeVar("Value")

# A failure this shortly before a loss of control or a crash caused it; a motor sooner.
LEADS_S, MOTOR_LEADS_S = 12.0, 5.0
# Without an estimate it is landed blindly, at 1 m/s and less.
BLIND_LEADS_S = 30.0
# A vehicle whose height is wrong climbs before it falls.
HEIGHT_LEADS_S = 60.0
# The sensors' failures that can do so, most certain first.
FAILED_SENSORS = (
    Kind.GYRO_FROZEN,
    Kind.IMU_FROZEN,
    Kind.AXIS_STUCK,
    Kind.ACCELEROMETER_FROZEN,
    Kind.GYRO_BIAS_STEP,
)


class Trait(Flag):
    """How the findings of a kind are treated."""

    NONE = 0
    INDEPENDENT = auto()  # it holds for the whole recording, and follows from nothing
    ABOUT_US = auto()  # about our own attitude, no fault of the vehicle in itself
    ABOUT_RECORDING = auto()  # about the recording, not the vehicle
    ABOUT_ESTIMATOR = auto()  # about an attitude of the autopilot
    UPSET = auto()  # a failed motor or a loss of control brings it about
    EACH = auto()  # the verdict names every one, by its number


class Brought(NamedTuple):
    """A kind that brings another one about, if it began, or went on, shortly before."""

    by: AnyKind
    lead_s: float  # how long before


class Declared(NamedTuple):
    """A kind of finding in a review."""

    kind: AnyKind
    meaning: Meaning
    # in the verdict, after "was" or "had"; empty: the finding's own text
    phrase: str | Callable[[Finding], str] = ""
    section: str = "timeline"  # of the page, with its pictures
    follows: tuple[AnyKind, ...] = ()  # sensors that were wrong, each an explanation of it
    brought: tuple[Brought, ...] = ()  # events that cause it, most certain first
    void: tuple[AnyKind, ...] = ()  # while one of these lasts, its evidence shows nothing
    traits: Trait = Trait.NONE
    shown_by: str = ""  # for docs/review-findings.md: the evidence
    limit: str = ""  # likewise: from which size on


def numbered(what: str, numbers: Sequence[int]) -> str:
    """``motor 1``, ``motors 1 and 2`` or ``compasses 1, 2 and 3``; without numbers the name."""
    if len(numbers) < 2:
        return " ".join((what, *map(str, numbers)))
    plural = f"{what}es" if what.endswith("s") else f"{what}s"
    return f"{plural} {', '.join(map(str, numbers[:-1]))} and {numbers[-1]}"


class FlightEvidence:
    """Everything that is known of one flight; nothing in it changes.

    Attributes:
        flight: the recording, our estimates and the findings in flight.
    """

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self._known: dict[Callable[..., Any], Any] = {}

    def of(self, part: "Callable[[FlightEvidence], Value]") -> Value:
        """A part of the evidence, worked out once."""
        if part not in self._known:
            self._known[part] = part(self)
        found: Value = self._known[part]
        return found


# Why a subject cannot be looked at, in a few words; empty if it can.
Need = Callable[[FlightEvidence], str]


class ReviewSubject(NamedTuple):
    """Something that a review looks at."""

    name: str  # for people
    kinds: tuple[Declared, ...]  # of its findings
    needs: tuple[Need, ...]  # all of which have to be met
    look: Callable[[FlightEvidence], list[Finding]]
    # whether its blindness is told; a detail of another subject is not
    is_told: bool = True

    def lacks(self, evidence: FlightEvidence) -> str:
        """Why it cannot be looked at; empty if it can."""
        return next(filter(None, (need(evidence) for need in self.needs)), "")
