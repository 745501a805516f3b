"""The fake autopilot as bytes: deadlines, what is forwarded, what is refused, what is counted."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from signing_peer import KEY, Clock, Peer

from h2nav.apps.autopilot_bytes import AutopilotBytes, AutopilotSigning
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import parse_fault
from h2nav.sim.scenarios import scenario
from h2nav.wire.deframer import Deframer
from h2nav.wire.signing import LocalStamp, SignatureChecker, Signer

START_NS = 5_000_000_000
MS = 1_000_000


def vehicle(*faults, links=1, signing=None, **options):
    given = AutopilotOptions(scenario("rest"), faults=tuple(map(parse_fault, faults)), **options)
    return AutopilotBytes(FakeAutopilot(given), START_NS, links, signing)


def packed(message, system=255, component=190):
    return message.pack(mavlink.MAVLink(None, system, component))


HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def to(system, component):
    return mavlink.MAVLink_param_request_read_message(system, component, b"AHRS_TRIM_X", -1)


def test_power_is_on_from_the_start_and_the_first_frames_are_due_then():
    one = vehicle()
    assert one.next_deadline_ns == START_NS
    first = one.advance(START_NS)
    frames = Deframer().feed(b"".join(first))
    assert frames[0].msg_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
    assert one.next_deadline_ns > START_NS
    assert one.advance(one.next_deadline_ns - 1) == []
    assert one.advance(one.next_deadline_ns) != []


def test_a_delayed_frame_is_a_deadline_too():
    one = vehicle("delay=1000@0")
    assert one.advance(START_NS) == []
    due_ns = one.next_deadline_ns
    assert START_NS < due_ns < START_NS + 1000 * MS
    assert one.advance(due_ns - 1) == []
    assert len(one.advance(due_ns)) >= 1


@pytest.mark.parametrize(
    ("message", "is_forwarded"),
    [
        (HEARTBEAT, True),  # to all
        (to(1, 1), False),  # to the autopilot
        (to(1, 2), True),
        (to(2, 1), True),
        (to(0, 0), True),
    ],
)
def test_all_but_its_own_is_forwarded_as_it_came(message, is_forwarded):
    one = vehicle(links=2)
    data = packed(message)
    for link in (0, 1):
        assert one.received(START_NS, data, link) == [data] * is_forwarded
    assert one.counts()["frames_heard"] == 2


def test_each_link_has_its_own_stream():
    one = vehicle(links=2)
    data = packed(HEARTBEAT)
    assert one.received(START_NS, data[:5], 0) == []
    assert one.received(START_NS, data, 1) == [data]
    assert one.received(START_NS, data[5:], 0) == [data]
    assert one.received(START_NS, data * 2) == [data, data]


def test_what_is_asked_of_it_is_answered():
    one = vehicle()
    one.advance(START_NS)
    one.received(START_NS, packed(to(1, 1)))
    frames = Deframer().feed(b"".join(one.advance(START_NS)))
    assert mavlink.MAVLINK_MSG_ID_PARAM_VALUE in [frame.msg_id for frame in frames]


def test_with_a_key_what_is_not_signed_is_neither_obeyed_nor_forwarded():
    clock = Clock()
    stamp = LocalStamp(clock)
    one = vehicle(signing=AutopilotSigning(Signer(KEY, 0, stamp), SignatureChecker(KEY, stamp)))
    frames = Deframer().feed(b"".join(one.advance(START_NS)))
    assert frames
    assert all(frame.signed for frame in frames)
    peer = Peer()
    assert one.received(START_NS, peer.raw(HEARTBEAT, signed=False)) == []
    assert one.counts()["frames_refused"] == 1
    assert one.counts()["frames_heard"] == 0
    signed = peer.raw(HEARTBEAT)
    assert one.received(START_NS, signed) == [signed]
    assert (one.counts()["frames_refused"], one.counts()["frames_heard"]) == (1, 1)


@pytest.mark.parametrize(("late_ms", "is_skipped"), [(500, False), (501, True)])
def test_what_is_overdue_by_more_than_half_a_second_is_skipped(late_ms, is_skipped):
    one = vehicle()
    one.advance(START_NS)
    due_ns = one.next_deadline_ns
    one.skip_if_late(due_ns + late_ms * MS)
    assert (one.next_deadline_ns > due_ns) == is_skipped


def test_everything_is_counted():
    one = vehicle("reboot@0.5")
    data = [frame for ms in range(0, 2000, 10) for frame in one.advance(START_NS + ms * MS)]
    counts = one.counts()
    assert counts["frames_sent"] == len(data)
    assert counts["bytes_sent"] == sum(map(len, data))
    assert counts["reboots"] == one.reboots == 1
    assert counts["messages"]["HEARTBEAT"] == len([
        frame for frame in Deframer().feed(b"".join(data))
        if frame.msg_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
    ])  # fmt: skip
    assert list(counts["messages"]) == sorted(counts["messages"])
    assert (counts["dropped"], counts["streams_put_off"]) == (0, 0)


def test_text_at_power_on_is_no_frame_and_no_message():
    one = vehicle(boot_text=True)
    data = b"".join(one.advance(START_NS))
    assert not data.startswith(b"\xfd")
    assert len(Deframer().feed(data)) == sum(one.counts()["messages"].values())
