"""A recording format"""

CHANGES = {
    "h2nav/recordings/link_recording.py": (
        (
            "def nonzero(**counts: int)",
            '''\
class MadeRecording(Recording):
    """A made one: each piece of 280 bytes arrives a second after the one before."""

    kind = "made"

    def batches(self) -> Iterator[Arrivals]:
        """All at once."""
        data = self.path.read_bytes()[4:]
        ends = np.arange(280, len(data) + 1, 280)
        yield Arrivals(data, ends - 280, ends, ends // 280 * SECOND_NS, framed=False)


def nonzero(**counts: int)''',
        ),
    ),
    "h2nav/recordings/opening.py": (
        (
            "    # An importer is loaded for its recordings only.\n",
            """\
    if start.startswith(b"MADE"):
        return MadeRecording(path)
    # An importer is loaded for its recordings only.
""",
        ),
        (
            "import Recording\n",
            "import MadeRecording, Recording\n",
        ),
    ),
}

if __name__ == "__main__":
    import tempfile
    from pathlib import Path

    from h2nav.recordings.opening import open_flight

    with tempfile.TemporaryDirectory() as place:
        log = Path(place) / "log"
        log.write_bytes(b"MADE" + bytes(3 * 280))
        opened = open_flight(log)
        assert opened.kind == "made"
        assert [t_ns for t_ns, _ in opened.received()] == [10**9, 2 * 10**9, 3 * 10**9]
