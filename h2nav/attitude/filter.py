"""The interface of every attitude filter; the service knows nothing else of a filter."""

from typing import NamedTuple, Protocol

from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    VehicleState,
    VelocityFix,
)

# What a filter is told besides the samples: what holds until the next of its kind, and what was
# true at its own `t_us`.
LastingInput = VehicleState | EarthField | SensorDelays
TimedInput = VelocityFix
InputRecord = LastingInput | TimedInput


class FilterState(NamedTuple):
    """The complete state of a filter between two calls.

    Attributes:
        filter_name: the filter of the values, and its arithmetic if it has two.
        values: flat numbers; None stands for "not yet".
    """

    filter_name: str
    values: tuple[float | int | None, ...]


class AttitudeFilter(Protocol):
    """Samples in, estimates out; pure arithmetic without clock or I/O.

    A run split in two at any sample with `state` and `restore` gives identical estimates.
    """

    @property
    def name(self) -> str:
        """Stable name, as in the configuration and in tables."""

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Processes one sample; returns None during the start-up alignment.

        The step uses the samples' own times. A sample that is not later than the previous one must
        not be passed (the service counts and drops it).
        """

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Takes the autopilot's report of the vehicle, valid until the next call."""

    def use_field(self, field: EarthField) -> None:
        """Takes the expected earth field; a changed declination turns the heading at once."""

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes one velocity fix; filters without velocity aiding ignore it."""

    def use_delays(self, delays: SensorDelays) -> None:
        """Takes the sensors' delays, valid until the next call.

        Estimates stay as late as the rates make them (`h2nav.attitude.lead` corrects that). Filters
        that take every field as new ignore the delays.
        """

    @property
    def sensor_errors(self) -> SensorErrors:
        """The errors of the sensors estimated so far."""

    def doubt(self, doubt: SensorDoubt) -> None:
        """Takes sensors that were found wrong, whose errors are estimated anew.

        Filters without predicted errors of their sensors ignore it.
        """

    def restart(self) -> None:
        """Forgets time and attitude (new epoch, long gap); keeps the estimated bias."""

    def state(self) -> FilterState:
        """The complete state of the filter."""

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""


class TakesInputs:
    """Inherited by what takes some kinds of these records alike, or ignores them."""

    def take_input(self, what: InputRecord) -> None:
        """Takes a record whose kind has no method of its own; ignored unless this is overridden."""

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """See `AttitudeFilter`."""
        self.take_input(vehicle)

    def use_field(self, field: EarthField) -> None:
        """See `AttitudeFilter`."""
        self.take_input(field)

    def use_velocity(self, fix: VelocityFix) -> None:
        """See `AttitudeFilter`."""
        self.take_input(fix)

    def use_delays(self, delays: SensorDelays) -> None:
        """See `AttitudeFilter`."""
        self.take_input(delays)


class IgnoresInputs(TakesInputs):
    """Inherited by filters that do without some of these records, or without doubts."""

    def doubt(self, doubt: SensorDoubt) -> None:
        """Ignored; see `AttitudeFilter`."""


def pass_on(chosen: AttitudeFilter | TakesInputs, what: InputRecord) -> None:
    """Passes on one record other than a sample."""
    if isinstance(what, VelocityFix):
        chosen.use_velocity(what)
    elif isinstance(what, EarthField):
        chosen.use_field(what)
    elif isinstance(what, SensorDelays):
        chosen.use_delays(what)
    else:
        chosen.use_vehicle(what)
