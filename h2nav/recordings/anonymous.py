"""What makes a recording of a known vehicle at a known place, and what replaces it.

Positions move with the same north and east distances to another place, where the earth's field is
alike; nothing turns, because a turned flight would contradict its compass. Dates move by whole
weeks. Ids of processors become pseudonyms, paths and addresses lose their letters. The rules know
names of fields, as ArduPilot, PX4 and MAVLink spell them; `anonymous_field` has those of the
earth's field, `anonymous_logs` and `anonymous_frames` know the formats.
"""

import hashlib
import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings import anonymous_field
from h2nav.recordings.anonymous_field import BothFields

WEEK_S = 604_800
# A field that may hold a latitude, or anything else, holds one within this of the flight. What is
# a place for certain and further away comes to this distance: it may be one that is known (where
# the owner flew before, a simulator's home), and would show by how much everything moved.
NEAR_DEG = 5.0
# Nearer to 0 deg north, 0 deg east no place is: an estimate has begun there without a fix.
NULL_DEG = 1.0
DEG_E7 = 1e7
# ArduPilot's metres of a degree, and how far from its origin no vehicle of one flight is. An
# estimate whose origin was set without a fix, at 0 deg, has the place itself as its position.
DEGREE_M, DISPLACED_M = 111_318.84502, 100_000.0
# Where ArduPilot's first filter clips its positions, and that it clips to the metre.
CLIPPED_M, CLIP_WIDTH_M = 1_000_000.0, 50.0
# Microseconds and nanoseconds of UNIX time, 2001 to 2286; since boot they are less.
UNIX_US, UNIX_NS = (10**15, 10**16), (10**18, 10**19)
MIN_WEEK = 1_000  # of GPS: 1999

_LATITUDE = re.compile(r"(?:.*_|[A-Za-z]{0,3})?(?:lat|latitude)(?:_.*|\d*)", re.IGNORECASE)
_LONGITUDE = re.compile(
    r"(?:.*_|[A-Za-z]{0,3})?(?:lon|lng|long|longitude)(?:_.*|\d*)", re.IGNORECASE
)
# Gains of controllers along latitude and longitude, in ArduPilot until 2015.
_NO_PLACE = re.compile(r"(?:HLD|LOITER|NAV)_(?:LAT|LON)_(?:P|I|D|IMAX)|SIM_INIT_.*_OFS")
_WEEK = re.compile(r".*week|gwk|wn", re.IGNORECASE)
_UTC = re.compile(r".*utc.*|.*unix.*|epoch", re.IGNORECASE)
# Parameters that name a vehicle, its parts, its owner's network or time zone, or what it did
# before; places that PX4 keeps as whole numbers of 1e-7 deg.
_IDENTIFYING = re.compile(
    r"BRD_SERIAL_NUM|BATT\d?_SERIAL_NUM|STAT_.*|ADSB_(?:ICAO_ID|ICAO_SPECL|SQUAWK|CALLSIGN.*)"
    r"|(?:NET|DDS|PPP)_.*(?:ADDR|IP|NETMASK)\d*|UXRCE_DDS_(?:AG_IP|KEY)|WIFI_.*|DID_.*"
    r"|LND_FLIGHT_T_.*|COM_FLIGHT_UUID|SYS_NUM_RESETS|LOG_LASTFILE"
    r"|BRD_RTC_TZ_MIN|SDLOG_UTC_OFFSET|NAV_\w+_(?:LAT|LON)"
)
_NONE = -1.0  # says that there is no such id
# Columns that name a vehicle, a part of it or a plan.
_IDENTITY = re.compile(
    r".*serial_?(?:number|no)|(?:.*_)?(?:uuid|unique_id)|manufacture_date|squawk"
    r"|(?:mission|fence|geofence|safe_points|rally_points|opaque)_id",
    re.IGNORECASE,
)
_UID = re.compile(rb"[0-9A-Fa-f]{8}(?: [0-9A-Fa-f]{8}){2}|[0-9A-Fa-f]{12,}")
_NAMING = re.compile(
    rb"[\w.+-]+@[\w.-]+|\w+://\S+|[A-Za-z]:\\\S+|(?:~|\.)?(?:/[\w.@+ -]+){2,}"
    rb"|(?:\d{1,3}\.){3}\d{1,3}|(?<!\d)20\d\d-\d\d-\d\d(?!\d)"
)
_DECIMAL = re.compile(rb"-?\d{1,3}\.\d{3,}|-?\d{7,10}")
_LETTERS = bytes.maketrans(
    b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ123456789",
    b"x" * 52 + b"0" * 9,
)
Numbers = NDArray[Any]


class Coordinates(NamedTuple):
    """A place on earth."""

    latitude_deg: float
    longitude_deg: float


