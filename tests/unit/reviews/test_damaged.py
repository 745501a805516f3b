"""What damaged recordings hold ends no review."""

import numpy as np
import orjson
import pytest
from reviewed_flights import flight

from h2nav.recordings.context import Motors, Series
from h2nav.reviews.analysis import analyse
from h2nav.reviews.parameters import in_order


@pytest.mark.parametrize("value", [2.0**70, -(2.0**100), 1e300, float("inf"), float("nan")])
def test_parameters_of_any_size_are_written(value):
    written = orjson.loads(orjson.dumps(in_order({"A": value, "B": 3.0})))
    assert written["B"] == 3
    assert written["A"] is None or written["A"] == pytest.approx(value)


def test_samples_of_an_accelerometer_at_one_time():
    t_s = np.arange(0.0, 10.0, 0.1)
    motors = Motors((1, 2, 3, 4), t_s, np.full((len(t_s), 4), 1500.0), 1000.0, 1950.0)
    made = flight(motors=motors, demand=Series(t_s, np.zeros((len(t_s), 3))))
    frozen = tuple(
        track._replace(t_s=np.full(len(track.t_s), track.t_s[0])) for track in made.context.imus
    )
    analyse(made._replace(context=made.context._replace(imus=frozen)))
