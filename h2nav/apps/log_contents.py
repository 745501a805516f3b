"""The beginning of every log: the inputs of an exact replay, and their origin."""

import math
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from h2nav import __version__
from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration, LogSettings
from h2nav.apps.filters import FilterFactory
from h2nav.attitude import native
from h2nav.errors import BadInput
from h2nav.files import plain_yaml
from h2nav.log.folder import MIB, LogLimits
from h2nav.validation import shown

if TYPE_CHECKING:  # the daemon imports this module, and needs no numpy; a replay may write no log
    from h2nav.log.recorder import Recorder
    from h2nav.recordings.link_recording import Recording


CONFIGURATION_NAME = "configuration.yaml"
GAINS_FOLDER = "gains/"
RUN_METADATA = "h2nav"
YAML_TYPE = "application/yaml"
LATEST_UNIX_S = 4_102_444_800.0  # the year 2100


def open_recorder(settings: LogSettings, unix_offset_ns: int) -> "Recorder | None":
    """Creates the daemon's log; None if none is configured."""
    if not settings.folder:
        return None
    from h2nav.log.recorder import Recorder

    return Recorder(
        Path(settings.folder),
        log_limits(settings),
        unix_offset_ns,
        decode_autopilot=settings.decode_autopilot,
    )


def log_limits(settings: LogSettings) -> LogLimits:
    """Converts the section `log` to the recorder's units."""
    return LogLimits(
        file_bytes=settings.max_file_mb * MIB,
        file_age_s=settings.max_file_minutes * 60.0,
        files=settings.max_files,
        run_bytes=settings.max_run_mb * MIB,
        free_bytes=settings.min_free_mb * MIB,
    )


def attach_inputs(
    recorder: "Recorder", chosen: Configuration, filters: FilterFactory, unix_s: float
) -> None:
    """Writes configuration, gains and provenance at the beginning of a log.

    Args:
        filters: holds the gain files.
        unix_s: the date that the run uses.
    """
    text = yaml.safe_dump(_readable(chosen.as_mapping()), sort_keys=False)
    recorder.attach(CONFIGURATION_NAME, YAML_TYPE, text.encode())
    for name, content in filters.gain_texts().items():
        recorder.attach(f"{GAINS_FOLDER}{name}", YAML_TYPE, content.encode())
    recorder.metadata(
        RUN_METADATA,
        {
            "version": __version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
            "kernels": native.backend(),
            "unix_s": repr(unix_s),
        },
    )


def _readable(value: Any) -> Any:
    """A copy with valid texts; a path may hold bytes that are not text."""
    if isinstance(value, str):
        return value.encode(errors="replace").decode()
    if isinstance(value, dict):
        return {key: _readable(one) for key, one in value.items()}
    return value


class RecordedInputs(NamedTuple):
    """The inputs of the run that made a log."""

    configuration: Configuration  # in force during the run
    gain_files: dict[str, bytes]  # attached gain files, by name
    unix_s: float  # the date that the run used
    remark: str = ""  # the replacement for a filter that no longer exists; empty for the original


def inputs_of(recording: "Recording") -> RecordedInputs | None:
    """Reads the inputs of the run that made a recording; None for another program's recording.

    Raises:
        BadInput: the log holds a configuration that this version cannot use.
    """
    attachment = recording.attachments.get(CONFIGURATION_NAME)
    if attachment is None:
        return None
    place = f"{recording.path}: {CONFIGURATION_NAME}"
    mapping, remark = _of_today(plain_yaml.parse_bytes(attachment.data, place))
    gains = {
        name.removeprefix(GAINS_FOLDER): found.data
        for name, found in recording.attachments.items()
        if name.startswith(GAINS_FOLDER)
    }
    built = configuration.build(mapping, place)
    return RecordedInputs(built, gains, _recorded_date(recording), remark)


def version_of(recording: "Recording") -> str:
    """The version of h2nav that made a recording; empty if it does not say."""
    return recording.metadata.get(RUN_METADATA, {}).get("version", "")


def _of_today(mapping: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """A log's configuration with today's filters, and a remark where one is replaced.

    The two-stage filter, which logs may request, no longer exists; until version 0.3 the
    constant-gain filter was named two_stage in fixed arithmetic.
    """
    asked = mapping.get("filter")
    if not isinstance(asked, dict):
        return mapping, ""
    former = {**asked, "gyro_sampling": "mean"} if "gyro_sampling" in asked else asked
    if asked.get("name") != "two_stage":
        return {**mapping, "filter": former}, ""
    if asked.get("arithmetic") == "fixed":
        return {**mapping, "filter": {**former, "name": "constant_gain"}}, ""
    kept = {key: former[key] for key in ("vehicle_class",) if key in former}
    remark = "recorded with the filter two_stage, which no longer exists; played with the default"
    return {**mapping, "filter": {**kept, "name": "default"}}, remark


def _recorded_date(recording: "Recording") -> float:
    """The date of the run in UNIX seconds; 0 if the log has none."""
    text = recording.metadata.get(RUN_METADATA, {}).get("unix_s", "0")
    try:
        unix_s = float(text)
    except ValueError:
        unix_s = math.nan
    if not 0.0 <= unix_s <= LATEST_UNIX_S:
        raise BadInput(
            f"{recording.path}: metadata {RUN_METADATA}: unix_s: expected UNIX seconds, found "
            f"{shown(text)}; replay with --config"
        )
    return unix_s
