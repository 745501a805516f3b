"""An MCAP file being written: valid up to its last whole record at any moment."""

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import CompressionType, Writer

from h2nav import __version__
from h2nav.attitude.samples import Quat
from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log.folder import ACTIVE_SUFFIX, LOG_MODE
from h2nav.log.foxglove_messages import AttitudeMessages, log_message, protobuf_schemas
from h2nav.log.schema import RecordFormat, record_format

CHUNK_BYTES = 128 * 1024
RAW_ENCODING = "mavlink"
LATEST_NS = 2**64 - 1


class Attachment(NamedTuple):
    """A file inside the log, such as the configuration."""

    name: str
    media_type: str
    data: bytes


@contextmanager
def new_file(path: Path, mode: str = "xb") -> Iterator[Any]:
    """Opens a new file that the user has named; it is removed if the block raises.

    Raises:
        BadInput: it exists, or cannot be created.
    """
    try:
        stream = path.open(mode)
    except FileExistsError:
        raise BadInput(f"{path}: exists; name another file with -o") from None
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; name another file with -o") from error
    try:
        with stream:
            yield stream
    except BaseException:
        path.unlink(missing_ok=True)
        raise


class LogFile:
    """Writes ``<path>.active``; `close` adds the index and renames the file.

    A descriptor with an exclusive lock stays open, so that another process can tell a file in use
    from one left over. Every method may raise OSError; after that only `abandon` may be called.
    """

    def __init__(self, path: Path) -> None:
        """Creates the file; FileExistsError when it, or the finished log, exists."""
        self.path = path
        self.active_path = path.with_name(path.name + ACTIVE_SUFFIX)
        if path.exists():
            raise FileExistsError(17, "a log of that name exists", str(path))
        self._disk = _Disk(self.active_path)
        self._writer = Writer(
            self._disk,  # type: ignore[arg-type]
            CHUNK_BYTES,
            CompressionType.ZSTD,
            # The library writes offsets of empty groups too, which is an error in the file.
            use_summary_offsets=False,
        )
        self._channels: dict[str, int] = {}
        self._formats: dict[tuple[str, type], tuple[int, RecordFormat]] = {}
        self._attitude = AttitudeMessages()
        self._sequence = 0
        self._saved = 0
        self._saved_at = 0
        try:
            self._writer.start("", f"h2nav {__version__}")
        except OSError:
            self.abandon()
            self.active_path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes on disk, without the unfinished chunk."""
        return self._disk.position

    @property
    def written(self) -> int:
        """Number of messages on disk and in the unfinished chunk."""
        return self._sequence

    @property
    def unsaved(self) -> int:
        """Number of messages in the unfinished chunk."""
        return self._sequence - self._saved

    def attach(self, attachment: Attachment, unix_ns: int) -> None:
        """Adds a file to the log."""
        name, media_type, data = attachment
        name.encode()  # raises here, not in the library in the middle of a record
        self._writer.add_attachment(unix_ns, unix_ns, name, media_type, data)

    def describe(self, name: str, mapping: Mapping[str, str]) -> None:
        """Adds named texts (MCAP metadata)."""
        texts = {key: text.encode(errors="replace").decode() for key, text in mapping.items()}
        self._writer.add_metadata(name, texts)

    def add_raw(self, topic: str, unix_ns: int, data: bytes) -> None:
        """Adds bytes of a link unchanged."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channel(topic, RAW_ENCODING, 0)
            self._channels[topic] = channel
        self._add(channel, data, unix_ns, unix_ns)

    def add_record(self, topic: str, record: Any, unix_ns: int, publish_ns: int) -> None:
        """Adds a record of flat scalars; raises TypeError for anything else."""
        key = (topic, type(record))
        known = self._formats.get(key)
        if known is None:
            known = self._formats[key] = self._register(topic, record_format(type(record)))
        channel, form = known
        self._add(channel, form.encode(record), unix_ns, publish_ns)

    def add_formatted(self, topic: str, form: RecordFormat, record: Any, unix_ns: int) -> None:
        """Adds a record whose format is known; one format per topic."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic, form)[0]
        self._add(channel, form.encode(record), unix_ns, unix_ns)

    def add_attitude(self, unix_ns: int, q_nb: Quat) -> None:
        """Adds the attitude for viewers, as transform and as pose."""
        self._add(self._protobuf("/tf"), self._attitude.transform(unix_ns, q_nb), unix_ns, unix_ns)
        self._add(self._protobuf("/pose"), self._attitude.pose(unix_ns, q_nb), unix_ns, unix_ns)

    def add_text(self, unix_ns: int, severity: Severity, text: str) -> None:
        """Adds a line of the program's output."""
        self._add(self._protobuf("/log"), log_message(unix_ns, severity, text), unix_ns, unix_ns)

    def sync(self) -> None:
        """Ends the chunk and waits until everything is on disk."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._saved, self._saved_at = self._sequence, self._disk.position
        self._disk.sync()

    def close(self) -> Path:
        """Writes the index, syncs, removes the suffix; returns the log's path."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._saved = self._sequence
        self._disk.sync()
        os.rename(self.active_path, self.path)
        _sync_folder(self.path.parent)
        self._disk.close()
        return self.path

    def abandon(self) -> None:
        """Truncates the file after its last whole record and releases it; never raises."""
        self._disk.cut()

    def _register(self, topic: str, form: RecordFormat) -> tuple[int, RecordFormat]:
        schema = self._writer.register_schema(form.name, "jsonschema", form.schema)
        return self._channel(topic, "json", schema), form

    def _channel(self, topic: str, encoding: str, schema: int) -> int:
        topic.encode()  # raises here, not in the library in the middle of a record
        return self._writer.register_channel(topic, encoding, schema)

    def _protobuf(self, topic: str) -> int:
        channel = self._channels.get(topic)
        if channel is None:
            name, descriptors = protobuf_schemas()[topic]
            schema = self._writer.register_schema(name, "protobuf", descriptors)
            channel = self._channel(topic, "protobuf", schema)
            self._channels[topic] = channel
        return channel

    def _add(self, channel: int, data: bytes, unix_ns: int, publish_ns: int) -> None:
        if not 0 <= unix_ns <= LATEST_NS:
            raise ValueError("time outside the range of MCAP")
        if not 0 <= publish_ns <= LATEST_NS:
            publish_ns = unix_ns  # a wrong source clock must not cost the message
        self._sequence += 1
        self._writer.add_message(channel, unix_ns, data, publish_ns, self._sequence & 0xFFFFFFFF)
        if self._disk.position != self._saved_at:
            # The chunk, including this message, is full.
            self._saved, self._saved_at = self._sequence, self._disk.position


class _Disk:
    """The stream of the MCAP writer; remembers where the last whole record ends.

    The writer passes whole records only, so a write that fails halfway leaves a fragment after
    `position`, which `cut` removes.
    """

    def __init__(self, path: Path) -> None:
        flags = os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, LOG_MODE)
        self.position = 0
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _sync_folder(path.parent)
        except OSError:
            os.close(self._descriptor)
            path.unlink(missing_ok=True)
            raise

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]
        self.position += len(data)
        return len(data)

    def tell(self) -> int:
        return self.position

    def flush(self) -> None:
        """Does nothing: bytes are not buffered here."""

    def sync(self) -> None:
        os.fsync(self._descriptor)

    def close(self) -> None:
        os.close(self._descriptor)

    def cut(self) -> None:
        try:
            os.ftruncate(self._descriptor, self.position)
        except OSError:
            pass  # the fragment stays; readers skip it
        finally:
            os.close(self._descriptor)


def _sync_folder(folder: Path) -> None:
    """Makes a new or changed name in the folder survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
