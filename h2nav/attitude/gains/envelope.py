"""The envelope of gain files of all kinds.

A gain file is YAML; `parse_gain_file` takes plain mappings, so nothing here opens a file.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from h2nav.errors import BadInput
from h2nav.validation import Within, key_complaints, numbers_within

FORMAT = "h2nav-gains/1"
KINDS = ("velocity_aided", "two_stage")
# Gain files are shipped per class; which vehicles are of which: `service.autopilot`.
VEHICLE_CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")
# kinds of older files
FORMER_KINDS = {"shaped": "velocity_aided"}
MAX_RATE_HZ = 4000.0
_SECTIONS = ("model", "gains", "methods", "certificate", "fixed_point")
_ENVELOPE = ("format", "kind", "name", "rate_hz", *_SECTIONS, "made_by")


@dataclass(frozen=True, slots=True)
class GainFile:
    """The common envelope of gain files."""

    kind: str  # as in the file, one of `KINDS` or `FORMER_KINDS`
    name: str  # unique among the shipped files
    rate_hz: float  # sample rate for which the gains are optimal
    model: Mapping[str, object]  # the physical inputs, units in the key names
    gains: Mapping[str, object]  # for the filter, complete in themselves
    methods: Mapping[str, object]  # gain and H2 norm per synthesis method
    certificate: Mapping[str, object]  # for `h2nav certify`
    fixed_point: Mapping[str, object]  # the integer image of the gains
    made_by: str  # program and version

    @property
    def filter_name(self) -> str:
        """The filter of the gains."""
        return FORMER_KINDS.get(self.kind, self.kind)


def parse_gain_file(document: object, place: str) -> GainFile:
    """The envelope of a gain file, strictly checked; its sections stay plain mappings.

    Args:
        document: the file as mappings, lists and scalars.
        place: the file's name, for errors.

    Raises:
        BadInput: one line per error, each naming the file and the key.
    """
    if not isinstance(document, Mapping):
        raise BadInput(f"{place}: expected a mapping that begins with format: {FORMAT}")
    if document.get("format") != FORMAT:
        raise BadInput(
            f"{place}: format: expected {FORMAT}, found {document.get('format')!r}; "
            "make the file again with h2nav synthesize"
        )
    errors = key_complaints(document, _ENVELOPE, _ENVELOPE, place)
    if "kind" in document and document["kind"] not in (*KINDS, *FORMER_KINDS):
        errors.append(f"{place}: kind: expected one of {', '.join(KINDS)}")
    errors += [
        f"{place}: {key}: expected a text that is not empty"
        for key in ("name", "made_by")
        if key in document and (not isinstance(document[key], str) or not document[key])
    ]
    errors += [
        f"{place}: {key}: expected a mapping"
        for key in _SECTIONS
        if key in document and not isinstance(document[key], Mapping)
    ]
    numbers = numbers_within(document, {"rate_hz": Within(1.0, MAX_RATE_HZ)}, errors, place)
    if errors:
        raise BadInput(*errors)
    return GainFile(
        kind=document["kind"],
        name=document["name"],
        rate_hz=numbers["rate_hz"],
        made_by=document["made_by"],
        **{section: document[section] for section in _SECTIONS},
    )