class Replacement(NamedTuple):
    """What replaces what in one recording."""

    origin: Coordinates | None  # of the flight; None: it has no position
    target: Coordinates  # where it goes
    weeks: int  # by which dates go back
    salt: bytes  # of the pseudonyms, and nowhere else
    fields: BothFields | None = None  # None: unknown, and what depends on it is left out

    # --- places ---------------------------------------------------------------------------------

    def latitude_deg(self, value: Numbers) -> Numbers:
        """Moved latitudes; without an origin they are 0."""
        if self.origin is None:
            return np.zeros_like(value)
        moved = value + (self.target.latitude_deg - self.origin.latitude_deg)
        return np.clip(moved, -90.0, 90.0)

    def longitude_deg(self, value: Numbers) -> Numbers:
        """Moved longitudes, with the same distances at the other latitude."""
        if self.origin is None:
            return np.zeros_like(value)
        shrunk = math.cos(math.radians(self.origin.latitude_deg))
        shrunk /= max(math.cos(math.radians(self.target.latitude_deg)), 1e-3)
        apart = (value - self.origin.longitude_deg + 180.0) % 360.0 - 180.0
        return (self.target.longitude_deg + apart * shrunk + 180.0) % 360.0 - 180.0

    def moved(
        self,
        name: str,
        stored: Numbers,
        *,
        is_sure: bool = False,
        other: Numbers | None = None,
        scale: float | None = None,
    ) -> Numbers | None:
        """The stored values of a field, if it is a latitude or a longitude; else None.

        Args:
            name: of the field.
            stored: 0 and not-a-number are unknown.
            is_sure: the format says that it is a place; otherwise only values near the flight are.
            other: of the longitude that belongs to a latitude, and the other way round.
            scale: of one degree; 1e7 for whole numbers and 1 for floats if it is not given.
        """
        which = which_of(name)
        if which is None or stored.dtype.kind not in "if" or stored.dtype.itemsize < 4:
            return None
        if scale is None:
            scale = DEG_E7 if stored.dtype.kind == "i" else 1.0
        value = stored.astype(np.float64) / scale
        known = np.isfinite(value) & (value != 0.0) & (np.abs(value) <= 180.0)
        if is_sure:
            value = self._not_far(which, value, other, scale)
        else:
            known &= self.is_near(which, value)
        function = self.latitude_deg if which == "latitude" else self.longitude_deg
        with np.errstate(invalid="ignore"):
            found = np.where(known, function(value), value) * scale
        if stored.dtype.kind == "i":
            found = np.rint(np.nan_to_num(found))
        moved: Numbers = np.where(known, found, stored).astype(stored.dtype)
        return moved

    def _not_far(self, which: str, value: Numbers, other: Numbers | None, scale: float) -> Numbers:
        """Values of places, those that are far away at the edge of what is near."""
        if self.origin is None:
            return value
        own = self.origin.latitude_deg if which == "latitude" else self.origin.longitude_deg
        with np.errstate(invalid="ignore"):
            apart = (value - own + 180.0) % 360.0 - 180.0
            is_null = np.abs(value) < NULL_DEG
            if other is None or max(abs(each) for each in self.origin) < NEAR_DEG:
                is_null[:] = False
            else:
                is_null &= np.abs(other.astype(np.float64) / scale) < NULL_DEG
            near = np.clip(apart, -NEAR_DEG, NEAR_DEG)
        return own + np.where(is_null, NEAR_DEG, near)

    def displaced(self, which: str, stored: Numbers) -> Numbers:
        """Metres from an estimate's origin; from one at 0 deg they are the place.

        Args:
            which: ``latitude`` for metres north, ``longitude`` for metres east.
            stored: floats.
        """
        if self.origin is None:
            return stored
        at = 0 if which == "latitude" else 1
        value_m = stored.astype(np.float64)
        with np.errstate(invalid="ignore"):
            is_place = self.is_near(which, value_m / DEGREE_M) & (np.abs(value_m) > DISPLACED_M)
            is_place &= np.abs(np.abs(value_m) - CLIPPED_M) > CLIP_WIDTH_M
        by_m = (self.target[at] - self.origin[at]) * DEGREE_M
        return np.where(is_place, value_m + by_m, value_m).astype(stored.dtype)

    def is_near(self, which: str, value: Numbers) -> NDArray[np.bool_]:
        """Whether values could be of the flight; without an origin all could."""
        if self.origin is None:
            return np.ones(np.shape(value), np.bool_)
        own = self.origin.latitude_deg if which == "latitude" else self.origin.longitude_deg
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs((value - own + 180.0) % 360.0 - 180.0) <= NEAR_DEG)

    # --- dates ----------------------------------------------------------------------------------

    def dated(self, name: str, stored: Numbers) -> Numbers | None:
        """The stored values of a field, if it is a date; else None."""
        if stored.dtype.kind not in "iu" or stored.dtype.itemsize < 2:
            return None
        back_s = self.weeks * WEEK_S
        moved: Numbers
        if _WEEK.fullmatch(name):
            moved = np.where(stored >= MIN_WEEK, stored - self.weeks, stored)
            return moved.astype(stored.dtype)
        if stored.dtype.itemsize == 8:
            is_us = (stored >= UNIX_US[0]) & (stored < UNIX_US[1])
            is_ns = (stored >= UNIX_NS[0]) & (stored < UNIX_NS[1])
            if not (is_us | is_ns).any():
                return None
            back = np.where(is_us, back_s * 10**6, 0) + np.where(is_ns, back_s * 10**9, 0)
            moved = stored - back.astype(stored.dtype)
            return moved.astype(stored.dtype)
        if stored.dtype.itemsize == 4 and _UTC.fullmatch(name):
            moved = np.where(stored > 10**9, stored - back_s, stored)
            return moved.astype(stored.dtype)
        return None

    def earlier_us(self, unix_us: int) -> int:
        """A date in microseconds of UNIX time; a clock that was never set shows none."""
        return unix_us - self.weeks * WEEK_S * 10**6 if unix_us >= UNIX_US[0] else unix_us

    # --- names ----------------------------------------------------------------------------------

    def pseudonym(self, identity: bytes) -> bytes:
        """As many bytes, always the same in this recording; zeros stay zeros."""
        if not any(identity):
            return identity
        return hashlib.shake_256(self.salt + identity).digest(len(identity))

    def text(self, text: bytes) -> bytes:
        """A text of the same length without ids, paths, addresses and places."""
        text = _UID.sub(self._hex, text)
        text = _DECIMAL.sub(self._decimal, text)
        return _NAMING.sub(lambda found: found[0].translate(_LETTERS), text)

    def _hex(self, found: "re.Match[bytes]") -> bytes:
        """A pseudonym in the form of the id: its letters' case and spaces."""
        digits = found[0].replace(b" ", b"")
        if digits.isdigit() and len(digits) < 24:  # a number
            return found[0]
        whole = digits if len(digits) % 2 == 0 else digits + b"0"
        other = self.pseudonym(bytes.fromhex(whole.decode())).hex().encode()[: len(digits)]
        if digits.upper() == digits:
            other = other.upper()
        parts, place = [], 0
        for part in found[0].split(b" "):
            parts.append(other[place : place + len(part)])
            place += len(part)
        return b" ".join(parts)

    def _decimal(self, found: "re.Match[bytes]") -> bytes:
        value = float(found[0])
        if b"." not in found[0]:
            value /= DEG_E7
        near = self.origin is not None and any(
            abs(value - own) <= NEAR_DEG for own in self.origin if abs(own) > NEAR_DEG / 50.0
        )
        return found[0].translate(_LETTERS) if near else found[0]

    def parameter(self, name: str, value: float) -> float:
        """The value of a parameter."""
        if _IDENTIFYING.fullmatch(name):
            return value if value == _NONE else 0.0
        other = anonymous_field.declination(self.fields, name, value)
        if other is not None:
            return other
        if _NO_PLACE.fullmatch(name):
            return value
        moved = self.moved(name, np.array([value], np.float64))
        return value if moved is None else float(moved[0])


def which_of(name: str) -> str | None:
    """``latitude`` or ``longitude`` by the name of a field; None for any other."""
    last = name.rpartition(".")[2].partition("[")[0]
    if _LATITUDE.fullmatch(last):
        return "latitude"
    return "longitude" if _LONGITUDE.fullmatch(last) else None


def is_identity(name: str) -> bool:
    """Whether a field identifies a vehicle, a part of it or a plan."""
    return _IDENTITY.fullmatch(name.rpartition(".")[2].partition("[")[0]) is not None


def patterns_of(fixes: Sequence[Coordinates]) -> list[bytes]:
    """Places as logs store them side by side: int32, float, double, text of 4 to 7 digits."""
    found = []
    for latitude, longitude in fixes:
        pair = np.array([latitude, longitude])
        found += [np.rint(pair * DEG_E7).astype(kind).tobytes() for kind in ("<i4", "<f4")]
        found += [pair.astype(kind).tobytes() for kind in ("<f4", "<f8")]
        found += [np.array([value], "<f8").tobytes() for value in pair]
        found += [f"{value:.{digits}f}".encode() for digits in (4, 5, 6, 7) for value in pair]
    return found
