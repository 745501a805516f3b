"""Any recording as a log of h2nav: the file itself, or the log of its replay."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.errors import BadInput, TaskFailed
from h2nav.integrity.severity import Severity
from h2nav.log.magic import is_mcap
from h2nav.log.progress import Progress
from h2nav.wire.deframer import Frame


@contextmanager
def as_log(path: Path, progress: Progress) -> Iterator[Path]:
    """Yields an MCAP of the recording; a temporary one is deleted after the block.

    Args:
        path: of any kind that `h2nav replay` accepts.
        progress: called with the bytes of the recording done and the total.

    Raises:
        BadInput: not a recording.
        TaskFailed: the disk has no room for it.
    """
    if not path.is_file() or is_mcap(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="h2nav-") as folder:
        log = Path(folder) / f"{path.stem}.mcap"
        _replayed(path, log, progress)
        try:
            yield log
        except BadInput as error:
            # The name of a temporary file would mean nothing to the user.
            lines = (line.replace(str(log), str(path)) for line in error.lines)
            raise BadInput(*lines) from error


def _replayed(path: Path, log: Path, progress: Progress) -> None:
    from h2nav.apps import playback
    from h2nav.apps.log_contents import attach_inputs
    from h2nav.log.recorder import Recorder
    from h2nav.recordings.opening import open_flight

    recording = open_flight(path)
    inputs = playback.inputs_for(recording, playback.PlaybackOptions())
    recorder = Recorder.to_file(log, recording.unix_offset_ns)
    try:
        attach_inputs(recorder, inputs.configuration, inputs.filters, inputs.unix_s)
        pipeline = playback.pipeline_for(recording, inputs, recorder, _Silent())
        played = playback.Playback(recording, whole_frames=inputs.whole_frames)
        for _ in played.through(pipeline):
            progress(*recording.progress)
    finally:
        recorder.close()
    if recorder.trouble is not None:
        raise TaskFailed(
            f"{path}: its replay cannot be written: {recorder.trouble}; name a folder with more "
            "room in TMPDIR"
        )


class _Silent:
    """Ignores everything: the log has it."""

    message_ids: frozenset[int] = frozenset()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Not called."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """It is in the log."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """It is in the log."""
