"""The distribution that flights are drawn from: one range per key of a draw, in one file.

A range is one of

    {uniform: [low, high]}     {log: [low, high]}     {choice: [value, ...]}
    {value: constant}

and, with ``chance: p`` beside it, holds in a share p of the flights; the others are nominal.
"""

import dataclasses
import math
import zlib
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from h2nav.errors import BadInput
from h2nav.evaluation.campaign.blame import SCORED_FAULTS
from h2nav.evaluation.campaign.draw import MAX_FAULTS, OF_COMPASS, SECTIONS, Draw
from h2nav.files.plain_yaml import read_mapping
from h2nav.sim.faults import FAULT_KINDS
from h2nav.validation import Within, key_complaints

EXACT = ("choice", "value")  # whose values are drawn as they stand
FORMS = ("uniform", "log", *EXACT)
FaultLength = Annotated[float, Within(1.0, 14_400.0)]
FAULTS = "faults"
FAULT_KEYS = ("count", "length_s", "kinds")
# A fault begins when the flight has settled, and leaves time to be told.
SETTLED_S, LAST_S = 30.0, 20.0
DIGITS = 4


class Range(NamedTuple):
    """How one value is drawn."""

    form: str  # of FORMS
    values: tuple[Any, ...]  # of its form: two ends, the choices, or the one value
    chance: float = 1.0  # share of the flights in which it holds

    def drawn(self, random: np.random.Generator, nominal: Any) -> Any:
        """One value; the nominal one by chance."""
        holds, at = random.random(2)
        if holds >= self.chance:
            return nominal
        if self.form in EXACT:
            return self.values[int(at * len(self.values))]
        low, high = self.values
        value = low * (high / low) ** at if self.form == "log" else low + (high - low) * at
        return min(max(_rounded(value), low), high)


class Distribution(NamedTuple):
    """Where flights are drawn from."""

    sections: dict[str, dict[str, Range]]  # section -> key -> range
    fault_count: Range
    fault_length_s: Range
    fault_sizes: dict[str, Range | None]  # name -> range of its argument; None without one

    def draw(self, seed: int) -> Draw:
        """The flight of a seed; each key has random numbers of its own."""
        parts = {
            name: SECTIONS[name](
                **{
                    key: ranged.drawn(_random(seed, f"{name}.{key}"), getattr(nominal, key))
                    for key, ranged in ranges.items()
                }
            )
            for name, ranges in self.sections.items()
            for nominal in (SECTIONS[name](),)
        }
        draw = Draw(seed, **parts)
        return dataclasses.replace(draw, faults=self._faults(draw))

    def _faults(self, draw: Draw) -> tuple[str, ...]:
        random = _random(draw.seed, FAULTS)
        count = self.fault_count.drawn(random, 0)
        names = sorted(self.fault_sizes)
        chosen = random.permutation(len(names))[:count]
        earliest_s = draw.flight.rest_s + SETTLED_S
        texts = []
        for place in chosen.tolist():
            name = names[place]
            has_compass = min(draw.imu.count, draw.compass.count)
            several = has_compass if name.startswith(OF_COMPASS) else draw.imu.count
            imu = 1 + int(random.random() * several)
            length_s = float(self.fault_length_s.drawn(random, 30.0))
            latest_s = max(draw.length_s - length_s - LAST_S, earliest_s)
            start_s = earliest_s + random.random() * (latest_s - earliest_s)
            sizes = self.fault_sizes[name]
            usual = FAULT_KINDS[name].default
            size = "" if sizes is None else f"={sizes.drawn(random, usual):g}"
            of_imu = f"/{imu}" if FAULT_KINDS[name].of_imu else ""
            if several:
                texts.append(f"{name}{size}@{start_s:.1f}+{length_s:g}{of_imu}")
        return tuple(texts)


