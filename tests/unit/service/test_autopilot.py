"""The rules of binding, each by what is heard and when."""

import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Autopilot, Candidates, Heard, Identity
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


def on_trial(*, has_imu):
    """Bound to `REAL`, which was last heard after 1 s, with a rival of two heartbeats."""
    link = Link()
    for t_s in (0.0, 1.0):
        link.heartbeat(t_s)
    if has_imu:
        link.autopilot.brings_imu()
    return link


@pytest.mark.parametrize(
    ("has_imu", "t_s", "heard"),
    [
        (True, 4.0, Heard.RIVAL),  # heard 3 s ago
        (True, 4.001, Heard.BOUND),
        (False, 3.0, Heard.RIVAL),  # on trial for 3 s, without a sample
        (False, 3.001, Heard.BOUND),
    ],
)
def test_who_is_on_trial_for_three_seconds_gives_way(has_imu, t_s, heard):
    link = on_trial(has_imu=has_imu)
    for before_s in (1.0, 0.5):
        assert link.heartbeat(t_s - before_s, FORGED) is Heard.NOTHING
    assert link.heartbeat(t_s, FORGED) is heard
    assert link.bound_to == (FORGED if heard is Heard.BOUND else REAL)


@pytest.mark.parametrize(("t_s", "heard"), [(13.0, Heard.RIVAL), (13.001, Heard.BOUND)])
def test_who_is_confirmed_gives_way_after_ten_seconds(t_s, heard):
    link = confirmed()  # last heard after 3 s
    for before_s in (1.0, 0.5):
        link.heartbeat(t_s - before_s, FORGED)
    assert link.autopilot.may_be_replaced(round(t_s * SECOND_NS)) is (heard is Heard.BOUND)
    assert link.heartbeat(t_s, FORGED) is heard
    assert link.autopilot.is_confirmed is (heard is Heard.RIVAL)
    assert link.autopilot.has_imu is (heard is Heard.RIVAL)


def test_without_a_binding_anybody_may_bind():
    assert Link().autopilot.may_be_replaced(0)
    assert not confirmed().autopilot.may_be_replaced(4 * SECOND_NS)


@pytest.mark.parametrize(("beats", "is_confirmed"), [(2, False), (3, True)])
def test_three_heartbeats_and_a_sample_confirm(beats, is_confirmed):
    link = Link()
    link.heartbeat(0)
    link.autopilot.brings_imu()
    for t_s in range(1, beats):
        link.heartbeat(t_s)
    assert link.autopilot.is_confirmed is is_confirmed


@pytest.mark.parametrize(("pause_s", "count"), [(0.399, 1), (0.4, 2), (10.0, 2), (10.001, 1)])
def test_heartbeats_are_counted_that_are_apart_but_not_too_far(pause_s, count):
    candidates = Candidates()
    candidates.take(SECOND_NS, REAL)
    assert candidates.take(SECOND_NS + round(pause_s * SECOND_NS), REAL) == count
    assert candidates.take(SECOND_NS + round(pause_s * SECOND_NS), FORGED) == 1


def test_a_count_stays_at_its_end():
    candidates = Candidates()
    assert [candidates.take(t_s * SECOND_NS, REAL) for t_s in range(300)][253:] == [
        254,
        *[255] * 46,
    ]


def test_every_address_has_a_count_of_its_own():
    candidates = Candidates()
    addresses = [(1, 2), (2, 1), (1, 255), (255, 1), (255, 255)]
    assert [candidates.take(SECOND_NS, sender) for sender in addresses] == [1] * 5


