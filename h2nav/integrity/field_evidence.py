"""What the field shows of an attitude: of its heading, of the gyro's turns, and of itself."""

from typing import NamedTuple

from h2nav.integrity.bent import BentAttitude
from h2nav.integrity.contradiction_alarms import field_alarm, turn_alarm
from h2nav.integrity.field_windows import FieldWindows
from h2nav.integrity.findings import Alarm
from h2nav.integrity.lasting import Lasting
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.watch import Watch

# Errors shown by measurements increase the deviations from this ratio on.
OPEN_RATIO = 0.5
# 10 s of a field that is the earth's beyond doubt confirm a heading.
CONFIRMED_RATIO = 0.5
# A field used this recently holds the heading.
FIELD_HOLDS_US = 1_000_000


class _Turn(NamedTuple):
    """The field's latest turn in space that failed."""

    in_s: int = 0
    angle_rad: float = 0.0
    is_level: bool = False  # about the vertical: by a wrong yaw rate, or iron


class FieldEvidence:
    """Tests the field of one compass.

    Attributes:
        windows: of the field.
    """

    def __init__(self, watch: Watch, strapdown: Strapdown) -> None:
        self.windows = FieldWindows(watch, strapdown)
        self._is_confirmed = False
        self._used_us: int | None = None
        self._strapdown = strapdown
        self._turn = _Turn()
        self._of_field, self._of_turn = Lasting(), Lasting()

    def forget(self) -> None:
        """Forgets what a frozen compass has shown."""
        self.windows.restart()
        self._of_field, self._of_turn = Lasting(), Lasting()

    def end_row(self, ratios: InnovationRatios) -> InnovationRatios:
        """Ends a row; returns the ratios with those of the field renewed."""
        windows = self.windows
        windows.end_row()
        (_, of_1s), (_, of_10s) = windows.turn(1), windows.turn(10)
        failed = [length_s for length_s, ratio in ((1, of_1s), (10, of_10s)) if ratio > 1.0]
        if failed:
            # Once about the vertical only, the whole contradiction is doubtful.
            is_level = self._turn.is_level or any(map(windows.turned_level, failed))
            self._turn = _Turn(failed[-1], windows.turn(failed[-1])[0], is_level)
        elif not self._of_turn.is_raised:
            self._turn = self._turn._replace(is_level=False)
        field_10s = windows.field_ratio(10)
        self._is_confirmed |= field_10s < CONFIRMED_RATIO
        return ratios._replace(
            field_1s=windows.field_ratio(1), field_10s=field_10s, turn_1s=of_1s, turn_10s=of_10s
        )

    def confirm(self) -> None:
        """Takes that velocities have confirmed the heading."""
        self._is_confirmed = True

    def use(self, t_us: int) -> None:
        """Takes that the field corrects the heading."""
        self._used_us = t_us

    def judge(self, t_us: int, ratios: InnovationRatios) -> None:
        """Takes the present ratios."""
        self._of_turn.take(t_us, ratios.of_turn)
        self._of_field.take(t_us, ratios.of_field)

    @property
    def holds(self) -> bool:
        """Whether a field corrected the heading just now."""
        now_us, used_us = self._strapdown.t_us, self._used_us
        return now_us is not None and used_us is not None and now_us - used_us < FIELD_HOLDS_US

    @property
    def fits(self) -> bool | None:
        """Whether norm and dip of the field are the earth's; None if unknown now."""
        now_us, windows = self._strapdown.t_us, self.windows
        if windows.reference is None or now_us is None or windows.is_stale(now_us):
            return None
        return windows.is_plausible

    @property
    def largest_heading_error_rad(self) -> float | None:
        """How far a heading may be off by it; None if its norm or dip are not the earth's."""
        if not self.fits:
            return None
        return abs(self.windows.heading_error_rad) + self.windows.turn_by_iron_rad

    def shown_errors(
        self, ratios: InnovationRatios, *, on_ground: bool
    ) -> tuple[list[float], list[float]]:
        """Errors of tilt and of heading that it shows now, rad."""
        windows = self.windows
        tilts, headings = [], []
        if ratios.of_turn > OPEN_RATIO:
            turn_rad = windows.turn(10)[0]
            headings.append(turn_rad)
            if not windows.turned_level(10):
                tilts.append(turn_rad)
        if self._matters(ratios, on_ground=on_ground):
            headings.append(windows.worst_heading_rad)
        elif windows.is_plausible and ratios.field_1s > OPEN_RATIO:
            headings.append(0.5 * abs(windows.heading_error_rad))
        return tilts, headings

    def unknown_heading_rad(self, ratios: InnovationRatios) -> float:
        """By how much a heading may be off that has been found by such a field, and by no other."""
        if self._is_confirmed or not self._of_field.is_raised or not ratios.of_field > 1.0:
            return 0.0
        return self.windows.turn_by_iron_rad

    def _matters(self, ratios: InnovationRatios, *, on_ground: bool) -> bool:
        """Whether, in flight, a contradicting field is in use or was never confirmed otherwise."""
        if on_ground or not self._of_field.is_raised or not ratios.of_field > 1.0:
            return False
        return self.holds or not self._is_confirmed

    def alarms(
        self, t_us: int, ratios: InnovationRatios, bent: BentAttitude, *, on_ground: bool
    ) -> list[Alarm]:
        """Its alarms at this time; an attitude that is bent explains a field of the right size."""
        found = []
        if self._of_turn.is_raised and not self._turn.is_level:
            since_s = self._of_turn.since_s(t_us)
            found.append(turn_alarm(self._turn.angle_rad, self._turn.in_s, since_s))
        turns = self._of_turn.is_raised and self._turn.is_level
        is_raised = self._of_field.is_raised or turns
        if is_raised and not (bent.is_bent(t_us) and self.windows.has_norm):
            test = self._of_field if self._of_field.is_raised else self._of_turn
            found.append(
                field_alarm(
                    self.windows,
                    (self._turn.angle_rad, self._turn.in_s) if turns else None,
                    matters=self._matters(ratios, on_ground=on_ground) or turns,
                    since_s=test.since_s(t_us),
                )
            )
        return found
