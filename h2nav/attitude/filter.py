"""The interface that every attitude filter of h2nav has; the service knows nothing more of it."""

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


class FilterState(NamedTuple):
    """Everything a filter remembers between two calls.

    Attributes:
        filter_name: the filter that the values belong to, and its arithmetic where it has two.
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
        """Takes one sample; None while the start-up alignment is still collecting.

        The step uses the samples' own times. A sample that is not later than the one before must
        not be passed (the service counts and drops it).
        """

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Takes what the autopilot says of the vehicle, valid until the next call."""

    def use_field(self, field: EarthField) -> None:
        """Takes the expected earth field; a changed declination turns the heading at once."""

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes one velocity fix; filters without velocity aiding ignore it."""

    def use_delays(self, delays: SensorDelays) -> None:
        """Takes how late the sensors are, valid until the next call.

        Estimates stay as late as the rates make them (`h2nav.attitude.lead` undoes it). Filters
        that take a field as if it were new ignore the delays.
        """

    @property
    def sensor_errors(self) -> SensorErrors:
        """What has been learnt of the sensors so far."""

    def doubt(self, doubt: SensorDoubt) -> None:
        """Takes that sensors were shown to be wrong: their errors are learnt anew.

        Filters that do not predict how well they know their sensors ignore it.
        """

    def restart(self) -> None:
        """Forgets time and attitude (new epoch, long gap); keeps the learnt bias."""

    def state(self) -> FilterState:
        """The complete memory of the filter."""

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""


def tell(
    chosen: AttitudeFilter, what: VehicleState | EarthField | SensorDelays | VelocityFix
) -> None:
    """Gives a filter one record of what is known besides the samples."""
    if isinstance(what, VelocityFix):
        chosen.use_velocity(what)
    elif isinstance(what, EarthField):
        chosen.use_field(what)
    elif isinstance(what, SensorDelays):
        chosen.use_delays(what)
    else:
        chosen.use_vehicle(what)
