"""The rules of binding, each by what is heard and when."""

import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Autopilot, Candidates, Heard
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.vehicle import Heartbeat

REAL, FORGED = (1, 1), (77, 1)
QUADROTOR = Heartbeat(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR, False)
PLANE = QUADROTOR._replace(vehicle_type=mavlink.MAV_TYPE_FIXED_WING)


class Link:
    """What an autopilot hears, at times in seconds."""

    def __init__(self, **settings):
        self.autopilot = Autopilot(AutopilotSettings(**settings))

    def heartbeat(self, t_s, sender=REAL, heartbeat=QUADROTOR):
        return self.autopilot.take_heartbeat(round(t_s * SECOND_NS), sender, heartbeat)

    @property
    def bound_to(self):
        identity = self.autopilot.identity
        return identity and identity.address


def confirmed():
    link = Link()
    for t_s in range(3):
        link.heartbeat(t_s)
        link.autopilot.brings_imu()
    link.heartbeat(3)
    assert link.autopilot.is_confirmed
    return link


def test_the_first_autopilot_is_on_trial_at_once_and_confirmed_by_its_imu():
    link = Link()
    assert link.heartbeat(0.0) is Heard.BOUND
    assert [link.heartbeat(t_s) for t_s in (1.0, 2.0)] == [Heard.NOTHING] * 2
    assert not link.autopilot.is_confirmed
    link.autopilot.brings_imu()
    link.heartbeat(3.0)
    assert link.autopilot.is_confirmed


@pytest.mark.parametrize("claimed", [mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_AUTOPILOT_GENERIC])
def test_a_ground_station_is_no_autopilot(claimed):
    link = Link()
    station = Heartbeat(claimed, mavlink.MAV_TYPE_GCS, False)
    assert link.heartbeat(0.0, (255, 190), station) is Heard.NOTHING
    assert link.bound_to is None


@pytest.mark.parametrize("sender", [(0, 1), (1, 0), (0, 0), (1, 191)])
def test_an_address_that_no_autopilot_has_binds_nothing(sender):
    autopilot = Autopilot(AutopilotSettings(), own_component_id=191)
    for t_s in range(20):
        autopilot.take_heartbeat(t_s * SECOND_NS, sender, QUADROTOR)
    assert autopilot.identity is None


def test_a_forged_first_heartbeat_gives_way_to_the_real_autopilot():
    link = Link()
    link.heartbeat(0.0, FORGED)
    heard = {t_s: link.heartbeat(t_s) for t_s in (0.3, 1.3, 2.3, 3.3)}
    assert heard[3.3] is Heard.BOUND
    assert link.bound_to == REAL


def test_a_forger_that_goes_on_without_an_imu_gives_way_too():
    link = Link()
    times = itertools.chain.from_iterable((t_s, t_s + 0.3) for t_s in range(12))
    for i, t_s in enumerate(times):
        link.heartbeat(t_s, FORGED if i % 2 == 0 else REAL)
        if link.bound_to == REAL:
            break
    assert link.bound_to == REAL
    assert t_s < 12


def test_a_confirmed_autopilot_is_kept_against_rivals_and_given_up_after_ten_seconds():
    link = confirmed()
    for t_s in range(4, 30):
        link.heartbeat(t_s)
        link.heartbeat(t_s + 0.5, FORGED)
        assert link.bound_to == REAL
    heard = [link.heartbeat(t_s, FORGED) for t_s in range(30, 41)]
    assert heard[:9] == [Heard.RIVAL] * 9
    assert heard[-1] is Heard.BOUND


def test_heartbeats_forged_under_many_ids_bind_nobody_and_take_no_memory():
    link = confirmed()
    candidates = link.autopilot._candidates
    size = len(candidates._counts), len(candidates._last_ns)
    for i in range(20_000):
        sender = (i % 254 + 1, i // 254 % 254 + 1)
        if sender != REAL:
            assert link.heartbeat(3.0 + i / 8_000, sender) is Heard.NOTHING
    assert link.bound_to == REAL
    assert (len(candidates._counts), len(candidates._last_ns)) == size


def test_a_burst_of_heartbeats_counts_once():
    candidates = Candidates()
    counts = [candidates.take(i * 1_000_000, FORGED) for i in range(100)]
    assert counts == [1] * 100
    assert candidates.take(SECOND_NS, FORGED) == 2
    assert candidates.take(60 * SECOND_NS, FORGED) == 1


@pytest.mark.parametrize("settings", [{"system_id": 1}, {"component_id": 2}])
def test_configured_ids_are_the_only_ones_that_bind(settings):
    link = Link(**settings)
    for t_s in range(20):
        link.heartbeat(t_s, FORGED)
    assert link.bound_to is None


def test_a_flipping_type_changes_nothing():
    link = confirmed()
    for i in range(5_000):
        heard = link.heartbeat(4.0 + i / 1_400, heartbeat=PLANE if i % 2 else QUADROTOR)
        assert heard is Heard.NOTHING
    assert link.autopilot.identity.vehicle_type == mavlink.MAV_TYPE_QUADROTOR


def test_a_type_that_stays_for_three_seconds_is_believed():
    link = confirmed()
    heard = [link.heartbeat(t_s, heartbeat=PLANE) for t_s in range(4, 9)]
    assert heard.index(Heard.BOUND) == 3
    assert link.autopilot.identity.vehicle_type == mavlink.MAV_TYPE_FIXED_WING


def test_arming_is_seen_at_once_and_flips_are_slowed_down():
    link = confirmed()
    armed = QUADROTOR._replace(is_armed=True)
    link.heartbeat(4.0, heartbeat=armed)
    assert link.autopilot.is_armed
    seen = []
    for i in range(1_400):
        link.heartbeat(5.0 + i / 1_400, heartbeat=QUADROTOR if i % 2 else armed)
        seen.append(link.autopilot.is_armed)
    changes = sum(before != after for before, after in itertools.pairwise(seen))
    assert changes <= 2
