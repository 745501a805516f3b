"""What can be seen of a sensor by its own values: that it stands still, shakes, or is clipped.

A sensor of three axes that gives the same three values again and again is frozen, where its message
has the resolution to show its noise. Floats do in motion: in eight flights no triple came twice; at
rest a gyro's own counts may hide its noise. Integers of 1 mrad/s and 1 mg do not: gyros gave the
same triple for 43 s on the ground, accelerometers for 1.65 s in the air. So integers count as
frozen only beside a sign of motion.
"""

import math
from enum import Enum

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.findings import Alarm, Severity
from h2nav.integrity.stuck_axis import Sensor, StuckAxes
from h2nav.maths.units import GRAVITY_M_S2

FROZEN_US = 300_000
# Of floats away from rest, which never repeat: so that a fast turn does not go on for long.
FROZEN_FINE_US = 80_000
FINE_REPEATS = 4
# Of integers, where only the flight itself is the sign of motion: 1.65 s were seen in a calm hover
# of a simulator.
FROZEN_IN_FLIGHT_US = 3_000_000
FROZEN_FINE_IN_FLIGHT_US = 1_000_000
COMPASS_FROZEN_US = 1_000_000
# Rates below this may be the dead zone of truncated integers.
DEAD_ZONE_RAD_S = 0.02
GYRO_COUNT_RAD_S = 1e-3
FORCE_COUNT_M_S2 = 1e-3 * GRAVITY_M_S2
# Less may be the gyro's bias.
TURNING_RAD_S = 0.05
# How far a vehicle has turned, by the gyro, that cannot have kept one force, or one field.
TURNED_FORCE_RAD = 0.1
TURNED_FIELD_RAD = 0.5
MOVED_M_S2 = 1.0
# Levels over 1 s: ArduPilot's figure for vibration that disturbs, and a share of samples.
WINDOW_US = 1_000_000
VIBRATION_M_S2 = 30.0
CLIPPED_SHARE = 0.02
# A burst can be made up for; a second with so many clipped samples cannot.
LOST_SHARE = 0.2


class Use(Enum):
    """What may be done with a sample."""

    ALL = "all"
    RATES = "rates"  # there is no force
    DOUBTED = "doubted"  # one of its axes is wrong: as if it were clipped
    NONE = "none"  # it says nothing of the motion


class _Triple:
    """Since when a sensor gives the same three values, and what happened meanwhile.

    Attributes:
        repeats: how often the values have come again.
        turned_rad: by which the vehicle has turned meanwhile.
    """

    def __init__(self, count: float) -> None:
        self._count = count
        self._values: Vec3 | None = None
        self._since_us = 0
        self.repeats = 0
        self._flying_us: int | None = None
        self._low, self._high = 0.0, 0.0
        self.turned_rad = 0.0

    def add(self, t_us: int, values: Vec3, turn_rad: float, force: float, is_flying: bool) -> None:
        """Takes a sample.

        Args:
            t_us: its time.
            values: of this sensor.
            turn_rad: by which the vehicle has turned since the sample before.
            force: size of the specific force, m/s^2.
            is_flying: the autopilot says so.
        """
        if values != self._values:
            self._values, self._since_us, self.turned_rad = values, t_us, turn_rad
            self._flying_us = t_us if is_flying else None
            self._low = self._high = force
            self.repeats = 0
            return
        self.repeats += 1
        if not is_flying:
            self._flying_us = None
        elif self._flying_us is None:
            self._flying_us = t_us
            self._low = self._high = force
        self.turned_rad += turn_rad
        self._low, self._high = min(self._low, force), max(self._high, force)

    def still_us(self, t_us: int) -> int:
        """For how long the values have been the same."""
        return t_us - self._since_us

    def flown_us(self, t_us: int) -> int:
        """For how long the values have been the same in flight."""
        return 0 if self._flying_us is None else t_us - self._flying_us

    def repeats_fine(self, t_us: int) -> bool:
        """Values that show every noise have come some times."""
        many = self.repeats >= FINE_REPEATS and self.still_us(t_us) >= FROZEN_FINE_US
        return many and self.is_fine

    @property
    def has_moved(self) -> bool:
        """The force has changed meanwhile, in flight."""
        return self._flying_us is not None and self._high - self._low > MOVED_M_S2

    @property
    def is_fine(self) -> bool:
        """The values are no whole numbers of counts: their message shows every noise."""
        assert self._values is not None
        for value in self._values:
            count = value / self._count
            if abs(count - round(count)) > 1e-3:
                return True
        return False

    @property
    def largest(self) -> float:
        """Of the three values."""
        assert self._values is not None
        return max(map(abs, self._values))


