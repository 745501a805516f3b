"""What the service wants done; the daemon and the replay carry it out."""

from typing import NamedTuple

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.integrity.findings import Finding, Phase, Severity
from h2nav.wire.outbound import OutMessage


class Send(NamedTuple):
    """Put a message on the link.

    Attributes:
        message: a message object of pymavlink's dialect.
        system_id: the sender's system id, which is the vehicle's once it is known.
    """

    message: OutMessage
    system_id: int


class Record(NamedTuple):
    """Write a record of flat scalars to the log.

    Attributes:
        topic: where it goes, such as ``/estimate``.
        record: a NamedTuple from `h2nav.service.records`.
        t_us: autopilot time that the record belongs to; None when it has none.
    """

    topic: str
    record: tuple[object, ...]
    t_us: int | None = None


class Used(NamedTuple):
    """A sample went through the filter; log both, after everything that has to leave was sent.

    Attributes:
        sample: what went in.
        estimate: what came out; None during the alignment.
        late_ns: how late it is, beyond what is usual on this link.
    """

    sample: ImuSample
    estimate: AttitudeEstimate | None
    late_ns: int = 0


class Found(NamedTuple):
    """A finding has begun, has changed, goes on, or has ended: log it, and show it to programs."""

    phase: Phase
    finding: Finding


class Notice(NamedTuple):
    """Report to people: journal, log, and (already sent separately) STATUSTEXT.

    Attributes:
        severity: of it.
        text: one line.
        cause: stays the same while figures and names in the text change; the text by default.
    """

    severity: Severity
    text: str
    cause: str = ""


Effect = Send | Record | Used | Found | Notice
