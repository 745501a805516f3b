"""Effects that the service requests; the daemon and the replay carry them out."""

from typing import NamedTuple

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.integrity.findings import Finding, Phase, Severity
from h2nav.wire.outbound import OutMessage


class Send(NamedTuple):
    """Put a message on the link."""

    message: OutMessage  # a message object of pymavlink's dialect
    system_id: int  # the sender's system id, which is the vehicle's once it is known


class Record(NamedTuple):
    """Write a record of flat scalars to the log.

    Attributes:
        topic: such as ``/estimate``.
        record: a NamedTuple from `h2nav.service.records`.
        t_us: autopilot time of the record; None if it has none.
    """

    topic: str
    record: tuple[object, ...]
    t_us: int | None = None


class Used(NamedTuple):
    """A sample went through the filter; log both, after everything due has been sent."""

    sample: ImuSample  # the input
    estimate: AttitudeEstimate | None  # the output; None during the alignment
    late_ns: int = 0  # lateness beyond the usual on this link


class Found(NamedTuple):
    """A finding has begun, changed, been repeated or ended: log it, and pass it to programs."""

    phase: Phase
    finding: Finding


class Notice(NamedTuple):
    """Report to people: journal, log, and (already sent separately) STATUSTEXT."""

    severity: Severity  # of the notice
    text: str  # one line
    cause: str = ""  # identifies the notice while figures and names change; default: the text


Effect = Send | Record | Used | Found | Notice
