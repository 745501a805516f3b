"""Records the inputs of the service's filter in place of a filter."""

import math
import struct
from collections.abc import Callable
from typing import get_args

import numpy as np

from h2nav.attitude.batch_driver import BatchSamples, Integers, Table
from h2nav.attitude.filter import (
    AttitudeFilter,
    FilterState,
    InputRecord,
    LastingInput,
    TakesInputs,
    pass_on,
)
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, SensorDoubt, SensorErrors
from h2nav.recordings.trials import FilterInput
from h2nav.service.autopilot import Identity

UNKNOWN = (math.nan, math.nan, math.nan)
# Arrival, autopilot's time, rate, force, field, whether there is a field, whether it is clipped.
_ROW = struct.Struct("<2q9d2?")
_COLUMNS = np.dtype(
    [
        *[("arrived_us", "<i8"), ("t_us", "<i8"), ("w_b", "<f8", 3), ("f_b", "<f8", 3)],
        *[("m_b_ut", "<f8", 3), ("has_field", "?"), ("clipped", "?")],
    ]
)


class Stretch:
    """Samples between two restarts of the filter, with its other inputs.

    Samples are stored packed, in a fifth of the memory of records: a log of an hour has millions.

    Attributes:
        inputs: the other inputs, each with the number of the sample that it precedes.
        identity: of the autopilot.
    """

    def __init__(self) -> None:
        self.inputs: list[FilterInput] = []
        self.identity: Identity | None = None
        self._rows = bytearray()

    def begin(self, identity: Identity | None) -> None:
        """Takes the autopilot's identity."""
        self.identity = identity

    def __len__(self) -> int:
        return len(self._rows) // _ROW.size

    def add(self, sample: ImuSample, arrived_us: int) -> None:
        """Stores a sample and the host time of its arrival."""
        t_us, w_b, f_b, m_b_ut, clipped = sample
        known, field = (False, UNKNOWN) if m_b_ut is None else (True, m_b_ut)
        self._rows += _ROW.pack(arrived_us, t_us, *w_b, *f_b, *field, known, clipped)

    @property
    def samples(self) -> BatchSamples:
        """All samples so far."""
        rows = self._table()
        names = ("t_us", "w_b", "f_b", "m_b_ut", "has_field", "clipped")
        return tuple.__new__(BatchSamples, (np.ascontiguousarray(rows[name]) for name in names))

    @property
    def arrived_us(self) -> Integers:
        """(N,) host time of each sample's arrival."""
        arrived_us: Integers = self._table()["arrived_us"].copy()
        return arrived_us

    def _table(self) -> Table:
        return np.frombuffer(bytes(self._rows), _COLUMNS)


class Listener(TakesInputs):
    """Takes a filter's place in the service and records every input.

    Args:
        make: creates a filter that gets the same inputs and returns the estimates; None = none.
        now_us: holds the host time of the latest arrival, one for all IMUs; None = a new one.

    Attributes:
        name: of the filter.
        stretches: so far; the last one is being filled.
        identity: of the autopilot, once it is known.
        others: of the further IMUs, in order.
    """

    def __init__(
        self,
        make: Callable[[Identity], AttitudeFilter] | None = None,
        now_us: list[int] | None = None,
    ) -> None:
        self.name = "listener"
        self._now_us = now_us or [0]
        self.stretches = [Stretch()]
        self.identity: Identity | None = None
        # by kind
        self._lasting: dict[type, LastingInput | None] = dict.fromkeys(get_args(LastingInput))
        self._make = make
        self._filter: AttitudeFilter | None = None
        self.others: list[Listener] = []
        self._further = 0

    def filter_for(self, identity: Identity) -> "Listener":
        """Starts for a vehicle; further calls return those of further IMUs."""
        if identity is self.identity:
            return self._next_other().filter_for(identity)
        self.identity = identity
        self._further = 0
        self._begin_stretch()
        self._filter = None if self._make is None else self._make(identity)
        return self

    def arrives(self, t_ns: int) -> None:
        """Sets the host time of arrival of what follows."""
        self._now_us[0] = t_ns // 1000

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Records a sample."""
        self.stretches[-1].add(sample, self._now_us[0])
        return None if self._filter is None else self._filter.update(sample)

    def take_input(self, what: InputRecord) -> None:
        """Records any other input."""
        if isinstance(what, LastingInput):
            self._lasting[type(what)] = what
        self._keep(what)
        if self._filter is not None:
            pass_on(self._filter, what)

    @property
    def sensor_errors(self) -> SensorErrors:
        """The errors estimated by the filter behind it."""
        if self._filter is None:
            return SensorErrors((0.0, 0.0, 0.0))
        return self._filter.sensor_errors

    def doubt(self, doubt: SensorDoubt) -> None:
        """Passes it on without a record, since it follows from the samples and the filter."""
        if self._filter is not None:
            self._filter.doubt(doubt)

    def restart(self) -> None:
        """Begins a stretch; what lasts still holds."""
        self._begin_stretch()
        if self._filter is not None:
            self._filter.restart()

    def _next_other(self) -> "Listener":
        if self._further == len(self.others):
            self.others.append(Listener(self._make, self._now_us))
        self._further += 1
        return self.others[self._further - 1]

    def _begin_stretch(self) -> None:
        if len(self.stretches[-1]):
            self.stretches.append(Stretch())
            for what in self._lasting.values():
                if what is not None:
                    self._keep(what)
        self.stretches[-1].begin(self.identity)

    def state(self) -> FilterState:
        """Returns an empty state: nothing has to be continued."""
        return FilterState(self.name, ())

    def restore(self, state: FilterState) -> None:
        """See `state`."""

    def _keep(self, what: InputRecord) -> None:
        stretch = self.stretches[-1]
        stretch.inputs.append(FilterInput(len(stretch), what))
