"""Orders to the fake autopilot while it flies, from lines or keys, with a reply.

Names are those of the command line, with ``on`` and ``off`` in place of times.
"""

import math
from collections.abc import Callable

from h2nav.errors import BadInput
from h2nav.sim.autopilot import MOMENTOUS, FakeAutopilot
from h2nav.sim.faults import FAULT_KINDS, Fault, FaultKind, parse_untimed_fault
from h2nav.sim.personalities import PERSONALITIES
from h2nav.sim.scenarios import SCENARIOS, scenario

# Orders of single keys: the most instructive faults, and the orders without arguments.
KEYS = {
    "g": "gps-lost",
    "j": "gps-step",
    "h": "autopilot-heading",
    "t": "autopilot-tilt",
    "b": "gyro-bias",
    "f": "gyro-frozen",
    "a": "accel-fixed",
    "m": "hard-iron",
    "v": "vibration",
    "d": "drop",
    "r": "reboot",
    "p": "power-off",
    "n": "scenario next",
    "0": "clear",
    "s": "status",
    "?": "keys",
}
HELP = """\
NAME[=ARGUMENT][/IMU] [on [SECONDS] | off]   a fault; without on or off it begins, or ends
clear                                        all faults end
scenario NAME | scenario next                reboot at the start of this flight
status                                       what is flown, and what is wrong
list                                         the names of scenarios and faults
keys                                         what single keys do on a terminal
help                                         this list
quit                                         the program ends"""
# Faults without duration.
_INSTANT = ("reboot", "rate")


class Orders:
    """Carries out orders."""

    def __init__(self, autopilot: FakeAutopilot) -> None:
        self._autopilot = autopilot
        self._by_word: dict[str, Callable[[int, list[str]], str]] = {
            "clear": self._clear,
            "help": lambda _t_ns, _words: HELP,
            "keys": lambda _t_ns, _words: key_table(),
            "list": lambda _t_ns, _words: name_tables(),
            "scenario": self._scenario,
            "status": self._status,
        }

    def obey(self, t_ns: int, line: str) -> str:
        """Carries out one line and returns the reply.

        Args:
            t_ns: host time, never earlier than in any call of the autopilot before.
            line: such as ``gps-lost on`` or ``scenario hover``.

        Returns:
            The result, for people; empty for an empty line.

        Raises:
            BadInput: not an order, or not possible now.
        """
        words = line.split()
        if not words:
            return ""
        return self._by_word.get(words[0], self._fault)(t_ns, words)

    def _clear(self, t_ns: int, _words: list[str]) -> str:
        acting = self._acting(t_ns)
        return self._end(t_ns, acting) if acting else "there is no fault"

    def _status(self, t_ns: int, _words: list[str]) -> str:
        faults = ", ".join(map(shown, self._acting(t_ns))) or "no fault"
        return f"scenario {self._autopilot.options.scenario.name}, {faults}"

    def _scenario(self, t_ns: int, words: list[str]) -> str:
        self._need_power()
        if len(words) != 2:
            raise BadInput(f"scenario: expected one of next, {', '.join(SCENARIOS)}")
        name = words[1]
        if name == "next":
            names = list(SCENARIOS)
            present = names.index(self._autopilot.options.scenario.name)
            name = names[(present + 1) % len(names)]
        chosen = scenario(name)
        self._autopilot.fly(t_ns, chosen)
        return f"scenario {name}: {chosen.summary}"

    def _fault(self, t_ns: int, words: list[str]) -> str:
        """Begins or ends a fault."""
        name, sign, argument = words[0].partition("=")
        text = name.replace("_", "-") + sign + argument
        name = text.partition("=")[0].partition("/")[0]
        if name not in FAULT_KINDS:
            raise BadInput(f"{words[0]}: neither an order nor a fault; try help or list")
        acting = self._meant(t_ns, name, text.partition("/")[2])
        word = argument.partition("/")[0]
        if word and not isinstance(FAULT_KINDS[name].default, float):
            # Several axes or messages may be wrong at once: only the one that is named is meant.
            acting = [one for one in acting if one.argument == word]
        match words[1:]:
            case []:
                return self._end(t_ns, acting) if acting else self._begin(t_ns, text, math.inf)
            case ["on"]:
                return self._begin(t_ns, text, math.inf)
            case ["on", seconds]:
                return self._begin(t_ns, text, _seconds(seconds))
            case ["off"] if acting:
                return self._end(t_ns, acting)
            case ["off"]:
                raise BadInput(f"{text}: it is not there; try status")
            case _:
                raise BadInput(f"{text}: expected {text} [on [SECONDS] | off]; try help")

    def _begin(self, t_ns: int, text: str, length_s: float) -> str:
        fault = parse_untimed_fault(text, self._autopilot.seconds_at(t_ns), length_s)
        if fault.name == "clock-wrap":
            raise BadInput("clock-wrap: only from the start; use --fault clock-wrap@START")
        if fault.imu > self._autopilot.options.imus:
            raise BadInput(f"{text}: there is no IMU {fault.imu}; use --imus {fault.imu}")
        if fault.name in MOMENTOUS:
            self._need_power()
        if fault.name in _INSTANT:
            fault = fault._replace(length_s=0.0)
        # One number at a time, because a value is read once per fault name.
        replaced = [
            old
            for old in self._meant(t_ns, fault.name, str(fault.imu))
            if isinstance(fault.argument, float) or old.argument == fault.argument
        ]
        self._autopilot.end(t_ns, replaced)
        self._autopilot.begin(t_ns, fault)
        return f"{shown(fault)}: {FAULT_KINDS[fault.name].summary}"

    def _end(self, t_ns: int, faults: list[Fault]) -> str:
        self._autopilot.end(t_ns, faults)
        return f"over: {', '.join(map(shown, faults))}"

    def _meant(self, t_ns: int, name: str, imu: str) -> list[Fault]:
        """The active faults of a name, of one IMU or of any."""
        return [one for one in self._acting(t_ns) if one.name == name and imu in ("", str(one.imu))]

    def _acting(self, t_ns: int) -> list[Fault]:
        t_s = self._autopilot.seconds_at(t_ns)
        return [fault for fault in self._autopilot.schedule if fault.acts(t_s)]

    def _need_power(self) -> None:
        if self._autopilot.is_unpowered:
            raise BadInput("the autopilot has no power; `power-off off` gives it back")


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        raise BadInput(f"{text}: expected seconds, a number above 0")
    return seconds


