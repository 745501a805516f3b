"""Creates the filter for a configuration and a vehicle, from its gain file."""

from collections.abc import Callable, Mapping

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
    """Creates filters for vehicles, from gain files.

    Args:
        names: vehicle class -> name of its gain file.
        load: reads and checks a gain file by its name.
    """

    def __init__(
        self, settings: FilterSettings, names: Mapping[str, str], load: Callable[[str], GainFile]
    ) -> None:
        self._settings = settings
        self._names = names
        self._load = load
        self._files: dict[str, GainFile] = {}

    def check(self) -> None:
        """Reads every file that a vehicle may need, and makes a filter from it.

        A file that cannot make one must fail before a flight, not at the first heartbeat in it.

        Raises:
            BadInput: a file is missing, changed, not certified, or for another filter.
        """
        for name in sorted(set(self._names.values())):
            self._filter_from(self._file(name))

    @classmethod
    def shipped(cls, settings: FilterSettings, imu_rate_hz: float) -> "FilterFactory":
        """Uses the files that the configuration names, or the shipped ones."""
        return cls(settings, shipped_names(settings, imu_rate_hz), gain_files.load)

    @classmethod
    def recorded(
        cls, settings: FilterSettings, imu_rate_hz: float, contents: Mapping[str, bytes]
    ) -> "FilterFactory":
        """Uses the gain files attached to a log."""

        def load(name: str) -> GainFile:
            if name not in contents:
                raise BadInput(
                    f"{name}: the log does not hold this gain file; replay with --config"
                )
            file = parse_gain_file(plain_yaml.parse_bytes(contents[name], name), name)
            check_seal(file, name)
            return file

        return cls(settings, shipped_names(settings, imu_rate_hz), load)

    def gain_texts(self) -> dict[str, str]:
        """The files' contents by name, for the log."""
        names = sorted(set(self._names.values()))
        return {name: gain_files.text_of(self._file(name)) for name in names}

    def filter_for(self, identity: Identity) -> AttitudeFilter:
        """Creates a filter for this vehicle."""
        wanted = self._settings.vehicle_class
        name = identity.vehicle_class if wanted == "auto" else wanted
        return self._filter_from(self._file(self._names[name]))

    def _file(self, name: str) -> GainFile:
        """A gain file, read and checked when it is first needed."""
        file = self._files.get(name)
        if file is None:
            file = self._load(name)
            wanted = algorithm(self._settings.name).gain_kind
            if file.filter_name != wanted:
                raise BadInput(
                    f"{name}: gains of kind {file.kind}, but filter.name {self._settings.name} "
                    f"needs {wanted}; choose another filter.gains or filter.name"
                )
            self._files[name] = file
        return file

    def _filter_from(self, file: GainFile) -> AttitudeFilter:
        return algorithm(self._settings.name).makers[self._settings.arithmetic](file)
