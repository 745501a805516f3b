"""Signing of one link in the daemon: admission, reports and records of rejected frames."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from h2nav.apps.configuration import SigningSettings
from h2nav.files.signing_keys import read_signing_key
from h2nav.files.stamp_file import StampKeeper
from h2nav.integrity.findings import Severity
from h2nav.service.effects import Notice
from h2nav.wire.deframer import Frame
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.signing import (
    MAX_STREAMS,
    Denial,
    SignatureChecker,
    Signer,
    without_signature,
)

TELL_AGAIN_NS = 60_000_000_000
RECORD_WINDOW_NS = 1_000_000_000
RECORDED_PER_WINDOW = 50
"""Rejected frames recorded per second: enough as evidence, too few to fill the disk."""
CLOSE_WITHIN_S = 1.5

CAUSES = {
    Denial.MAVLINK_1: "it is MAVLink 1, which cannot be signed; set its sender to MAVLink 2",
    Denial.UNSIGNED: "it is not signed; give its sender the key",
    Denial.SETUP_SIGNING: "keys are not taken from the network, only from signing.key_file",
    Denial.BAD_SIGNATURE: "its signature is wrong; has its sender the same key?",
    Denial.REFLECTED: "it is one of our own; it is sent back to us, or another sender uses our "
    "component id and signing.link_id",
    Denial.REPLAYED: "its time stamp is not later than the one before; it is a replay, or two "
    "senders share their ids and link id",
    Denial.OLD_STAMP: "its time stamp is over a minute behind ours; it is a replay, or its "
    "sender's clock is behind",
    Denial.TOO_MANY_STREAMS: f"{MAX_STREAMS} senders are known already; restart h2nav to forget "
    "those that have left",
}


class SigningRecord(NamedTuple):
    """Counters of the frames of a link whose traffic must be signed, since start.

    Attributes:
        signed: admitted with a valid signature.
        accepted_unsigned: admitted without one, by `signing.accept_unsigned`.
        mavlink_1: rejected: MAVLink 1.
        unsigned: rejected: no signature.
        setup_signing: rejected and not recorded: SETUP_SIGNING, signed or not.
        bad_signature: rejected: made with another key, or changed in transit.
        reflected: rejected: a frame of our own.
        replayed: rejected: stamp not later than the last of its stream.
        old_stamp: rejected: first of its stream and over a minute behind our stamp.
        too_many_streams: rejected: first of its stream and the table is full.
        streams: known senders, by system, component and link id.
        stamp_ahead_s: our time stamp minus the host's clock.
    """

    signed: int
    accepted_unsigned: int
    mavlink_1: int
    unsigned: int
    setup_signing: int
    bad_signature: int
    reflected: int
    replayed: int
    old_stamp: int
    too_many_streams: int
    streams: int
    stamp_ahead_s: float


class Sorted(NamedTuple):
    """Frames of one arrival, sorted."""

    admitted: list[Frame]  # frames to process, in order
    received: bytes  # their bytes for the recording, without signatures
    refused: bytes  # bytes of the rejected frames to record
    notices: list[Notice]  # for the operator


class LinkSigning:
    """Verifies incoming frames of a link and signs outgoing ones.

    Attributes:
        signer: for the `Encoder` of the link.

    Args:
        settings: with a key file.

    Raises:
        BadInput: the key is not usable.
    """

    def __init__(
        self, settings: SigningSettings, unix_ns: Callable[[], int] = time.time_ns
    ) -> None:
        key = read_signing_key(Path(settings.key_file))
        self._keeper = StampKeeper(Path(settings.state_file), unix_ns)
        stamp = self._stamp = self._keeper.stamp
        self.signer = Signer(key, settings.link_id, stamp)
        self._checker = SignatureChecker(
            key, stamp, settings.unsigned_ids(), own_streams=self.signer.streams
        )
        self._counts: Counter[str] = Counter()
        self._reported_ns: dict[Denial, int] = {}
        self._window_ns = 0
        self._window_frames = 0

    def would_admit(self, frame: Frame) -> bool:
        """Whether a frame would be admitted now; changes nothing."""
        return self._checker.would_admit(frame)

    def would_answer(self, frame: Frame) -> bool:
        """Whether outgoing frames may go to the sender of a frame; changes nothing."""
        return self._checker.would_answer(frame)

    def turned_away(self, t_ns: int, frame: Frame) -> list[Notice]:
        """Counts the frame of a sender that gets no reply; returns notices."""
        return self._refuse(t_ns, frame, self._checker.objection(frame) or Denial.UNSIGNED)

    def sort(self, t_ns: int, frames: list[Frame]) -> Sorted:
        """Sorts frames into admitted and rejected ones."""
        admitted: list[Frame] = []
        refused: list[bytes] = []
        notices: list[Notice] = []
        for frame in frames:
            refusal = self._checker.admit(frame)
            if refusal is None:
                self._counts["signed" if frame.signed else "accepted_unsigned"] += 1
                admitted.append(frame)
                continue
            if self._is_recorded(t_ns, refusal):
                refused.append(without_signature(frame.raw))
            notices += self._refuse(t_ns, frame, refusal)
        received = b"".join(without_signature(frame.raw) for frame in admitted)
        return Sorted(admitted, received, b"".join(refused), notices)

    def notices(self) -> list[Notice]:
        """Problems with the file of the time stamp, once each."""
        return [
            Notice(Severity.ERROR if is_error else Severity.NOTICE, text)
            for is_error, text in self._keeper.notices()
        ]

    def record(self) -> SigningRecord:
        """The counters so far."""
        return SigningRecord(
            signed=self._counts["signed"],
            accepted_unsigned=self._counts["accepted_unsigned"],
            **{str(refusal): self._counts[refusal] for refusal in Denial},
            streams=self._checker.streams,
            stamp_ahead_s=self._stamp.ahead_s,
        )

    def close(self) -> None:
        """Stores the time stamp."""
        self._keeper.close(CLOSE_WITHIN_S)

    def _is_recorded(self, t_ns: int, refusal: Denial) -> bool:
        if refusal is Denial.SETUP_SIGNING:  # it holds a key
            return False
        if t_ns - self._window_ns >= RECORD_WINDOW_NS:
            self._window_ns, self._window_frames = t_ns, 0
        self._window_frames += 1
        return self._window_frames <= RECORDED_PER_WINDOW

    def _refuse(self, t_ns: int, frame: Frame, refusal: Denial) -> list[Notice]:
        """Counts a frame; reports its cause at most once a minute."""
        self._counts[refusal] += 1
        reported_ns = self._reported_ns.get(refusal)
        if reported_ns is not None and t_ns - reported_ns < TELL_AGAIN_NS:
            return []
        self._reported_ns[refusal] = t_ns
        return [self._notice(frame, refusal)]

    def _notice(self, frame: Frame, refusal: Denial) -> Notice:
        name = LAYOUTS[frame.msg_id].name
        count = self._counts[refusal]
        so_far = f" ({count} of this kind so far)" if count > 1 else ""
        text = f"{name} of {frame.sysid}/{frame.compid} refused: {CAUSES[refusal]}{so_far}"
        return Notice(Severity.WARNING, text)
