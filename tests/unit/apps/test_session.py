"""What the daemon keeps beside the estimates."""

import dataclasses
import io
from pathlib import Path

import pytest

from h2nav.apps.configuration import Configuration
from h2nav.apps.console import Console
from h2nav.apps.log_contents import open_recorder
from h2nav.apps.session import _flight_keeper


@pytest.mark.parametrize("has_log", [True, False])
@pytest.mark.parametrize(("review", "fetch_log"), [(True, False), (False, True), (False, False)])
def test_flights_are_kept_where_there_is_a_log_and_they_are_reviewed_or_fetched(
    tmp_path: Path, has_log: bool, review: bool, fetch_log: bool
) -> None:
    usual = Configuration()
    configuration = dataclasses.replace(
        usual,
        log=dataclasses.replace(usual.log, folder=str(tmp_path) if has_log else ""),
        flights=dataclasses.replace(usual.flights, review=review, fetch_log=fetch_log),
    )
    recorder = open_recorder(configuration.log, 0)
    try:
        keeper = _flight_keeper(configuration, recorder, Console(stream=io.StringIO()), None)
    finally:
        if recorder is not None:
            recorder.close(10.0)
    assert (keeper is not None) == (has_log and (review or fetch_log))
