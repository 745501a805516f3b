"""A motion estimator"""

CHANGES = {
    "h2nav/service/motion_made.py": '''\
"""A made one: it counts samples."""

from collections import Counter

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.service.effects import Effect, Record
from h2nav.service.motion_records import MadeRecord
from h2nav.service.requested_stream import WantedStream
from h2nav.wire.readers import Envelope


class MadeMotion:
    """Counts samples."""

    is_estimated = True
    message_ids: frozenset[int] = frozenset()
    wanted_streams: tuple[WantedStream, ...] = ()

    def __init__(self) -> None:
        self.rejected: Counter[str] = Counter()
        self._count = 0

    def on_message(self, _envelope: Envelope, _measured: object) -> list[Effect]:
        """It needs none."""
        return []

    def on_refusal(self, _envelope: Envelope, _reason: str) -> list[Effect]:
        """It needs none."""
        return []

    def on_sample(
        self, _t_ns: int, sample: ImuSample, _estimate: AttitudeEstimate | None
    ) -> list[Effect]:
        """Tells how many have come."""
        self._count += 1
        return [Record("/made", MadeRecord(sample.t_us, self._count))]

    def restart(self) -> None:
        """Counts from 0 again."""
        self._count = 0
''',
    "h2nav/service/motion.py": (
        (
            "from h2nav.service.motion_output import",
            """\
from h2nav.service.motion_made import MadeMotion
from h2nav.service.motion_output import""",
        ),
        (
            "    return NoMotion()\n",
            """\
    if motion.estimator == "made":
        return MadeMotion()
    return NoMotion()
""",
        ),
    ),
    "h2nav/service/motion_records.py": (
        (
            "class TwistRecord(NamedTuple):",
            '''\
class MadeRecord(NamedTuple):
    """A made one."""

    t_us: int
    samples: int


class TwistRecord(NamedTuple):''',
        ),
    ),
    "h2nav/service/settings.py": (
        ('OneOf(("none", "twist", "wheels"))', 'OneOf(("none", "twist", "wheels", "made"))'),
    ),
}

if __name__ == "__main__":
    from dataclasses import replace

    from h2nav.apps.configuration import Configuration
    from h2nav.attitude.samples import ImuSample
    from h2nav.service.motion import motion_for

    usual = Configuration().service
    chosen = replace(usual, motion=replace(usual.motion, estimator="made"))
    made = motion_for(chosen, None, None, None, 0)
    sample = ImuSample(7, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8))
    told = [made.on_sample(0, sample, None)[0].record for _ in range(2)]
    assert [(one.t_us, one.samples) for one in told] == [(7, 1), (7, 2)]
