"""Which loops a gain file of each kind vouches for."""

from collections.abc import Callable

from h2nav.attitude.gains import GainFile
from h2nav.synthesis import shaped, two_stage
from h2nav.synthesis.gain_certificate import Loop, Verdict, checked

# kind -> function from the file and its place (for errors) to the loops of its certificate.
LOOPS: dict[str, Callable[[GainFile, str], list[Loop]]] = {
    "two_stage": two_stage.loops,
    "shaped": shaped.loops,
}


def check(file: GainFile, place: str) -> Verdict:
    """What a gain file's certificate is worth.

    Args:
        file: of any kind.
        place: its path, for errors.

    Raises:
        BadInput: model or gains are not what the file's kind needs.
    """
    return checked(file, LOOPS[file.kind](file, place))
