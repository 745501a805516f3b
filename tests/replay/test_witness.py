"""The witness on recorded flights of real autopilots, against the simulator's truth."""

import pytest
from needs import shared_data
from replayed import QuicklyReplayed

from h2nav.apps.configuration import Configuration
from h2nav.integrity.findings import Findings
from h2nav.integrity.velocity_witness import VelocityVerdict
from h2nav.integrity.witness import AttitudeSource

pytestmark = pytest.mark.thorough


class Watched(QuicklyReplayed):
    """Keeps what the witness found, and the alarms that were new."""

    def __init__(self, flight):
        self.compared = []
        self.told = []
        self._ledger = Findings()
        super().__init__(shared_data(f"flights/{flight}.tlog"), Configuration())

    def estimate(self, t_ns, estimate, late_ns):
        super().estimate(t_ns, estimate, late_ns)
        witness = self.pipeline.service._comparing.witness
        found = witness.latest
        if found is not None and found not in self.compared[-1:]:
            self.compared.append(found)
            begun, *_ = self._ledger.update(found.t_us * 1e-6, witness.alarms())
            self.told += begun


def test_a_magnet_that_turns_the_autopilots_heading_is_told_and_the_velocity_supports_us():
    """EKF3 is off by 4 to 6 deg for 40 s of flight; we are off by 0.9 deg at most."""
    seen = Watched("magnet_vibration")
    first = seen.told[0]
    assert (first.kind, first.sensor.name) == ("autopilot_heading", "autopilot")
    assert first.text in {f"autopilot heading off {size} deg, GPS backs us" for size in (4, 5, 6)}
    verdicts = {found.verdicts.heading for found in seen.compared}
    assert verdicts == {VelocityVerdict.H2NAV, VelocityVerdict.UNDECIDED}
    assert {alarm.kind for alarm in seen.told} == {"autopilot_heading"}


def test_where_both_are_right_nothing_is_told():
    seen = Watched("calm")
    assert len(seen.compared) > 1900
    assert all(found.source is AttitudeSource.AUTOPILOT for found in seen.compared)
    assert seen.told == []
