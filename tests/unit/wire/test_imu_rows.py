"""Many IMU messages at once give the readings that their readers give one by one."""

import numpy as np
import pytest

from h2nav.recordings.frame_tables import fields_type
from h2nav.wire import codec
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES
from h2nav.wire.imu_rows import readings
from h2nav.wire.refused import LATEST_USEC, Refused

COUNT = 4_000
MOTION, ALL = 0x3F, 0x1FF
INTEGERS = ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")
EXTREMES = {
    "<f4": (0.0, -0.0, np.nan, np.inf, 1e-30, 3e38, 34.7, 152.0, 1e4, 1e6),
    "<i2": (0, 1, -1, 32_767, -32_768, 15_499, 15_500, 30_629, 30_630),
}


def drawn(name: str, seed: int) -> np.ndarray:
    """Messages with values of every size, and now and then an extreme one in any field."""
    random = np.random.default_rng(seed)
    fields = np.zeros(COUNT, dtype=fields_type(IDS_BY_NAME[name]))
    for column in fields.dtype.names:
        kind = fields.dtype[column].str
        if kind == "<f4":
            values = random.normal(0.0, 10.0 ** random.uniform(-3, 1.5, COUNT))
        elif kind == "<i2":
            values = random.normal(0.0, 10.0 ** random.uniform(0, 4, COUNT)).astype(np.int16)
        else:
            values = random.integers(0, 1_000_000, COUNT)
        fields[column] = values
        if kind in EXTREMES:
            rows = random.random(COUNT) < 0.01
            fields[column][rows] = random.choice(EXTREMES[kind], rows.sum())
    for sensor in ("acc", "gyro", "mag"):
        rows = random.random(COUNT) < 0.05
        for axis in "xyz":
            fields[axis + sensor][rows] = 0
    if "fields_updated" in fields.dtype.names:
        fields["fields_updated"] = random.choice((ALL, MOTION, 0x1F), COUNT, p=(0.7, 0.2, 0.1))
        fields["id"] = random.choice((0, 1, 2, 3, 255), COUNT)
        rows = random.random(COUNT) < 0.2
        for axis in "xyz":
            fields[axis + "mag"][rows] *= np.float32(1e6)
    if "time_usec" in fields.dtype.names:
        fields["time_usec"][:5] = LATEST_USEC + np.arange(-2, 3)
    return fields


@pytest.mark.parametrize("name", [*INTEGERS, "HIGHRES_IMU"])
@pytest.mark.filterwarnings("ignore:overflow")
def test_the_readings_are_those_of_single_messages(name: str) -> None:
    message_id = IDS_BY_NAME[name]
    fields, read = drawn(name, seed=3), IMU_MESSAGES[message_id].read
    assert read is not None
    left = 0
    for row, found in zip(fields, readings(message_id, fields), strict=True):
        if found is None:
            left += 1
            continue
        expected = read(codec.DECODERS[message_id](row.tobytes()))
        assert repr(found) == repr(expected), "to the last bit, and of the same types"
    assert left < 0.7 * COUNT, "the rest is usual"


def test_what_a_reader_refuses_is_left_to_it() -> None:
    message_id = IDS_BY_NAME["HIGHRES_IMU"]
    fields, read = drawn("HIGHRES_IMU", seed=4), IMU_MESSAGES[message_id].read
    assert read is not None
    refused = 0
    for row, found in zip(fields, readings(message_id, fields), strict=True):
        try:
            read(codec.DECODERS[message_id](row.tobytes()))
        except Refused:
            refused += 1
            assert found is None
    assert refused > 100
