"""One flight of a campaign in numbers: every error of every sensor, and the faults.

The defaults are the nominal flight: a copter for five minutes, sensors of a good data sheet. A
draw changes them by a distribution; shrinking takes them back one after the other.
"""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from h2nav.errors import BadInput
from h2nav.files.plain_yaml import read_mapping
from h2nav.files.strict_yaml import into_record
from h2nav.sim.faults import Fault, parse_fault
from h2nav.validation import OneOf, Within

VEHICLES = ("copter", "plane", "rover")
FORMS = ("integers", "floats")
MAX_FAULTS = 3
OF_COMPASS = ("compass-", "hard-iron")  # how the faults of a compass begin

Share = Annotated[float, Within(0.0, 1.0)]
Size = Annotated[float, Within(0.0, 1e4)]


@dataclass(frozen=True)
class FlightDraw:
    """Vehicle, place and motion."""

    vehicle: Annotated[str, OneOf(VEHICLES)] = "copter"
    length_min: Annotated[float, Within(1.0, 240.0)] = 5.0
    rest_s: Annotated[float, Within(5.0, 600.0)] = 20.0  # on the ground before the flight
    manoeuvre_m_s2: Annotated[float, Within(0.1, 15.0)] = 2.0  # acceleration of brisk parts
    brisk_share: Share = 0.4  # of the parts of the flight; the others are calm
    wind_m_s: Annotated[float, Within(0.0, 30.0)] = 3.0
    gust_m_s: Annotated[float, Within(0.0, 10.0)] = 0.5  # deviation of the wind
    latitude_deg: Annotated[float, Within(-65.0, 65.0)] = 47.0


@dataclass(frozen=True)
class ImuDraw:
    """IMUs and how they reach the link."""

    count: Annotated[int, Within(1, 3)] = 1
    rate_hz: Annotated[float, Within(25.0, 250.0)] = 100.0
    form: Annotated[str, OneOf(FORMS)] = "floats"  # RAW_IMU, SCALED_IMU2, 3; or HIGHRES_IMU
    jitter_ms: Annotated[float, Within(0.0, 20.0)] = 0.2  # of the time stamps
    delay_ms: Annotated[float, Within(0.0, 100.0)] = 11.0  # age of the values at their stamps
    vibration_m_s2: Size = 1.0  # amplitude in flight


@dataclass(frozen=True)
class GyroDraw:
    """Gyros; sizes are deviations per axis unless they say otherwise."""

    noise_deg_s_rthz: Size = 0.005
    bias_deg_s: Size = 0.1  # left after the calibration at power-on
    walk_deg_s_rth: Size = 0.02  # the bias walks by this much in an hour
    warm_up_deg_s_min: Size = 0.0  # slope of the bias at switching on
    warm_up_min: Annotated[float, Within(0.1, 60.0)] = 5.0  # its time constant
    scale_percent: Size = 0.3
    misalignment_deg: Size = 0.3
    g_sensitivity_deg_s_g: Size = 0.05
    step_deg_s: Size = 0.061


@dataclass(frozen=True)
class AccelerometerDraw:
    """Accelerometers; sizes are deviations per axis unless they say otherwise."""

    noise_ug_rthz: Size = 100.0
    bias_mg: Size = 5.0
    warm_up_mg: Size = 0.0  # change until the temperature is steady
    scale_percent: Size = 0.3
    misalignment_deg: Size = 0.3
    step_mg: Size = 0.49


@dataclass(frozen=True)
class CompassDraw:
    """Compasses; sizes are deviations per axis unless they say otherwise."""

    count: Annotated[int, Within(0, 3)] = 1
    rate_hz: Annotated[float, Within(2.0, 250.0)] = 10.0
    delay_ms: Annotated[float, Within(0.0, 500.0)] = 50.0
    noise_ut: Size = 0.3
    step_ut: Size = 0.1
    hard_iron_ut: Size = 0.5  # left after the calibration
    soft_iron_percent: Size = 1.0
    motor_ut: Size = 0.0  # field of the motors at full throttle
    turned_deg: Size = 1.0  # about the vertical: mounting
    steel_ut: Size = 0.0  # at the place of the start


