"""A sensor model in the units of data sheets: checks, and conversion for the synthesis."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

from h2nav.attitude.constant_gain.sensor_gains import DENSITY_LIMITS, density_section
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import EarthField
from h2nav.errors import BadInput
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.synthesis.plant import VectorSensor
from h2nav.validation import Within, numbers_within

# An optional number that was not given.
ABSENT = math.nan
# Heading information is proportional to cos^2(dip): beyond this the heading gain is not finite.
MAX_DIP_DEG = 89.9


@dataclass(frozen=True, slots=True)
class Gyro:
    """Gyro noise; the bias walk is given directly or as instability with correlation time."""

    noise_deg_s_rthz: Annotated[float, Within(0, 100)]
    bias_walk_deg_s_rts: Annotated[float, Within(0, 10)] = ABSENT
    bias_instability_deg_h: Annotated[float, Within(0, 100_000)] = ABSENT
    bias_correlation_s: Annotated[float, Within(1, 1e6)] = ABSENT


@dataclass(frozen=True, slots=True)
class Accelerometer:
    """Accelerometer noise."""

    noise_ug_rthz: Annotated[float, Within(0, 1e6)]


@dataclass(frozen=True, slots=True)
class Magnetometer:
    """Magnetometer noise: rms of one reading, and how often an independent reading comes."""

    part: str
    noise_ut_rms: Annotated[float, Within(0, 100)]
    rate_hz: Annotated[float, Within(0.1, 2000)]


@dataclass(frozen=True, slots=True)
class Disturbances:
    """Noise of the vehicle in addition to the sensors' own, as white noise in the same units."""

    rotation_deg_s_rthz: Annotated[float, Within(0, 100)] = 0.0
    acceleration_ug_rthz: Annotated[float, Within(0, 1e7)] = 0.0
    field_ut_rms: Annotated[float, Within(0, 1000)] = 0.0