class SensorChecks:
    """Watches the sensors of one IMU.

    Args:
        name: of the IMU, for people.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._axes = StuckAxes()
        self._gyro = _Triple(GYRO_COUNT_RAD_S)
        self._force = _Triple(FORCE_COUNT_M_S2)
        self._field: tuple[Vec3, int] | None = None
        self._field_turned_rad = 0.0
        self._t_us: int | None = None
        self._frozen: dict[str, int] = {}
        self._levels = _Levels()
        self.field_is_frozen = False

    def add(self, sample: ImuSample, is_flying: bool) -> Use:
        """Takes a sample before the filter does; what the filter may do with it."""
        t_us = sample.t_us
        dt_s = 0.0 if self._t_us is None else min((t_us - self._t_us) * 1e-6, 0.1)
        self._t_us = t_us
        _, w_b, f_b, m_b_ut, clipped = sample
        rate = math.hypot(*w_b)
        turn_rad = dt_s * rate if rate > TURNING_RAD_S else 0.0
        force = math.hypot(*f_b)
        self._gyro.add(t_us, w_b, turn_rad, force, is_flying)
        self._force.add(t_us, f_b, turn_rad, force, is_flying)
        # A gyro that repeats itself may be frozen, and says nothing of a turn then.
        self._watch_field(t_us, m_b_ut, 0.0 if self._gyro.repeats else turn_rad)
        self._levels.add(t_us, f_b, clipped)
        # Values that have just come cannot be frozen.
        gyro = self._gyro.repeats > 0 and self._gyro_is_frozen(t_us)
        accel = self._force.repeats > 0 and self._force_is_frozen(t_us)
        if gyro or accel or self._frozen:
            self._note_frozen(t_us, gyro=gyro, accel=accel)
        if gyro:
            return Use.NONE
        stuck = self._axes.stuck_sensor(sample)
        if accel or stuck is Sensor.ACCELEROMETER:
            return Use.RATES
        return Use.DOUBTED if stuck is Sensor.GYRO else Use.ALL

    def _note_frozen(self, t_us: int, *, gyro: bool, accel: bool) -> None:
        self._frozen = {}
        if gyro and accel:
            self._frozen["imu"] = min(self._gyro.still_us(t_us), self._force.still_us(t_us))
        elif gyro:
            self._frozen["gyro"] = self._gyro.still_us(t_us)
        elif accel:
            self._frozen["accelerometer"] = self._force.still_us(t_us)

    def alarms(self) -> list[Alarm]:
        """What is wrong at present."""
        found = []
        for sensor, still_us in self._frozen.items():
            text = f"{'whole IMU' if sensor == 'imu' else sensor} is frozen"
            evidence = "the same values in every sample, while the vehicle moves"
            found.append(self._standstill(f"{sensor}_frozen", text, evidence, still_us * 1e-6))
        if self._axes.complaint and not self._frozen:
            evidence = "one value in every sample, while the other axes move"
            found.append(self._standstill("axis_stuck", self._axes.complaint, evidence, 1.0))
        if self.field_is_frozen:
            evidence = "the same field in every sample, while the vehicle turns"
            still = self._standstill("compass_frozen", "compass is frozen", evidence, 1.0)
            found.append(still._replace(severity=Severity.WARNING, degrades=False))
        return found + self._levels.alarms(self._name)

    def _standstill(self, kind: str, text: str, evidence: str, still_s: float) -> Alarm:
        return Alarm(
            kind,
            self._name,
            Severity.ERROR,
            still_s,
            "s",
            text,
            evidence,
            degrades=True,
            since_s=still_s,
        )

    def _gyro_is_frozen(self, t_us: int) -> bool:
        gyro = self._gyro
        if gyro.largest > DEAD_ZONE_RAD_S:
            return gyro.still_us(t_us) >= FROZEN_US or gyro.repeats_fine(t_us)
        if not gyro.has_moved:
            return False
        # At rest a gyro's own counts may be larger than its noise.
        least_us = FROZEN_FINE_IN_FLIGHT_US if gyro.is_fine else FROZEN_IN_FLIGHT_US
        return gyro.flown_us(t_us) >= least_us

    def _force_is_frozen(self, t_us: int) -> bool:
        force = self._force
        if force.still_us(t_us) < FROZEN_US:
            return force.repeats_fine(t_us)
        if force.turned_rad > TURNED_FORCE_RAD or force.is_fine:
            return True
        return force.flown_us(t_us) >= FROZEN_IN_FLIGHT_US

    def _watch_field(self, t_us: int, field: Vec3 | None, turn_rad: float) -> None:
        self._field_turned_rad += turn_rad
        self.field_is_frozen = False
        if field is None:
            return
        if self._field is None or field != self._field[0]:
            self._field, self._field_turned_rad = (field, t_us), 0.0
            return
        still_us = t_us - self._field[1]
        has_turned = self._field_turned_rad > TURNED_FIELD_RAD
        self.field_is_frozen = still_us > COMPASS_FROZEN_US and has_turned


class _Levels:
    """Vibration and clipping of the last full second."""

    def __init__(self) -> None:
        self._since_us: int | None = None
        self._before: Vec3 | None = None
        self._squares = [0.0, 0.0, 0.0]
        self._samples = 0
        self._clipped = 0
        self.vibration_m_s2 = 0.0
        self.clipped_share = 0.0

    def add(self, t_us: int, force: Vec3, clipped: bool) -> None:
        """Takes what concerns it of a sample."""
        x, y, z = force
        if self._before is not None:
            # Of a white noise the difference has twice the variance.
            a, b, c = self._before
            squares = self._squares
            squares[0] += 0.5 * (x - a) ** 2
            squares[1] += 0.5 * (y - b) ** 2
            squares[2] += 0.5 * (z - c) ** 2
        self._before = force
        self._samples += 1
        self._clipped += clipped
        if self._since_us is None:
            self._since_us = t_us
        if t_us - self._since_us >= WINDOW_US:
            self.vibration_m_s2 = math.sqrt(max(self._squares) / self._samples)
            self.clipped_share = self._clipped / self._samples
            self._squares = [0.0, 0.0, 0.0]
            self._samples = self._clipped = 0
            self._since_us = t_us

    def alarms(self, name: str) -> list[Alarm]:
        """What is too much, of the IMU of this name."""
        found = []
        if self.vibration_m_s2 > VIBRATION_M_S2:
            size, severity = self.vibration_m_s2, Severity.WARNING
            text = f"vibration {size:.0f} m/s2"
            evidence = f"rms of 1 s; {VIBRATION_M_S2:.0f} disturb an autopilot"
            found.append(Alarm("vibration", name, severity, size, "m/s2", text, evidence))
        if self.clipped_share > CLIPPED_SHARE:
            text = f"{self.clipped_share:.0%} of samples are clipped"
            evidence = "values at the end of the sensor's range"
            lost, size = self.clipped_share > LOST_SHARE, 100.0 * self.clipped_share
            severity = Severity.ERROR if lost else Severity.WARNING
            found.append(
                Alarm("clipping", name, severity, size, "%", text, evidence, degrades=lost)
            )
        return found
