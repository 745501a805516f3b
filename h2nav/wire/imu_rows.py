"""IMU messages of a recording, many at a time, with the same result as their readers in `imu`.

Only usual values become readings here: whatever is near a limit, absurd or to be refused is left
to the reader of one message.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.wire.imu import (
    ABSURD_FIELD_UT,
    AMBIGUOUS_MRAD_S,
    CLIPPED_FORCE_M_S2,
    CLIPPED_FORCE_MG,
    CLIPPED_RATE_RAD_S,
    HIGHRES_FIELD_FAULT,
    HIGHRES_MAG_BITS,
    HIGHRES_MOTION_BITS,
    IDS_BY_NAME,
    MAX_IMUS,
    MILLI_G,
    UT_PER_GAUSS,
    UT_PER_MGAUSS,
    ImuReading,
)
from h2nav.wire.refused import LATEST_USEC

HIGHRES_ID, RAW_ID = IDS_BY_NAME["HIGHRES_IMU"], IDS_BY_NAME["RAW_IMU"]
# A field of this size is neither zero nor absurd, however its length is rounded.
PLAIN_FIELD_UT = (1e-6 * ABSURD_FIELD_UT, 0.5 * ABSURD_FIELD_UT)

Rows = NDArray[Any]
Vectors = NDArray[np.float64]
Mask = NDArray[np.bool_]


def readings(message_id: int, fields: Rows) -> list[ImuReading | None]:
    """The readings of one IMU message; None where its reader has to decide.

    Args:
        message_id: of the message.
        fields: (N,) structured, the dialect's fields.
    """
    if message_id == HIGHRES_ID:
        return _highres(fields)
    return _integers(fields, "time_usec" if message_id == RAW_ID else "time_boot_ms")


class _Columns(NamedTuple):
    """(N,) or (N, 3) values of messages in body SI units."""

    usual: Mask  # they become readings
    times: Rows  # the messages' own times
    rate: Vectors  # rad/s
    force: Vectors  # m/s^2
    field: Vectors  # microtesla
    has_field: Mask


def _integers(fields: Rows, time: str) -> list[ImuReading | None]:
    rate, force, field = (_vectors(fields, kind) for kind in ("gyro", "acc", "mag"))
    usual = _within(rate, AMBIGUOUS_MRAD_S) & _within(force, CLIPPED_FORCE_MG)
    usual &= _any(force) & (fields[time] <= LATEST_USEC)
    in_si = rate * 1e-3, force * MILLI_G, field * UT_PER_MGAUSS
    return _made(_Columns(usual, fields[time], *in_si, _any(field)), [None] * len(fields))


def _highres(fields: Rows) -> list[ImuReading | None]:
    rate, force, field = (_vectors(fields, kind) for kind in ("gyro", "acc", "mag"))
    field *= UT_PER_GAUSS
    has_field = fields["fields_updated"] & HIGHRES_MAG_BITS != 0
    # A NaN is not within anything.
    usual = _within(rate, CLIPPED_RATE_RAD_S) & _within(force, CLIPPED_FORCE_M_S2)
    usual &= _any(force) & (fields["time_usec"] <= LATEST_USEC)
    usual &= fields["fields_updated"] & HIGHRES_MOTION_BITS == HIGHRES_MOTION_BITS
    with np.errstate(over="ignore", invalid="ignore"):
        norm_ut = np.sqrt(np.einsum("ij,ij->i", field, field))
    is_too_large = norm_ut > 2.0 * ABSURD_FIELD_UT
    field = np.where(is_too_large[:, np.newaxis], field / HIGHRES_FIELD_FAULT, field)
    norm_ut = np.where(is_too_large, norm_ut / HIGHRES_FIELD_FAULT, norm_ut)
    lowest, highest = PLAIN_FIELD_UT
    usual &= ~has_field | ((norm_ut > lowest) & (norm_ut < highest))
    imus = np.where(fields["id"] < MAX_IMUS, fields["id"], 0).tolist()
    return _made(_Columns(usual, fields["time_usec"], rate, force, field, has_field), imus)


def _vectors(fields: Rows, kind: str) -> Vectors:
    """(N, 3) the columns x, y and z of a sensor."""
    return np.stack([fields[f"{axis}{kind}"].astype(np.float64) for axis in "xyz"], axis=1)


def _within(values: Vectors, limit: float) -> Mask:
    found: Mask = np.logical_and.reduce(np.abs(values) < limit, axis=1)
    return found


def _any(values: Vectors) -> Mask:
    found: Mask = np.logical_or.reduce(values != 0.0, axis=1)
    return found


def _made(columns: _Columns, imus: list[int | None]) -> list[ImuReading | None]:
    usual, times, rate, force, field, has_field = columns
    rows = zip(
        usual.tolist(),
        times.tolist(),
        *(zip(*values.T.tolist(), strict=True) for values in (rate, force, field)),
        has_field.tolist(),
        imus,
        strict=True,
    )
    make = tuple.__new__
    return [
        make(ImuReading, (t, w_b, f_b, m_b_ut if has else None, False, imu, None))
        if is_usual
        else None
        for is_usual, t, w_b, f_b, m_b_ut, has, imu in rows
    ]