@dataclass(frozen=True, slots=True)
class ModelField:
    """The earth's field: norm and dip, or a place and date for the World Magnetic Model."""

    norm_ut: Annotated[float, Within(1, 100)] = ABSENT
    dip_deg: Annotated[float, Within(-90, 90)] = ABSENT
    declination_deg: Annotated[float, Within(-180, 180)] = ABSENT
    latitude_deg: Annotated[float, Within(-90, 90)] = ABSENT
    longitude_deg: Annotated[float, Within(-180, 180)] = ABSENT
    altitude_m: Annotated[float, Within(-1000, 600_000)] = ABSENT
    year: Annotated[float, Within(2010, 2029.99)] = ABSENT


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Everything that the gains of a sensor depend on.

    `source` names the origin of the figures and is kept in every gain file.
    """

    name: str
    source: str
    gyro: Gyro
    accelerometer: Accelerometer
    magnetometer: Magnetometer
    field: ModelField
    disturbances: Disturbances = dataclasses.field(default_factory=Disturbances)


def densities(model: SensorModel, place: str) -> SensorDensities:
    """The model in SI, with two-sided densities.

    Data sheets state one-sided densities (noise = density * sqrt(bandwidth)); the equations' white
    noise is two-sided: density / sqrt(2).

    Args:
        model: as read from a file, its field given by value; single values are within limits.
        place: the file, for errors.

    Raises:
        BadInput: one line per combination of values without a well-posed synthesis, or per density
            that no gain file may hold.

    Source: docs/derivation.md Eq. (4.1).
    """
    complaints = _noise_complaints(model) + _bias_complaints(model.gyro)
    complaints += _dip_complaints(model.field)
    if complaints:
        raise BadInput(*(f"{place}: {line}" for line in complaints))
    gyro = math.hypot(model.gyro.noise_deg_s_rthz, model.disturbances.rotation_deg_s_rthz)
    accel = math.hypot(model.accelerometer.noise_ug_rthz, model.disturbances.acceleration_ug_rthz)
    mag = math.hypot(model.magnetometer.noise_ut_rms, model.disturbances.field_ut_rms)
    declination_deg = (
        0.0 if math.isnan(model.field.declination_deg) else model.field.declination_deg
    )
    found = SensorDensities(
        gyro=gyro * DEG / math.sqrt(2.0),
        bias_walk=_bias_walk_deg(model.gyro) * DEG,
        accelerometer=accel * 1e-6 * GRAVITY_M_S2 / math.sqrt(2.0),
        magnetometer=mag / math.sqrt(model.magnetometer.rate_hz),
        gravity_m_s2=GRAVITY_M_S2,
        field=EarthField(model.field.norm_ut, model.field.dip_deg * DEG, declination_deg * DEG),
    )
    numbers_within(density_section(found), DENSITY_LIMITS, complaints, place, "in SI, ")
    if complaints:
        raise BadInput(*complaints)
    return found


def vector_sensors(densities: SensorDensities) -> tuple[VectorSensor, VectorSensor]:
    """Gravity (0, 0, g), measured as -f_b, and the earth's field; both in magnetic NED.

    Source: docs/derivation.md Eq. (4.1).
    """
    norm_ut, dip_rad, _ = densities.field
    field_n = (norm_ut * math.cos(dip_rad), 0.0, norm_ut * math.sin(dip_rad))
    return (
        VectorSensor((0.0, 0.0, densities.gravity_m_s2), densities.accelerometer),
        VectorSensor(field_n, densities.magnetometer),
    )


def needs_place(model: SensorModel, place: str) -> bool:
    """Whether the field is given by place and date, to be looked up.

    Raises:
        BadInput: neither form of the field, or both, are complete.
    """
    given = model.field
    by_value = [not math.isnan(x) for x in (given.norm_ut, given.dip_deg)]
    by_place = [not math.isnan(x) for x in (given.latitude_deg, given.longitude_deg, given.year)]
    if all(by_value) and not any(by_place) and math.isnan(given.altitude_m):
        return False
    if all(by_place) and not any(by_value) and math.isnan(given.declination_deg):
        return True
    raise BadInput(
        f"{place}: field: expected either norm_ut and dip_deg (and declination_deg), or "
        "latitude_deg, longitude_deg and year (and altitude_m)"
    )


def with_field(model: SensorModel, field: EarthField) -> SensorModel:
    """The model with its field by value; the place stays as a note of its origin."""
    given = replace(
        model.field,
        norm_ut=field.norm_ut,
        dip_deg=field.dip_rad / DEG,
        declination_deg=field.declination_rad / DEG,
    )
    return replace(model, field=given)


def given_values(model: SensorModel) -> dict[str, object]:
    """The given values of a model as nested plain values, as stored in a gain file."""
    sections: dict[str, object] = {}
    for key, value in asdict(model).items():
        if isinstance(value, dict):
            sections[key] = {
                name: item
                for name, item in value.items()
                if not (isinstance(item, float) and math.isnan(item))
            }
        else:
            sections[key] = value
    return sections


def model_from_values(values: Mapping[str, object], place: str) -> SensorModel:
    """The model stored by `given_values`; raises BadInput if the section is not such a model."""
    parts: dict[str, type] = {
        "gyro": Gyro,
        "accelerometer": Accelerometer,
        "magnetometer": Magnetometer,
        "field": ModelField,
        "disturbances": Disturbances,
    }
    built: dict[str, Any] = {}
    try:
        for key, value in values.items():
            built[key] = parts[key](**value) if isinstance(value, dict) else value
        model = SensorModel(**built)
        for key in parts:
            for name, number in asdict(getattr(model, key)).items():
                if name != "part" and not isinstance(number, float):
                    raise TypeError(f"{key}.{name} is not a number")
    except (TypeError, KeyError) as error:
        raise BadInput(
            f"{place}: model: not the model of a two_stage gain file ({error}); make the file "
            "again with h2nav synthesize"
        ) from None
    return model


def _noise_complaints(model: SensorModel) -> list[str]:
    return [
        f"{key}: zero noise has no finite optimal gain; expected the data sheet's figure (or the "
        "least you would bet on)"
        for key, value in (
            ("gyro.noise_deg_s_rthz", model.gyro.noise_deg_s_rthz),
            ("accelerometer.noise_ug_rthz", model.accelerometer.noise_ug_rthz),
            ("magnetometer.noise_ut_rms", model.magnetometer.noise_ut_rms),
            ("gyro.bias_walk_deg_s_rts", model.gyro.bias_walk_deg_s_rts),
            ("gyro.bias_instability_deg_h", model.gyro.bias_instability_deg_h),
        )
        if value == 0.0
    ]


def _dip_complaints(given: ModelField) -> list[str]:
    if abs(given.dip_deg) <= MAX_DIP_DEG:
        return []
    return [
        f"field: the dip is {given.dip_deg:.2f} deg: the field is parallel to gravity, so heading "
        f"cannot be observed; |dip| must be at most {MAX_DIP_DEG} deg"
    ]


def _bias_complaints(gyro: Gyro) -> list[str]:
    direct = not math.isnan(gyro.bias_walk_deg_s_rts)
    instability = not math.isnan(gyro.bias_instability_deg_h)
    correlation = not math.isnan(gyro.bias_correlation_s)
    if direct != instability and instability == correlation:
        return []
    return [
        "gyro: expected either bias_walk_deg_s_rts, or bias_instability_deg_h together with "
        "bias_correlation_s (the averaging time at which the Allan deviation is lowest)"
    ]


def _bias_walk_deg(gyro: Gyro) -> float:
    """The walk, deg/s/sqrt(s): of a first-order process with the instability as its deviation."""
    if not math.isnan(gyro.bias_walk_deg_s_rts):
        return gyro.bias_walk_deg_s_rts
    return gyro.bias_instability_deg_h / 3600.0 * math.sqrt(2.0 / gyro.bias_correlation_s)
