"""The fake autopilot as a byte stream: encoded, sent over an optionally bad line; no I/O."""

from typing import NamedTuple

from h2nav.sim.autopilot import IDENTITY, FakeAutopilot, Outgoing
from h2nav.sim.delivery import Delivery
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.signing import SignatureChecker, Signer

LONGEST_CATCH_UP_NS = 500_000_000


class AutopilotSigning(NamedTuple):
    """MAVLink 2 signing of the vehicle's links."""

    signer: Signer  # signs everything that the vehicle sends
    # checks incoming frames; rejected ones are neither obeyed nor forwarded
    checker: SignatureChecker


class AutopilotBytes:
    """Connects a fake autopilot to codec and delivery.

    Args:
        start_ns: host time at which its power is switched on.
        links: number of links; all carry the same.
        signing: of all links; None = frames are neither signed nor verified.
    """

    def __init__(
        self,
        autopilot: FakeAutopilot,
        start_ns: int,
        links: int = 1,
        signing: AutopilotSigning | None = None,
    ) -> None:
        self._autopilot = autopilot
        self._signing = signing
        self._delivery = Delivery(autopilot.schedule, autopilot.options.seed, start_ns)
        self._deframers = [Deframer() for _ in range(links)]
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._sent: dict[str, int] = {}
        self._heard = 0
        self._refused = 0
        self._frames = 0
        self._bytes = 0
        # Power is on from now, even if the link is not up yet.
        self._collect(autopilot.advance(start_ns))

    @property
    def next_deadline_ns(self) -> int:
        """When `advance` returns the next frame."""
        arrival_ns = self._delivery.next_deadline_ns
        due_ns = self._autopilot.next_deadline_ns
        return due_ns if arrival_ns is None else min(arrival_ns, due_ns)

    @property
    def reboots(self) -> int:
        """Number of reboots of the autopilot."""
        return self._autopilot.reboots

    def received(self, t_ns: int, data: bytes, link: int = 0) -> list[bytes]:
        """Takes bytes from a link at host time `t_ns`.

        Returns:
            The frames among them that an autopilot forwards to its other links: all except its own.
        """
        forwarded = []
        for frame in self._deframers[link].feed(data):
            if self._signing is not None and self._signing.checker.admit(frame) is not None:
                self._refused += 1
                continue
            self._heard += 1
            fields = decode(frame)
            self._autopilot.on_message(t_ns, frame.sysid, frame.compid, frame.msg_id, fields)
            target = (getattr(fields, "target_system", 0), getattr(fields, "target_component", 0))
            if target != IDENTITY:
                forwarded.append(frame.raw)
        return forwarded

    def advance(self, t_ns: int) -> list[bytes]:
        """Returns frames (and other bytes) that reach the link until `t_ns`, in order."""
        self._collect(self._autopilot.advance(t_ns))
        arrived = self._delivery.take(t_ns)
        self._frames += len(arrived)
        self._bytes += sum(map(len, arrived))
        return arrived

    def skip_if_late(self, t_ns: int) -> None:
        """Skips what is overdue by more than `LONGEST_CATCH_UP_NS`, instead of a burst."""
        if t_ns - self._autopilot.next_deadline_ns > LONGEST_CATCH_UP_NS:
            self._autopilot.skip_to(t_ns)

    def counts(self) -> dict[str, object]:
        """Statistics, for people and tests."""
        return {
            "messages": dict(sorted(self._sent.items())),
            "frames_sent": self._frames,
            "bytes_sent": self._bytes,
            "frames_heard": self._heard,
            "frames_refused": self._refused,
            "reboots": self._autopilot.reboots,
            "streams_put_off": self._autopilot.streams.put_off,
            **self._delivery.counts,
        }

    def _collect(self, outgoing: list[Outgoing]) -> None:
        for item in outgoing:
            if isinstance(item.message, bytes):
                self._delivery.put(item.t_ns, item.message)
                continue
            sender = (item.sysid, item.compid)
            if sender not in self._encoders:
                signer = None if self._signing is None else self._signing.signer
                self._encoders[sender] = Encoder(*sender, signer=signer)
            name = item.message.get_type()
            self._sent[name] = self._sent.get(name, 0) + 1
            self._delivery.put(item.t_ns, self._encoders[sender].encode(item.message))
