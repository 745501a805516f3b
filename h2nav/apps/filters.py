"""Creates the filter for a configuration and a vehicle, from its gain file."""

from collections.abc import Mapping

from h2nav.apps.algorithms import algorithm
from h2nav.apps.configuration import FilterSettings
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.gains.envelope import VEHICLE_CLASSES, GainFile, parse_gain_file
from h2nav.attitude.gains.seal import check_seal
from h2nav.errors import BadInput
from h2nav.files import gain_files, plain_yaml
from h2nav.service.autopilot import Identity


def shipped_names(settings: FilterSettings, imu_rate_hz: float) -> dict[str, str]:
    """Vehicle class -> gain file (path or shipped name) for a configuration."""
    classes: tuple[str, ...] = VEHICLE_CLASSES
    if settings.vehicle_class != "auto":
        classes = (settings.vehicle_class,)
    if settings.gains != "auto":
        return dict.fromkeys(classes, settings.gains)
    rate_hz = gain_files.shipped_rate(imu_rate_hz)
    if algorithm(settings.name).gains_by_class:
        return {name: f"{name}_{rate_hz}hz" for name in classes}
    return dict.fromkeys(classes, f"{settings.sensor}_{rate_hz}hz")


class FilterFactory:
    """Creates filters for vehicles, from gain files read and checked beforehand.

    Args:
        names: vehicle class -> name of its gain file.

    Raises:
        BadInput: a gain file is for another filter.
    """

    def __init__(
        self, settings: FilterSettings, names: Mapping[str, str], files: Mapping[str, GainFile]
    ) -> None:
        wanted = algorithm(settings.name).gain_kind
        for name, file in files.items():
            if file.filter_name != wanted:
                raise BadInput(
                    f"{name}: gains of kind {file.kind}, but filter.name {settings.name} needs "
                    f"{wanted}; choose another filter.gains or filter.name"
                )
        self._settings = settings
        self._names = names
        self._files = files
        # A file that cannot make a filter must fail now, not at the first heartbeat in flight.
        for file in files.values():
            self._filter_from(file)

    @classmethod
    def shipped(cls, settings: FilterSettings, imu_rate_hz: float) -> "FilterFactory":
        """Reads every file that the configuration may need, before any flight.

        Raises:
            BadInput: a file is missing, changed, or not certified.
        """
        names = shipped_names(settings, imu_rate_hz)
        files = {name: gain_files.load(name) for name in sorted(set(names.values()))}
        return cls(settings, names, files)

    @classmethod
    def recorded(
        cls, settings: FilterSettings, imu_rate_hz: float, contents: Mapping[str, bytes]
    ) -> "FilterFactory":
        """Uses the gain files attached to a log.

        Raises:
            BadInput: one is missing, changed, or not certified.
        """
        names = shipped_names(settings, imu_rate_hz)
        files = {}
        for name in sorted(set(names.values())):
            if name not in contents:
                raise BadInput(
                    f"{name}: the log does not hold this gain file; replay with --config"
                )
            file = parse_gain_file(plain_yaml.parse_bytes(contents[name], name), name)
            check_seal(file, name)
            files[name] = file
        return cls(settings, names, files)

    def gain_texts(self) -> dict[str, str]:
        """The files' contents by name, for the log."""
        return {name: gain_files.text_of(file) for name, file in self._files.items()}

    def filter_for(self, identity: Identity) -> AttitudeFilter:
        """Creates a filter for this vehicle."""
        wanted = self._settings.vehicle_class
        name = identity.vehicle_class if wanted == "auto" else wanted
        return self._filter_from(self._files[self._names[name]])

    def _filter_from(self, file: GainFile) -> AttitudeFilter:
        return algorithm(self._settings.name).makers[self._settings.arithmetic](file)