def _random(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _rounded(x: float) -> float:
    """To a few digits, so that a printed draw is the same draw."""
    return float(f"{x:.{DIGITS}g}")


def read_distribution(path: Path) -> Distribution:
    """Reads a distribution; every key of a draw must have its range.

    Raises:
        BadInput: one line per error, with file, key and remedy.
    """
    place, content = str(path), read_mapping(path)
    known = (*SECTIONS, FAULTS)
    complaints = key_complaints(content, known, known, place)
    sections = {
        name: _section(name, content.get(name), place, complaints)
        for name in SECTIONS
        if name in content
    }
    faults = content.get(FAULTS, {})
    if not isinstance(faults, dict) or not isinstance(faults.get("kinds", {}), dict):
        complaints.append(f"{place}: {FAULTS}: expected count, length_s and kinds")
        raise BadInput(*complaints)
    complaints += key_complaints(faults, FAULT_KEYS, FAULT_KEYS, place, f"{FAULTS}.")
    count = _range(faults.get("count"), f"{place}: {FAULTS}.count", complaints)
    length_s = _range(faults.get("length_s"), f"{place}: {FAULTS}.length_s", complaints)
    if count is not None and not (
        count.form in EXACT
        and all(type(one) is int and 0 <= one <= MAX_FAULTS for one in count.values)
    ):
        complaints.append(f"{place}: {FAULTS}.count: expected choices from 0 to {MAX_FAULTS}")
    if length_s is not None:
        length_s = _of_kind(length_s, FaultLength, f"{place}: {FAULTS}.length_s", complaints)
    kinds = _fault_sizes(faults.get("kinds", {}), f"{place}: {FAULTS}.kinds", complaints)
    if complaints or count is None or length_s is None:
        raise BadInput(*complaints)
    return Distribution(sections, count, length_s, kinds)


def _section(name: str, content: Any, place: str, complaints: list[str]) -> dict[str, Range]:
    """The ranges of a section; what a value may be is what a draw allows."""
    if not isinstance(content, dict):
        complaints.append(f"{place}: {name}: expected a section of keys and ranges")
        return {}
    hints = get_type_hints(SECTIONS[name], include_extras=True)
    complaints += key_complaints(content, hints, list(hints), place, f"{name}.")
    ranges = {}
    for key in (key for key in hints if key in content):
        where = f"{place}: {name}.{key}"
        found = _range(content[key], where, complaints)
        if found is not None:
            ranges[key] = _of_kind(found, hints[key], where, complaints)
    return ranges


def _of_kind(found: Range, hint: Any, where: str, complaints: list[str]) -> Range:
    """The range with its values in the type of the key, and within the key's limits."""
    kind, *limits = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    values = found.values
    if kind is float:
        values = tuple(float(v) if type(v) is int else v for v in values)
    if any(type(v) is not kind for v in values):
        complaints.append(f"{where}: expected values that are {kind.__name__}, found {values}")
        return found
    if kind is not float and found.form not in EXACT:
        complaints.append(f"{where}: {found.form}: expected {' or '.join(EXACT)}")
    for limit in limits:
        expected = [text for v in values if (text := limit.complaint(v)) is not None]
        complaints += [f"{where}: expected {text}" for text in expected[:1]]
    return found._replace(values=values)


def _range(content: Any, where: str, complaints: list[str]) -> Range | None:
    if content is None:
        return None
    forms = [form for form in FORMS if isinstance(content, dict) and form in content]
    if len(forms) != 1 or content.keys() - {forms[0], "chance"}:
        complaints.append(f"{where}: expected one of {', '.join(FORMS)}, and perhaps chance")
        return None
    form = forms[0]
    values = [content[form]] if form == "value" else content[form]
    if not isinstance(values, list) or not values:
        complaints.append(f"{where}: {form}: expected a list")
        return None
    chance = content.get("chance", 1.0)
    if not isinstance(chance, int | float) or not 0.0 <= chance <= 1.0:
        complaints.append(f"{where}: chance: expected a number from 0 to 1, found {chance!r}")
        return None
    if form in ("uniform", "log") and not _is_interval(values, form):
        above = " above 0" if form == "log" else ""
        complaints.append(f"{where}: {form}: expected two rising numbers{above}, found {values}")
        return None
    return Range(form, tuple(values), float(chance))


def _is_interval(values: list[Any], form: str) -> bool:
    is_pair = len(values) == 2 and all(type(v) in (int, float) for v in values)
    return (
        is_pair
        and all(map(math.isfinite, values))
        and (form != "log" or values[0] > 0)
        and (values[0] < values[1])
    )


def _fault_sizes(
    content: dict[str, Any], where: str, complaints: list[str]
) -> dict[str, Range | None]:
    sizes: dict[str, Range | None] = {}
    for name, ranged in content.items():
        own = f"{where}.{name}"
        if name not in SCORED_FAULTS:
            complaints.append(f"{own}: no such fault; one of {', '.join(SCORED_FAULTS)}")
            continue
        kind, size = FAULT_KINDS[name], _range(ranged, own, complaints)
        if size is not None and kind.choices:
            complaints.append(f"{own}: it has no size; leave out {size.form}")
        elif size is not None:
            size = _of_kind(size, Annotated[float, Within(kind.low, kind.high)], own, complaints)
        sizes[name] = size
    return sizes
