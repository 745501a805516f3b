"""Every attitude filter under its name, of shipped gain files, compiled where that is possible."""

from collections.abc import Callable

from synthetic_imu import FIELD

from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import constant_gain_model
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import CONSTANT_GAIN, VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.native import compiled_step
from h2nav.attitude.samples import EarthField, VehicleState
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.files import gain_files

FLYING = VehicleState(on_ground=False)
GROUND = VehicleState(on_ground=True)
MULTIROTOR = "multirotor_100hz"
SENSOR = "mpu9250_100hz"

_VEHICLE = velocity_aided_gains(gain_files.load(MULTIROTOR), MULTIROTOR)
_MODEL = constant_gain_model(gain_files.load(SENSOR), SENSOR)

FILTERS: dict[str, Callable[[], AttitudeFilter]] = {
    "velocity_aided": lambda: VelocityAidedFilter(_VEHICLE, compiled_step(VELOCITY_AIDED)),
    "velocity_aided_integer": lambda: IntegerVelocityAidedFilter(
        _VEHICLE, MULTIROTOR, compiled_step(VELOCITY_AIDED_INTEGER)
    ),
    "constant_gain": lambda: ConstantGainFilter(_MODEL, compiled_step(CONSTANT_GAIN)),
}


def new_filter(
    name: str, vehicle: VehicleState = FLYING, field: EarthField | None = FIELD
) -> AttitudeFilter:
    """A filter that has been told of its vehicle, and of the field of `synthetic_imu` or another.

    Args:
        name: a key of `FILTERS`.
        vehicle: its state.
        field: None = it is told no field.
    """
    filter_ = FILTERS[name]()
    filter_.use_vehicle(vehicle)
    if field is not None:
        filter_.use_field(field)
    return filter_
