"""The IMU messages among some frames of a recording, read many at a time."""

import numpy as np

from h2nav.recordings.frame_tables import fields_of
from h2nav.wire.arrivals import Integers
from h2nav.wire.frame_scan import FoundFrames
from h2nav.wire.imu import ImuReading
from h2nav.wire.imu_rows import readings


class ImuFrames:
    """Reads all frames of an IMU message when the first of them is asked for.

    Args:
        found: frames of a recording.
        rows: (M,) the numbers of those that may be asked for.
    """

    def __init__(self, found: FoundFrames, rows: Integers) -> None:
        self._found, self._rows = found, rows
        self._ids = found.headers.msg_ids[rows]
        self._readings: list[ImuReading | None] = [None] * len(rows)
        self._known: set[int] = set()

    def reading(self, number: int, message_id: int) -> ImuReading | None:
        """The reading of one of `rows`; None where the message's reader has to decide."""
        if message_id not in self._known:
            self._known.add(message_id)
            places = np.flatnonzero(self._ids == message_id)
            fields = fields_of(self._found, message_id, self._rows[places])
            found = readings(message_id, fields)
            for place, reading in zip(places.tolist(), found, strict=True):
                self._readings[place] = reading
        return self._readings[number]