@pytest.mark.parametrize(
    ("settings", "accepted"),
    [
        ({}, [(1, 1), (77, 1), (1, 2)]),
        ({"system_id": 1}, [(1, 1), (1, 2)]),
        ({"component_id": 1}, [(1, 1), (77, 1)]),
        ({"system_id": 77, "component_id": 1}, [(77, 1)]),
    ],
)
def test_whom_the_settings_accept(settings, accepted):
    autopilot = Autopilot(AutopilotSettings(**settings), own_component_id=191)
    senders = [(1, 1), (77, 1), (1, 2), (1, 191), (0, 1), (1, 0)]
    assert [sender for sender in senders if autopilot.accepts(sender)] == accepted


def test_who_is_not_accepted_is_a_rival_after_three_heartbeats():
    link = Link(system_id=1)
    heard = [link.heartbeat(t_s, FORGED) for t_s in range(4)]
    assert heard == [Heard.NOTHING, Heard.NOTHING, Heard.RIVAL, Heard.RIVAL]


def test_the_bound_one_alone_is_owned():
    link = confirmed()
    senders = (REAL, (1, 2), (2, 1))
    assert [link.autopilot.owns(sender) for sender in senders] == [True, False, False]
    assert not Link().autopilot.owns(REAL)


@pytest.mark.parametrize(
    ("is_armed", "landed", "on_ground"),
    [
        (False, None, True),
        (False, False, True),
        (True, None, False),
        (True, False, False),
        (True, True, True),
    ],
)
def test_on_the_ground_is_who_is_disarmed_or_has_landed(is_armed, landed, on_ground):
    link = Link()
    link.heartbeat(0, heartbeat=QUADROTOR._replace(is_armed=is_armed))
    link.autopilot.take_landed_state(0, landed)
    assert (link.autopilot.is_armed, link.autopilot.on_ground) == (is_armed, on_ground)


@pytest.mark.parametrize(("later_s", "follows"), [(0.899, False), (0.9, True)])
def test_a_state_changes_once_in_nine_tenths_of_a_second(later_s, follows):
    link = Link()
    link.heartbeat(0, heartbeat=QUADROTOR._replace(is_armed=True))
    link.autopilot.take_landed_state(SECOND_NS, True)
    assert link.autopilot.on_ground
    link.autopilot.take_landed_state(SECOND_NS + round(later_s * SECOND_NS), False)
    assert link.autopilot.on_ground is not follows
    link.heartbeat(2.0, heartbeat=QUADROTOR)
    link.heartbeat(2.0 + later_s, heartbeat=QUADROTOR._replace(is_armed=True))
    assert link.autopilot.is_armed is follows


def test_another_vehicle_begins_with_its_own_state():
    link = Link()
    link.heartbeat(0.0, FORGED, QUADROTOR._replace(is_armed=True))
    link.autopilot.take_landed_state(0, True)
    for t_s in (3.0, 4.0, 5.0):
        link.heartbeat(t_s, REAL, PLANE._replace(is_armed=True))
    assert link.bound_to == REAL
    assert link.autopilot.is_armed
    assert not link.autopilot.on_ground
    assert link.autopilot.identity.is_fixed_wing


@pytest.mark.parametrize(
    ("make", "vehicle", "description", "vehicle_class"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR,
         "ArduPilot quadrotor 7/1", "multirotor"),
        (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_FIXED_WING, "PX4 fixed_wing 7/1",
         "fixed-wing"),
        (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_GROUND_ROVER, "PX4 ground_rover 7/1",
         "rover"),
        (mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_TYPE_SURFACE_BOAT,
         "GENERIC surface_boat 7/1", "rover"),
        (250, 251, "? ? 7/1", "multirotor"),
    ],
)  # fmt: skip
def test_a_vehicle_is_described_by_make_type_and_address(make, vehicle, description, vehicle_class):
    identity = Identity(7, 1, make, vehicle)
    assert (identity.description, identity.vehicle_class) == (description, vehicle_class)
    assert (identity.is_fixed_wing, identity.is_rover) == (
        vehicle_class == "fixed-wing",
        vehicle_class == "rover",
    )
    assert (str(identity), identity.address) == ("7/1", (7, 1))