def shown(fault: Fault) -> str:
    """A fault in the form of an order."""
    argument = f"{fault.argument:g}" if isinstance(fault.argument, float) else fault.argument
    imu = f"/{fault.imu}" if FAULT_KINDS[fault.name].of_imu else ""
    return f"{fault.name}{'=' if argument else ''}{argument}{imu}"


def key_table() -> str:
    """The orders of the keys, several per line."""
    entries = [
        f"{key} {order}" for key, order in {**KEYS, ":": "type an order", "q": "quit"}.items()
    ]
    rows = [entries[at : at + 4] for at in range(0, len(entries), 4)]
    return "\n".join("  ".join(f"{entry:19}" for entry in row).rstrip() for row in rows)


def name_tables() -> str:
    """The names of scenarios, faults and autopilots, with a line of help each."""
    scenarios = "".join(f"  {item.name:18}{item.summary}\n" for item in SCENARIOS.values())
    of_imus, others = (
        "".join(_fault_line(name, kind) for name, kind in FAULT_KINDS.items() if kind.of_imu is so)
        for so in (True, False)
    )
    return (
        f"scenarios:\n{scenarios}\n"
        "faults of the first IMU, such as gyro-zero@30+5, or of another, gyro-zero@30+5/2:\n"
        f"{of_imus}\n"
        f"other faults, such as drop=0.2@10+5 or reboot@8:\n{others}\n"
        f"autopilots: {', '.join(PERSONALITIES)}"
    )


def _fault_line(name: str, kind: FaultKind) -> str:
    default = "" if kind.default in (None, "") else f" (default {kind.default})"
    return f"  {name:18}{kind.summary}{default}\n"
