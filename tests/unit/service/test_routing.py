"""Which messages are read, of whom, and until when an answer is remembered."""

from collections import Counter
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.routing import Routing

US, OTHER = (1, 1), (2, 1)
IMU, ATTITUDE = mavlink.MAVLINK_MSG_ID_RAW_IMU, mavlink.MAVLINK_MSG_ID_ATTITUDE
PLACE, HEARTBEAT = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_HEARTBEAT
UNREAD = mavlink.MAVLINK_MSG_ID_VFR_HUD
T_NS = 100 * SECOND_NS


class Bench:
    """A routing between parts that a test commands."""

    def __init__(self, *, bound=True):
        self.asked, self.rejected, self.brought = [], [], 0
        self.needs, self.idle_until_ns = True, T_NS + 50
        self.counts, self.routes = Counter(), {}
        part = SimpleNamespace(
            on_arrival=self._needed,
            idle_until_ns=lambda _: self.idle_until_ns,
            reject=self.rejected.append,
            routes=self.routes,
        )
        self.autopilot = SimpleNamespace(identity=None, has_imu=False, brings_imu=self._brings_imu)
        self.aiding = SimpleNamespace(knows_field=False)
        wanted = SimpleNamespace(counts=self.counts)
        self.routing = Routing(self.autopilot, wanted, part, part, self.aiding)
        if bound:
            self.autopilot.identity = SimpleNamespace(address=US)
            self.routing.on_binding(self.autopilot.identity)

    def _needed(self, t_ns, message_id):
        self.asked.append((t_ns, message_id))
        return self.needs

    def _brings_imu(self):
        self.brought += 1
        self.autopilot.has_imu = True

    def arrives(self, message_id, t_ns=T_NS, sender=US):
        return self.routing.on_arrival(t_ns, sender, message_id)


@pytest.mark.parametrize("message_id", [IMU, ATTITUDE])
def test_a_message_that_is_not_needed_is_not_asked_about_again_for_a_while(message_id):
    bench = Bench()
    bench.needs = False
    assert not bench.arrives(message_id)
    bench.needs = True
    assert not bench.arrives(message_id, T_NS + 49)
    assert bench.asked == [(T_NS, message_id)]
    assert bench.arrives(message_id, T_NS + 50)
    assert bench.arrives(message_id, T_NS + 51)
    assert bench.counts == {message_id: 4}


@pytest.mark.parametrize(
    ("route", "is_asked"),
    [
        ((T_NS + 1, ("lane",)), False),
        ((T_NS, ("lane",)), True),  # it has ended
        ((T_NS + 1, ()), True),  # it leads nowhere
        (None, True),
    ],
)
def test_a_route_that_holds_is_followed(route, is_asked):
    bench = Bench()
    if route is not None:
        bench.routes[IMU] = route
    assert bench.arrives(IMU)
    assert bool(bench.asked) is is_asked


def test_the_first_sample_shows_that_the_autopilot_has_an_imu():
    bench = Bench()
    bench.arrives(ATTITUDE)
    assert bench.brought == 0
    bench.arrives(IMU)
    bench.arrives(IMU)
    assert bench.brought == 1


@pytest.mark.parametrize(("knows_field", "pause_ns"), [(False, 0), (True, SECOND_NS)])
def test_a_place_is_read_once_a_second_when_the_field_is_known(knows_field, pause_ns):
    bench = Bench()
    bench.aiding.knows_field = knows_field
    assert bench.arrives(PLACE)
    assert bench.arrives(PLACE, T_NS + SECOND_NS - 1) is (pause_ns == 0)
    assert bench.arrives(PLACE, T_NS + SECOND_NS)
    assert bench.counts == {PLACE: 3}


@pytest.mark.parametrize(("message_id", "is_read"), [(HEARTBEAT, True), (UNREAD, False)])
def test_what_has_a_reader_is_read(message_id, is_read):
    bench = Bench()
    bench.aiding.knows_field = True
    for t_ns in (T_NS, T_NS + 1):
        assert bench.arrives(message_id, t_ns) is is_read
    assert bench.asked == []


@pytest.mark.parametrize(
    ("message_id", "is_read", "reasons"),
    [
        (IMU, False, ["other_sender"]),
        (ATTITUDE, False, []),
        (HEARTBEAT, True, []),
        (PLACE, True, []),
        (UNREAD, False, []),
    ],
)
def test_of_others_samples_and_attitudes_are_of_no_use(message_id, is_read, reasons):
    bench = Bench()
    assert bench.arrives(message_id, sender=OTHER) is is_read
    assert (bench.rejected, bench.counts, bench.asked) == (reasons, {}, [])


def test_before_a_binding_every_sender_is_another():
    bench = Bench(bound=False)
    assert not bench.arrives(IMU)
    assert bench.rejected == ["before_binding"]


def test_another_autopilot_begins_without_what_was_remembered():
    bench = Bench()
    bench.needs = False
    bench.arrives(IMU)
    bench.needs = True
    bench.routing.on_binding(SimpleNamespace(address=OTHER))
    assert bench.arrives(IMU, T_NS + 1, OTHER)
    assert not bench.arrives(IMU, T_NS + 1, US)