@dataclass(frozen=True)
class ReceiverDraw:
    """The receiver."""

    rate_hz: Annotated[float, Within(0.5, 25.0)] = 5.0
    delay_s: Annotated[float, Within(0.0, 2.0)] = 0.15
    noise_m_s: Size = 0.1
    noise_over_stated: Annotated[float, Within(0.1, 20.0)] = 1.0
    lever_arm_m: Annotated[float, Within(0.0, 5.0)] = 0.1  # of the antenna, in any direction
    multipath_m_s: Size = 0.0  # deviation of an error that lasts for 20 s
    outages_per_h: Size = 0.0
    outage_s: Annotated[float, Within(0.0, 600.0)] = 10.0


@dataclass(frozen=True)
class LinkDraw:
    """The link between autopilot and companion."""

    loss_share: Share = 0.0
    gaps_per_h: Size = 0.0
    gap_s: Annotated[float, Within(0.0, 60.0)] = 1.0
    latency_ms: Annotated[float, Within(0.0, 500.0)] = 3.0  # mean, exponential


@dataclass(frozen=True)
class Draw:
    """A flight."""

    seed: Annotated[int, Within(0, 2**53)]
    flight: FlightDraw = field(default_factory=FlightDraw)
    imu: ImuDraw = field(default_factory=ImuDraw)
    gyro: GyroDraw = field(default_factory=GyroDraw)
    accelerometer: AccelerometerDraw = field(default_factory=AccelerometerDraw)
    compass: CompassDraw = field(default_factory=CompassDraw)
    receiver: ReceiverDraw = field(default_factory=ReceiverDraw)
    link: LinkDraw = field(default_factory=LinkDraw)
    faults: tuple[str, ...] = ()  # as of `h2nav fake-autopilot --fault`, times since the start

    def __post_init__(self) -> None:
        """Reads the faults."""
        for fault in self.scheduled:
            if fault.imu > self.imu.count:
                raise BadInput(f"faults: {fault.name} is of IMU {fault.imu} of {self.imu.count}")
            if fault.name.startswith(OF_COMPASS) and fault.imu > self.compass.count:
                compasses = f"{fault.imu} of {self.compass.count}"
                raise BadInput(f"faults: {fault.name} is of compass {compasses}")

    @property
    def scheduled(self) -> tuple[Fault, ...]:
        """The faults with their times."""
        return tuple(map(parse_fault, self.faults))

    @property
    def length_s(self) -> float:
        """Of the whole flight, with its rest."""
        return 60.0 * self.flight.length_min


SECTIONS: dict[str, type[Any]] = {
    "flight": FlightDraw,
    "imu": ImuDraw,
    "gyro": GyroDraw,
    "accelerometer": AccelerometerDraw,
    "compass": CompassDraw,
    "receiver": ReceiverDraw,
    "link": LinkDraw,
}


def read_draw(path: Path) -> Draw:
    """A draw from a file, which names what is not nominal.

    Raises:
        BadInput: an unknown key, or a value outside its limits.
    """
    return into_record(Draw, read_mapping(path), str(path))


def not_nominal(draw: Draw) -> dict[str, dict[str, Any]]:
    """The values of each section that are not nominal."""
    found = {}
    for name, section in SECTIONS.items():
        nominal, own = section(), getattr(draw, name)
        values = {
            part.name: getattr(own, part.name)
            for part in dataclasses.fields(section)
            if getattr(own, part.name) != getattr(nominal, part.name)
        }
        if values:
            found[name] = values
    return found


def _as_yaml(value: float | str) -> str:
    """A value as it is read again: 1e-05 without a point would be a text."""
    text = str(value)
    is_bare = isinstance(value, float) and "." not in text
    return text.replace("e", ".0e") if is_bare else text


def as_text(draw: Draw) -> str:
    """The draw as the YAML that `read_draw` reads."""
    lines = [f"seed: {draw.seed}"]
    for name, values in not_nominal(draw).items():
        inside = ", ".join(f"{key}: {_as_yaml(value)}" for key, value in values.items())
        lines.append(f"{name}: {{{inside}}}")
    if draw.faults:
        lines.append("faults:")
        lines += [f"  - {fault}" for fault in draw.faults]
    return "\n".join(lines) + "\n"
