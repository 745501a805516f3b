"""Arrivals side by side: what was joined comes out as it was."""

import pytest

from h2nav.wire.arrivals import Arrivals, gathered

MIB = 1 << 20
PIECES = [(5, b"abc"), (7, b""), (7, b"defg"), (20, b"h")]


def test_pieces_come_out_with_their_times():
    (one,) = gathered(iter(PIECES))
    assert (one.data, one.framed) == (b"abcdefgh", False)
    assert list(one.pieces()) == PIECES
    assert [one.piece(number) for number in range(4)] == [data for _, data in PIECES]


@pytest.mark.parametrize(("length_ns", "found"), [(0, [1, 3]), (2, [3]), (12, [3]), (13, [])])
def test_a_pause_is_longer_than_a_length(length_ns, found):
    (one,) = gathered(PIECES)
    assert one.pauses(length_ns) == found


def test_bytes_of_a_container_lie_between_arrivals():
    (made,) = gathered(PIECES)
    one = Arrivals(b"..abc.defg", made.starts[:2] + 2, made.ends[:2] + 2, made.t_ns[:2], True)
    assert list(one.pieces()) == [(5, b"abc"), (7, b"")]


@pytest.mark.parametrize(
    ("sizes", "batches"),
    [
        ([], []),
        ([MIB], [1]),
        ([MIB, MIB - 1], [2]),
        ([MIB, MIB], [2]),
        ([MIB, MIB, 1], [2, 1]),
        ([MIB, MIB - 1, 1, MIB, MIB], [3, 2]),
    ],
)
def test_a_batch_is_full_at_two_mebibytes(sizes, batches):
    block = bytes(MIB)
    pieces = [(number, block[:size]) for number, size in enumerate(sizes)]
    found = list(gathered(pieces))
    assert [len(one.t_ns) for one in found] == batches
    assert [t_ns for one in found for t_ns in one.t_ns.tolist()] == list(range(len(sizes)))
